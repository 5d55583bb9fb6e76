//! Gradients against differences of the loss, threads, lengths, dropout.

use corsmal_nets::batch::{Batch, Shape};
use corsmal_nets::layer::Chain;
use corsmal_nets::layers::{
    Attention, AveragePool, BatchNorm, Bidirectional, Conv2d, Dropout, FlattenPixels, FramePool,
    Linear, MaxPool, Recurrent, Relu, Residual,
};
use corsmal_nets::loss::{Loss, Targets};
use corsmal_nets::network::{Architecture, Body, Input, Network};
use corsmal_nets::optimiser::OptimiserSpec;
use corsmal_nets::random::Stream;
use corsmal_nets::trainer::{StepSettings, Trainer};
use corsmal_nets::{NetError, networks};

fn network(shape: Shape, chain: Chain) -> Network {
    let inputs = vec![Input::new("x", shape)];
    Network::new(
        "test",
        Architecture { inputs, body: Body::Chain(chain), features: None, activation: false },
        3,
    )
    .unwrap()
}

fn noise(seed: u64, n: usize) -> Vec<f32> {
    let stream = Stream::new(seed, "noise");
    (0..n as u64).map(|i| 2.0 * stream.uniform(i) - 1.0).collect()
}

/// Every parameter's gradient along a random direction against a central difference.
fn check_gradients(network: &mut Network, x: &Batch) {
    let targets = Targets::Classes((0..x.items()).map(|i| i % network.outputs()).collect());
    let run = |network: &Network| {
        let inputs = std::slice::from_ref(x);
        network.gradients(inputs, &targets, &Loss::CrossEntropy, &[], None).unwrap()
    };
    let found = run(network);
    let state: Vec<_> = network
        .parameters()
        .iter()
        .map(|(d, v)| (d.name.clone(), d.shape.clone(), v.to_vec()))
        .collect();
    for i in 0..state.len() {
        let Some(gradient) = found.by_parameter.get(&state[i].0) else { continue };
        let direction = noise(i as u64, state[i].2.len());
        let along: f64 = gradient
            .values()
            .iter()
            .zip(&direction)
            .map(|(g, d)| f64::from(*g) * f64::from(*d))
            .sum();
        let mut at = |step: f32| {
            let mut moved = state.clone();
            moved[i].2.iter_mut().zip(&direction).for_each(|(v, d)| *v += step * d);
            network.load_state(&moved).unwrap();
            run(network).loss
        };
        let step = 1e-2 / (direction.len() as f32).sqrt();
        let difference = (at(step) - at(-step)) / (2.0 * f64::from(step));
        let scale = along.abs().max(difference.abs()).max(0.02);
        assert!(
            (along - difference).abs() < 0.03 * scale,
            "{}: {along} by backward, {difference} by differences",
            state[i].0
        );
    }
}

#[test]
fn a_residual_network_has_right_gradients() {
    let image = Shape::Image { height: 9, width: 8, channels: 2 };
    let mut network = network(
        image,
        vec![
            Box::new(Conv2d::new("first", 2, 4, (3, 3)).stride(2).padding(1).unbiased()),
            Box::new(BatchNorm::new("bn", 4)),
            Box::new(Relu),
            Box::new(MaxPool::new(3).stride(2).padding(1)),
            Box::new(Residual::new(
                vec![
                    Box::new(Conv2d::same3("a", 4, 6)),
                    Box::new(BatchNorm::new("abn", 6)),
                    Box::new(Relu),
                    Box::new(Conv2d::same3("b", 6, 6)),
                ],
                vec![Box::new(Conv2d::new("short", 4, 6, (1, 1)))],
            )),
            Box::new(Residual::new(vec![Box::new(Conv2d::same3("c", 6, 6))], vec![])),
            Box::new(AveragePool),
            Box::new(Linear::new("out", 6, 3)),
        ],
    );
    check_gradients(&mut network, &Batch::new(noise(1, 5 * image.len()), image));
}

#[test]
fn frames_are_pooled_by_their_largest_and_their_mean() {
    let image = Shape::Image { height: 3, width: 2, channels: 1 };
    let pooled = network(image, vec![Box::new(FramePool)]);
    let x = Batch::new(vec![1.0, 3.0, 0.0, 8.0, -1.0, 1.0], image);
    // Means of the columns: 2, 4, 0.
    assert_eq!(pooled.forward(&[x]).unwrap().values.into_values(), [6.0]);
    let image = Shape::Image { height: 5, width: 4, channels: 2 };
    let mut network = network(
        image,
        vec![
            Box::new(Conv2d::same3("a", 2, 4).unbiased()),
            Box::new(BatchNorm::new("bn", 4)),
            Box::new(FramePool),
            Box::new(Linear::new("out", 4, 3)),
        ],
    );
    check_gradients(&mut network, &Batch::new(noise(1, 5 * image.len()), image));
}

#[test]
fn evaluation_and_training_see_the_same_pixels() {
    // Larger than a piece of work, smaller, and kernels that are as wide as the image.
    for (height, width, items) in [(30, 41, 2), (5, 7, 9)] {
        let image = Shape::Image { height, width, channels: 3 };
        let convolutions = [
            Conv2d::same3("c", 3, 5),
            Conv2d::new("c", 3, 17, (2, 3)).stride(3).padding(2),
            Conv2d::new("c", 3, 4, (5, 5)).stride(2).padding(3).unbiased(),
            Conv2d::new("c", 3, 4, (1, 1)),
            Conv2d::new("c", 3, 4, (3, 1)).stride(2),
            Conv2d::new("c", 3, 6, (2, width)).stride(2),
        ];
        for convolution in convolutions {
            let name = format!("{convolution:?}");
            let layers: Chain = vec![Box::new(convolution), Box::new(AveragePool)];
            let network = network(image, layers);
            let x = [Batch::new(noise(6, items * image.len()), image)];
            let targets = Targets::Classes(vec![0; items]);
            let trained = network.gradients(&x, &targets, &Loss::CrossEntropy, &[], None).unwrap();
            let evaluated = network.forward(&x).unwrap();
            let pairs = evaluated.values.values().iter().zip(trained.outputs.values.values());
            assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 1e-5), "{name}");
        }
    }
}

#[test]
fn pixels_are_flattened_in_their_order_and_back() {
    let image = Shape::Image { height: 2, width: 3, channels: 2 };
    let mut network = network(
        image,
        vec![
            Box::new(Conv2d::same3("a", 2, 2)),
            Box::new(FlattenPixels),
            Box::new(Linear::new("out", 12, 2)),
        ],
    );
    check_gradients(&mut network, &Batch::new(noise(1, 3 * image.len()), image));
    // VGGish's size follows from its layers.
    let vggish = networks::named("vggish").unwrap();
    let layers = (vggish.architecture)(128).body;
    let count: usize = layers.layers().flat_map(|l| l.parameters()).map(|d| d.len()).sum();
    assert_eq!(count, 72_141_184);
}

#[test]
fn recurrent_networks_have_right_gradients_with_lengths() {
    let shape = Shape::Sequence { steps: 0, numbers: 3 };
    let chains: [Chain; 3] = [
        vec![Box::new(Recurrent::gru("r", 3, 5, 2)), Box::new(Linear::new("out", 5, 2))],
        vec![Box::new(Recurrent::lstm("r", 3, 5, 2)), Box::new(Linear::new("out", 5, 2))],
        vec![
            Box::new(Linear::new("in", 3, 4)),
            Box::new(Bidirectional::gru("r", 4, 3)),
            Box::new(Attention::new("a", 6)),
            Box::new(Linear::new("out", 6, 2)),
        ],
    ];
    for chain in chains {
        let mut network = network(shape, chain);
        let steps = Shape::Sequence { steps: 6, numbers: 3 };
        let mut x = Batch::new(noise(2, 4 * 6 * 3), steps);
        x.lengths = Some(vec![2, 6, 1, 4]);
        check_gradients(&mut network, &x);
        let one = Shape::Sequence { steps: 1, numbers: 3 };
        check_gradients(&mut network, &Batch::new(noise(5, 4 * 3), one));
    }
}

/// Against the equations of PyTorch's `nn.GRU` in numpy's double precision; parameters and inputs are
/// `((7 i + 3 k) mod 11 - 5) / 10` for the i-th number of the k-th array.
#[test]
fn both_directions_and_attention_follow_their_equations() {
    let numbers = |k: usize, n: usize| -> Vec<f32> {
        (0..n).map(|i| ((i * 7 + k * 3) % 11) as f32 / 10.0 - 0.5).collect()
    };
    let mut network = network(
        Shape::Sequence { steps: 0, numbers: 2 },
        vec![
            Box::new(Bidirectional::gru("rnn", 2, 2)),
            Box::new(Attention::new("attention", 4)),
            Box::new(Linear::new("fc", 4, 2)),
        ],
    );
    let declared =
        network.parameters().iter().map(|(d, v)| (d.name.clone(), d.shape.clone(), v.len()));
    let state: Vec<_> =
        declared.enumerate().map(|(k, (name, shape, n))| (name, shape, numbers(k, n))).collect();
    assert_eq!(state[5].0, "rnn.weight_hh_l0_reverse");
    network.load_state(&state).unwrap();
    let mut values = numbers(11, 6);
    values.extend(numbers(16, 4));
    values.extend([-10.0; 2]);
    let mut x = Batch::new(values, Shape::Sequence { steps: 3, numbers: 2 });
    x.lengths = Some(vec![3, 2]);
    let found = network.forward(&[x]).unwrap().values.into_values();
    let expected = [0.250_773_5, 0.079_708_73, 0.151_421_6, 0.212_745_93];
    for (got, want) in found.iter().zip(expected) {
        assert!((got - want).abs() < 1e-6, "{found:?}");
    }
}

#[test]
fn padding_does_not_count_where_lengths_are_known() {
    for name in ["m5-vggish-level", "attention-gru"] {
        padding_does_not_count(name);
    }
}

fn padding_does_not_count(name: &str) {
    let network = networks::named(name).unwrap().build(None, 5).unwrap();
    let (short, long) = (noise(3, 4 * 128), noise(4, 9 * 128));
    let one = |values: &[f32]| {
        let shape = Shape::Sequence { steps: values.len() / 128, numbers: 128 };
        network.forward(&[Batch::new(values.to_vec(), shape)]).unwrap().values.into_values()
    };
    let mut values = short.clone();
    values.resize(9 * 128, -10.0);
    values.extend(&long);
    let mut both = Batch::new(values, Shape::Sequence { steps: 9, numbers: 128 });
    both.lengths = Some(vec![4, 9]);
    let both = network.forward(&[both]).unwrap().values.into_values();
    for (got, want) in both.iter().zip([one(&short), one(&long)].concat()) {
        assert!((got - want).abs() < 1e-5, "{got} {want}");
    }
}

fn settings(dropout: Option<u64>) -> StepSettings {
    StepSettings {
        optimiser: OptimiserSpec::Adam { lr: 1e-3, weight_decay: 0.0 },
        clip_grad_norm: Some(0.5),
        loss: Loss::CrossEntropy,
        class_weights: Vec::new(),
        dropout,
    }
}

/// Losses and the last outputs of three steps, with dropout.
fn train(threads: usize, seed: u64) -> (Vec<f64>, Vec<f32>) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let image = Shape::Image { height: 24, width: 24, channels: 1 };
        let mut network = network(
            image,
            vec![
                Box::new(Conv2d::same3("a", 1, 8)),
                Box::new(BatchNorm::new("bn", 8)),
                Box::new(Relu),
                Box::new(Dropout(0.3)),
                Box::new(Conv2d::same3("b", 8, 16)),
                Box::new(MaxPool::new(3)),
                Box::new(AveragePool),
                Box::new(Linear::new("out", 16, 3)),
            ],
        );
        let x = [Batch::new(noise(9, 7 * image.len()), image)];
        let targets = Targets::Classes(vec![0, 1, 2, 0, 1, 2, 0]);
        let mut trainer = Trainer::new(&mut network, settings(Some(seed)));
        let mut losses: Vec<f64> =
            (0..3).map(|_| trainer.step(&x, &targets).unwrap().loss).collect();
        let mut outputs = network.forward(&x).unwrap().values.into_values();
        let mut network = networks::named("attention_gru").unwrap().build(Some(3), 4).unwrap();
        let steps = Shape::Sequence { steps: 5, numbers: 128 };
        let mut x = Batch::new(noise(8, 7 * steps.len()), steps);
        x.lengths = Some(vec![5, 1, 3, 5, 2, 4, 1]);
        let x = [x];
        let mut trainer = Trainer::new(&mut network, settings(Some(seed)));
        losses.extend((0..3).map(|_| trainer.step(&x, &targets).unwrap().loss));
        outputs.extend(network.forward(&x).unwrap().values.values());
        (losses, outputs)
    })
}

#[test]
fn training_has_the_same_bits_for_any_number_of_threads() {
    assert_eq!(train(1, 0), train(2, 0));
    assert_eq!(train(1, 0), train(5, 0));
    assert_ne!(train(1, 0), train(1, 1));
}

#[test]
fn training_that_diverges_is_refused_and_changes_nothing() {
    let mut network = networks::named("m3_mlp").unwrap().build(None, 0).unwrap();
    let x = [Batch::new(vec![f32::MAX; 2 * 6193], Shape::Vector(6193))];
    let before = network.parameters().iter().next().unwrap().1.to_vec();
    let mut trainer = Trainer::new(&mut network, settings(None));
    let error = trainer.step(&x, &Targets::Classes(vec![0, 1])).unwrap_err();
    assert!(matches!(error, NetError::Diverged { step: 1, .. }), "{error}");
    assert_eq!(network.parameters().iter().next().unwrap().1, before);
}

#[test]
fn inputs_and_targets_that_do_not_fit_are_refused() {
    let network = networks::named("m5_r21d_type").unwrap().build(None, 0).unwrap();
    let text = |arrays: &[(Vec<usize>, Vec<f32>)]| network.batches(arrays).unwrap_err().to_string();
    let error = text(&[(vec![1, 3, 2, 512], vec![0.0; 3 * 1024])]);
    assert!(error.contains("[items, 4, steps, numbers]") && error.contains("[1, 3, 2, 512]"));
    let error = text(&vec![(vec![1, 2, 511], vec![0.0; 1022]); 4]);
    assert!(error.contains("c1") && error.contains("[items, steps, 512]"), "{error}");
    let own = networks::named("attention_gru").unwrap().build(None, 0).unwrap();
    let lengths = |lengths: &[usize]| {
        let mut x = own.batches(&[(vec![2, 3, 128], vec![0.0; 768])]).unwrap();
        x[0].lengths = Some(lengths.to_vec());
        own.forward(&x).map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(lengths(&[3, 1]), Ok(()));
    for (wrong, said) in [
        (&[3, 0][..], "from 1 to 3 for each of 2 items, not 0 for item 1"),
        (&[4, 3], "not 4 for item 0"),
        (&[3], "not a list of 1"),
    ] {
        assert!(lengths(wrong).unwrap_err().ends_with(said), "{wrong:?}");
    }
    let x = network.batches(&[(vec![1, 4, 2, 512], vec![0.5; 4096])]).unwrap();
    let run = |targets| network.gradients(&x, &targets, &Loss::CrossEntropy, &[], None);
    let error = run(Targets::Classes(vec![4])).unwrap_err().to_string();
    assert!(error.contains("class 4 for a network of 4 classes"), "{error}");
    let error = run(Targets::Classes(vec![0, 1])).unwrap_err().to_string();
    assert!(error.contains("2 targets for 1 items"), "{error}");
    assert!(networks::named("m7").unwrap_err().to_string().contains("m6_shaking"));
}
