//! ResNet-18 against torchvision's names and an independent implementation.

use corsmal_nets::batch::{Batch, Shape};
use corsmal_nets::loss::{Loss, Targets};
use corsmal_nets::network::Network;
use corsmal_nets::{networks, picture};

use crate::golden::u;

/// Numbers by a formula, as in the manifest of the other networks.
fn by_formula(outputs: usize) -> Network {
    let mut network = networks::named("resnet18_level").unwrap().build(Some(outputs), 0).unwrap();
    let value = |name: &str, shape: &[usize], x: f64| match name.rsplit('.').next() {
        Some("running_var") => 0.5 + x,
        Some("weight") if shape.len() == 1 => 0.5 + x,
        Some("running_mean" | "bias") => 0.2 * x - 0.1,
        _ => (2.0 * x - 1.0) * (3.0 / shape[1..].iter().product::<usize>() as f64).sqrt(),
    };
    let of = |name: &str, shape: &[usize]| {
        let numbers = u(18, name, shape.iter().product()).into_iter();
        numbers.map(|x| value(name, shape, x) as f32).collect()
    };
    let declared = network.parameters().declared().iter();
    let state: Vec<_> =
        declared.map(|d| (d.name.clone(), d.shape.clone(), of(&d.name, &d.shape))).collect();
    network.load_state(&state).unwrap();
    network
}

fn near(got: &[f32], want: &[f64]) {
    assert_eq!(got.len(), want.len());
    let far = |(g, w): (&f32, &f64)| (f64::from(*g) - w).abs() > 1e-4;
    assert!(!got.iter().zip(want).any(far), "{got:?}\n{want:?}");
}

#[test]
fn parameters_are_torchvisions() {
    let network = networks::named("resnet18-type").unwrap().build(Some(1000), 0).unwrap();
    assert_eq!(network.parameters().count(), 11_689_512);
    let mut names = vec!["conv1.weight".to_owned()];
    let norm = |names: &mut Vec<String>, place: &str| {
        let of = ["weight", "bias", "running_mean", "running_var"];
        names.extend(of.map(|what| format!("{place}.{what}")));
    };
    norm(&mut names, "bn1");
    for (layer, block) in (1..=4).flat_map(|layer| [(layer, 0), (layer, 1)]) {
        let place = format!("layer{layer}.{block}");
        for k in 1..=2 {
            names.push(format!("{place}.conv{k}.weight"));
            norm(&mut names, &format!("{place}.bn{k}"));
        }
        if layer > 1 && block == 0 {
            names.push(format!("{place}.downsample.0.weight"));
            norm(&mut names, &format!("{place}.downsample.1"));
        }
    }
    names.extend(["fc.weight".to_owned(), "fc.bias".to_owned()]);
    let declared = network.parameters().declared();
    assert_eq!(declared.iter().map(|d| d.name.clone()).collect::<Vec<_>>(), names);
    for (name, shape) in [
        ("conv1.weight", &[64, 3, 7, 7][..]),
        ("layer1.0.conv1.weight", &[64, 64, 3, 3]),
        ("layer2.0.conv1.weight", &[128, 64, 3, 3]),
        ("layer2.0.downsample.0.weight", &[128, 64, 1, 1]),
        ("layer4.1.bn2.running_var", &[512]),
        ("fc.weight", &[1000, 512]),
    ] {
        assert_eq!(declared.iter().find(|d| d.name == name).unwrap().shape, shape, "{name}");
    }
}

/// Expected numbers by an implementation in numpy, in double precision.
#[test]
fn outputs_are_those_of_an_independent_implementation() {
    let network = by_formula(4);
    let n = 3 * 112 * 112;
    let values: Vec<f32> =
        u(18, "picture", 3 * n).into_iter().map(|x| (4.0 * x - 2.0) as f32).collect();
    let inputs = network.batches(&[(vec![3, 3, 112, 112], values)]).unwrap();
    let features = network.features(&inputs).unwrap();
    let first: Vec<f32> =
        features.values.values().chunks(512).flat_map(|row| row[..3].to_vec()).collect();
    let want = [
        0.9623565, 0.6472489, 0.0, 0.9414878, 0.6633857, 0.0025751, 0.9221076, 0.6393859, 0.0029453,
    ];
    near(&first, &want);
    let want = [
        [0.7698671, -1.8692983, 1.7913425, 0.1291632],
        [0.7635424, -1.8795955, 1.7964074, 0.1328253],
        [0.7486774, -1.8554105, 1.7739640, 0.1299738],
    ];
    near(network.forward(&inputs).unwrap().values.values(), want.as_flattened());
    // In training, by the statistics of the batch.
    let targets = Targets::Classes(vec![0, 1, 2]);
    let found = network.gradients(&inputs, &targets, &Loss::CrossEntropy, &[], None).unwrap();
    let want = [
        [2.4303917, -0.7195779, 0.7201046, 0.4265292],
        [2.1546148, -0.3928652, 0.4924331, 0.8205328],
        [1.7713635, 0.3467928, -0.2236465, 1.1976596],
    ];
    near(found.outputs.values.values(), want.as_flattened());
    assert!((found.loss - 1.979253206).abs() < 1e-4, "{}", found.loss);
    assert_eq!(found.by_parameter.len(), 62);
}

#[test]
fn a_training_begins_with_weights_of_other_classes() {
    let given = by_formula(1000);
    let mut state: Vec<_> = given
        .parameters()
        .iter()
        .map(|(d, values)| (d.name.clone(), d.shape.clone(), values.to_vec()))
        .collect();
    state.push(("bn1.num_batches_tracked".into(), vec![], vec![7.0]));
    let mut network = networks::named("resnet18_level").unwrap().build(None, 3).unwrap();
    let of = |network: &Network, name: &str| {
        network.parameters().iter().find(|(d, _)| d.name == name).unwrap().1.to_vec()
    };
    let random = of(&network, "fc.weight");
    assert_eq!(network.begin_with(&state).unwrap(), ["fc.weight", "fc.bias"]);
    let convolution = of(&given, "layer3.0.conv1.weight");
    for seed in [3, 4] {
        network.start(seed);
        assert!(of(&network, "layer3.0.conv1.weight") == convolution, "{seed}");
        assert_eq!(of(&network, "fc.weight") == random, seed == 3);
    }
    network.start_xavier(3, true);
    assert!(of(&network, "layer3.0.conv1.weight") == convolution);
    assert!(of(&network, "fc.weight") != random);

    // As many classes, but other ones.
    let definition = networks::named("resnet18_level").unwrap();
    let mut other = definition.build(None, 8).unwrap();
    let random = of(&other, "fc.weight");
    let own: Vec<_> = network
        .parameters()
        .iter()
        .map(|(d, values)| (d.name.clone(), d.shape.clone(), values.to_vec()))
        .collect();
    let left = definition.without_outputs(&own);
    assert_eq!(other.begin_with(&left).unwrap(), ["fc.weight", "fc.bias"]);
    assert!(of(&other, "fc.weight") == random);
    assert!(of(&other, "layer3.0.conv1.weight") == convolution);

    state.retain(|(name, ..)| name != "layer1.0.bn1.bias");
    state[0].1 = vec![64, 3, 7, 8];
    let error = network.begin_with(&state).unwrap_err().to_string();
    assert!(error.contains("layer1.0.bn1.bias [64] is missing"), "{error}");
    assert!(error.contains("conv1.weight is [64, 3, 7, 8], expected [64, 3, 7, 7]"), "{error}");
}

#[test]
fn only_pictures_are_pictures() {
    for definition in networks::NETWORKS {
        let size = definition.name.starts_with("resnet18").then_some((112, 112));
        assert_eq!(definition.picture(), size, "{}", definition.name);
    }
    let network = by_formula(5);
    let item = picture::item(&[127; 3 * 112 * 112]);
    let picture = Shape::Image { height: 112, width: 112, channels: 3 };
    assert_eq!(network.forward(&[Batch::new(item, picture)]).unwrap().values.cols(), 5);
}
