//! Outputs, gradients, losses and trained outputs of every published network against PyTorch in
//! double precision.

use corsmal_nets::batch::Batch;
use corsmal_nets::loss::{Loss, Targets};
use corsmal_nets::network::Network;
use corsmal_nets::networks;
use corsmal_nets::optimiser::OptimiserSpec;
use corsmal_nets::trainer::{StepSettings, Trainer};
use serde_json::Value;

use crate::shared;

fn manifest() -> Option<Value> {
    let path = shared("parity/nets/nets.json")?;
    Some(serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap())
}

/// The manifest's formula for numbers between 0 and 1.
pub fn u(seed: u64, name: &str, n: usize) -> Vec<f64> {
    let crc = u64::from(crc32fast::hash(name.as_bytes()));
    (0..n as u64)
        .map(|i| i.wrapping_mul(2_654_435_761).wrapping_add(crc + seed * 40503) % (1 << 32))
        .map(|h| h as f64 / 4_294_967_296.0)
        .collect()
}

fn sizes(value: &Value) -> Vec<usize> {
    value.as_array().unwrap().iter().map(|v| v.as_u64().unwrap() as usize).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(all) => all.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap()],
    }
}

fn state(case: &Value, seed: u64) -> Vec<(String, Vec<usize>, Vec<f32>)> {
    let entries = case["state"].as_array().unwrap();
    let name = |e: &Value| e["name"].as_str().unwrap().to_owned();
    let base = |n: &str| n.rsplit_once('.').unwrap().0.to_owned();
    let norms: Vec<String> =
        entries.iter().map(name).filter(|n| n.ends_with("running_var")).map(|n| base(&n)).collect();
    entries
        .iter()
        .map(|e| {
            let (name, shape) = (name(e), sizes(&e["shape"]));
            let scale = (3.0 / shape[1..].iter().product::<usize>() as f64).sqrt();
            let norm = norms.contains(&base(&name)) && name.ends_with("weight");
            let value = |x: f64| {
                if name.ends_with("running_var") || norm {
                    0.5 + x
                } else if name.ends_with("running_mean") || name.contains("bias") {
                    0.2 * x - 0.1
                } else {
                    (2.0 * x - 1.0) * scale
                }
            };
            let numbers = u(seed, &name, shape.iter().product());
            let values = numbers.into_iter().map(|x| value(x) as f32).collect();
            (name, shape, values)
        })
        .collect()
}

/// The manifest's arrays as the network's inputs: four views come as one array.
fn inputs(case: &Value, seed: u64, network: &Network) -> Vec<Batch> {
    let mut arrays = Vec::new();
    for d in case["inputs"].as_object().unwrap().values() {
        let shape = sizes(&d["shape"]);
        let (lo, hi) = (d["lo"].as_f64().unwrap(), d["hi"].as_f64().unwrap());
        let raw = u(seed, d["u"].as_str().unwrap(), shape.iter().product());
        let values: Vec<f32> = raw.into_iter().map(|x| (lo + (hi - lo) * x) as f32).collect();
        arrays.push((shape, values));
    }
    network.batches(&arrays).unwrap()
}

fn near(what: &str, got: &[f64], want: &[f64], atol: f64, rtol: f64) {
    assert_eq!(got.len(), want.len(), "{what}");
    let ratio = |(g, w): (&f64, &f64)| (g - w).abs() / (atol + rtol * w.abs());
    let worst = got.iter().zip(want).map(ratio).fold(0.0, f64::max);
    assert!(worst <= 1.0, "{what}: {worst:.3} of the tolerance\n{got:?}\n{want:?}");
}

fn wide(batch: &Batch) -> Vec<f64> {
    batch.values.values().iter().map(|&v| f64::from(v)).collect()
}

/// How far the last loss may be from PyTorch's where the rounding of weights decides it. The manifest allows ten times the
/// difference of one run. PyTorch in double precision, with weights moved by up to half a unit in their last place,
/// is up to 2.2e-3 from its own third loss; a network that does not learn is 9e-3 from it.
const SPREAD: [(&str, f64); 1] = [("m4_type", 3e-3)];

fn check(case: &Value) {
    let name = case["name"].as_str().unwrap();
    let seed = case["seed"].as_u64().unwrap();
    let mut network = networks::named(name).unwrap().build(None, 0).unwrap();
    let state = state(case, seed);
    network.load_state(&state).unwrap();
    assert_eq!(network.parameters().count() as u64, case["parameters"].as_u64().unwrap(), "{name}");
    for ((declared, values), (name, shape, given)) in network.parameters().iter().zip(&state) {
        assert_eq!((&declared.name, &declared.shape), (name, shape));
        assert_eq!(values, given);
    }
    let x = inputs(case, seed, &network);
    let expect = |key: &str| (numbers(&case[key]["values"]), case[key]["atol"].as_f64());
    let (want, atol) = expect("outputs");
    near(name, &wide(&network.forward(&x).unwrap()), &want, atol.unwrap(), 0.0);
    if case.get("features").is_some() {
        let (want, atol) = expect("features");
        let features = network.features(&x).unwrap();
        let n = features.shape.len();
        let got: Vec<f64> = wide(&features).chunks(n).flat_map(|row| row[..16].to_vec()).collect();
        near("features", &got, &want, atol.unwrap(), 0.0);
    }

    let classes = case["classes"].as_u64().unwrap() as usize;
    let items = x[0].items();
    let targets = match classes {
        0 => Targets::Numbers((0..items).map(|i| (i % 3) as f32 / 4.0).collect()),
        n => Targets::Classes((0..items).map(|i| i % n).collect()),
    };
    let recipe = &case["recipe"];
    let number = |key: &str| recipe[key].as_f64().unwrap_or(0.0);
    let (lr, momentum, weight_decay) = (number("lr"), number("momentum"), number("weight_decay"));
    let settings = StepSettings {
        optimiser: match recipe["optimizer"].as_str().unwrap() {
            "sgd" => OptimiserSpec::Sgd { lr, momentum, weight_decay },
            _ => OptimiserSpec::Adam { lr, weight_decay },
        },
        clip_grad_norm: recipe["clip_grad_norm"].as_f64(),
        loss: if classes == 0 { Loss::Mse } else { Loss::CrossEntropy },
        class_weights: match &recipe["class_weights"] {
            Value::Null => Vec::new(),
            weights => numbers(weights).into_iter().map(|w| w as f32).collect(),
        },
        dropout: None,
    };
    let mut trainer = Trainer::new(&mut network, settings);
    let (mut losses, mut first) = (Vec::new(), None);
    for _ in 0..case["steps"].as_u64().unwrap() {
        let step = trainer.step(&x, &targets).unwrap();
        losses.push(step.loss);
        first.get_or_insert(step.norms);
    }
    let (want, atol) = expect("losses");
    let (last, before) = losses.split_last().unwrap();
    near(&format!("{name} losses"), before, &want[..before.len()], atol.unwrap(), 0.0);
    let spread = SPREAD.iter().find(|(spread, _)| *spread == name).map(|(_, atol)| *atol);
    near(
        &format!("{name} last loss"),
        &[*last],
        &want[before.len()..],
        spread.or(atol).unwrap(),
        0.0,
    );
    let first = first.unwrap();
    let rtol = case["gradient_norms"]["rtol"].as_f64().unwrap();
    for (key, want) in case["gradient_norms"]["values"].as_object().unwrap() {
        let (got, want) = (first[key], want.as_f64().unwrap());
        near(&format!("{name} gradient of {key}"), &[got], &[want], 1e-7, rtol);
    }
    let (want, atol) = expect("outputs_after");
    let after = trainer.network.forward(&x).unwrap();
    near(&format!("{name} after"), &wide(&after), &want, atol.unwrap(), 0.0);
}

macro_rules! golden {
    ($($name:ident),*) => {$(
        #[test]
        fn $name() {
            let Some(manifest) = manifest() else { return };
            let cases = manifest["cases"].as_array().unwrap();
            check(cases.iter().find(|c| c["name"] == stringify!($name)).unwrap());
        }
    )*};
}

golden!(
    m2_type,
    m2_capacity,
    m3_mlp,
    m4_type,
    m4_level,
    m5_vggish_level,
    m5_r21d_level,
    m5_r21d_type,
    m6_action,
    m6_pouring,
    m6_shaking
);

#[test]
fn every_case_of_the_manifest_is_checked() {
    let Some(manifest) = manifest() else { return };
    assert_eq!(manifest["cases"].as_array().unwrap().len(), 11);
}
