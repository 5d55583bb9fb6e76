//! The layers of a GPU against those of the CPU: on burn's CPU backend in their place, or with `CORSMAL_GPU=1`
//! and the feature `gpu` on the GPU of the machine.

use super::Gpu;
use crate::batch::{Batch, Shape};
use crate::device::Device;
use crate::layers::{Attention, BatchNorm, Bidirectional, Linear, Recurrent, Sigmoid};
use crate::loss::{Loss, Targets};
use crate::network::{Architecture, Body, Input, Network};
use crate::networks::NETWORKS;
use crate::optimiser::OptimiserSpec;
use crate::random::Stream;
use crate::trainer::{StepSettings, Trainer};

fn gpu() -> Gpu {
    #[cfg(feature = "gpu")]
    if std::env::var_os("CORSMAL_GPU").is_some() {
        let gpu = Gpu::open().unwrap();
        eprintln!("on {}", gpu.name());
        return gpu;
    }
    Gpu::stand_in()
}

/// Whether the GPU of the machine is compared, see docs/networks.md for what was found there.
fn on_device() -> bool {
    cfg!(feature = "gpu") && std::env::var_os("CORSMAL_GPU").is_some()
}

const ITEMS: usize = 3;
const STEPS: usize = 5;

fn inputs(network: &Network) -> Vec<Batch> {
    let one = |(number, input): (usize, &Input)| {
        let shape = match input.shape {
            Shape::Sequence { numbers, .. } => Shape::Sequence { steps: STEPS, numbers },
            shape => shape,
        };
        let stream = Stream::new(number as u64, "inputs");
        let values = (0..ITEMS * shape.len()).map(|i| stream.uniform(i as u64) - 0.4).collect();
        let mut batch = Batch::new(values, shape);
        if matches!(shape, Shape::Sequence { .. }) {
            batch.lengths = Some(vec![STEPS - 1, 1, 3]);
        }
        batch
    };
    network.inputs().iter().enumerate().map(one).collect()
}

/// Differences that are rounding.
const NEAR: f32 = 2e-4;

/// Largest difference, as a share of the largest number.
fn difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let largest = a.iter().fold(1e-6f32, |m, v| m.max(v.abs()));
    a.iter().zip(b).fold(0.0f32, |m, (a, b)| m.max((a - b).abs())) / largest
}

fn same(name: &str, what: &str, cpu: &[f32], gpu: &[f32]) {
    let found = difference(cpu, gpu);
    assert!(found < NEAR, "{name}: {what} differs by {found}");
    assert!(cpu.iter().any(|v| *v != 0.0), "{name}: {what} is all zeros");
}

/// Outputs, features, and what a step of training finds; gives the difference of the gradients.
fn compare(mut network: Network) -> f32 {
    let name = network.name().to_owned();
    let inputs = inputs(&network);
    let (loss, targets) = match network.outputs() {
        1 => (Loss::Mse, Targets::Numbers(vec![0.3, -0.2, 0.9])),
        n => (Loss::CrossEntropy, Targets::Classes((0..ITEMS).map(|i| i % n).collect())),
    };
    let dropout = Some(Stream::new(7, "dropout"));
    let found = |network: &Network| {
        let outputs = [network.forward(&inputs).unwrap(), network.logits(&inputs).unwrap()];
        let features = network.features(&inputs).ok();
        (outputs, features, network.gradients(&inputs, &targets, &loss, &[], dropout).unwrap())
    };
    let (outputs, features, step) = found(&network);
    network.run_on(Device::Gpu(gpu()));
    let (gpu_outputs, gpu_features, gpu_step) = found(&network);
    let values = |batch: &Batch| batch.values.values().to_vec();
    for (cpu, gpu) in outputs.iter().zip(&gpu_outputs) {
        same(&name, "an output", &values(cpu), &values(gpu));
    }
    assert_eq!(features.is_some(), gpu_features.is_some());
    for (cpu, gpu) in features.iter().zip(&gpu_features) {
        same(&name, "a feature", &values(cpu), &values(gpu));
    }
    // Batch normalisation over few items enlarges rounding, which is coarse on some devices.
    let (by_output, by_loss) = if on_device() { (0.01, 0.01) } else { (NEAR, 1e-5) };
    let trained = difference(&values(&step.outputs), &values(&gpu_step.outputs));
    assert!(trained < by_output, "{name}: an output in training differs by {trained}");
    assert!(values(&step.outputs).iter().any(|v| *v != 0.0), "{name}: all outputs are zeros");
    let apart = (step.loss - gpu_step.loss).abs();
    let most = by_loss * step.loss.abs().max(1.0);
    assert!(apart < most, "{name}: losses {} and {}", step.loss, gpu_step.loss);
    assert_eq!(step.by_parameter.len(), gpu_step.by_parameter.len());
    // A bias before batch normalisation has no gradient but rounding: compared by the largest of all.
    let all = |step: &crate::network::Gradients| -> Vec<f32> {
        let declared = network.parameters().declared().iter().filter(|d| d.trained);
        declared.flat_map(|d| step.by_parameter[&d.name].values().to_vec()).collect()
    };
    let gradients = [all(&step), all(&gpu_step)];
    assert!(gradients[0].iter().any(|g| *g != 0.0), "{name}: no gradient");
    let names = |step: &crate::network::Gradients| -> Vec<String> {
        step.running.iter().map(|(name, _)| name.clone()).collect()
    };
    assert_eq!(names(&step), names(&gpu_step));
    for ((statistic, cpu), (_, gpu)) in step.running.iter().zip(&gpu_step.running) {
        same(&name, statistic, cpu, gpu);
    }
    difference(&gradients[0], &gradients[1])
}

#[test]
fn every_network_gives_what_it_gives_on_the_cpu() {
    for definition in NETWORKS {
        // Where two numbers in a window of a pooling are very near, rounding says which is the largest and gets
        // the gradient; not so with every seed.
        let (name, mut found) = (definition.name, Vec::new());
        let near = if on_device() { 0.02 } else { NEAR };
        for seed in 0..5 {
            found.push(compare(definition.build(None, seed).unwrap()));
            if found[seed as usize] < near {
                break;
            }
        }
        assert!(found.iter().all(|d| *d < 0.1), "{name}: gradients differ by {found:?}");
        assert!(found.iter().any(|d| *d < near), "{name}: gradients differ by {found:?}");
    }
}

#[test]
fn layers_that_no_network_of_the_table_has_in_this_way_do_too() {
    let build = |name: &str, body| {
        let inputs = vec![Input::new("steps", Shape::Sequence { steps: 0, numbers: 4 })];
        let architecture = Architecture { inputs, body, features: None, activation: false };
        Network::new(name, architecture, 5).unwrap()
    };
    let first = compare(build(
        "both directions, each step, then a GRU of two layers",
        Body::Chain(vec![
            Box::new(Linear::new("first", 4, 6)),
            Box::new(BatchNorm::new("norm", 6)),
            Box::new(Bidirectional::gru("both", 6, 5)),
            Box::new(Sigmoid),
            Box::new(Recurrent::gru("gru", 10, 3, 2).dropout(0.3)),
        ]),
    ));
    let second = compare(build(
        "attention over the padding too",
        Body::Chain(vec![
            Box::new(Bidirectional::gru("both", 4, 3)),
            Box::new(Linear::new("each", 6, 2)),
            Box::new(Attention::new("attention", 2)),
        ]),
    ));
    assert!(first.max(second) < NEAR, "gradients differ by {first} and {second}");
}

#[test]
fn a_training_follows_the_cpus() {
    let settings = StepSettings {
        optimiser: OptimiserSpec::Adam { lr: 1e-3, weight_decay: 1e-4 },
        clip_grad_norm: Some(0.5),
        loss: Loss::CrossEntropy,
        class_weights: vec![],
        dropout: Some(2),
    };
    for name in ["m2_type", "m4_level"] {
        let definition = crate::networks::named(name).unwrap();
        let losses = |device: Device| -> Vec<f64> {
            let mut network = definition.build(None, 1).unwrap();
            network.run_on(device);
            let inputs = inputs(&network);
            let mut trainer = Trainer::new(&mut network, settings.clone());
            let targets = Targets::Classes(vec![0, 1, 2]);
            (0..8).map(|_| trainer.step(&inputs, &targets).unwrap().loss).collect()
        };
        let (cpu, gpu) = (losses(Device::Cpu), losses(Device::Gpu(gpu())));
        for (cpu, gpu) in cpu.iter().zip(&gpu) {
            assert!((cpu - gpu).abs() < 1e-3 * cpu, "{name}: {cpu} and {gpu}");
        }
        assert!(cpu[7] < cpu[0], "{name} learns nothing: {cpu:?}");
    }
}

#[test]
fn a_panic_of_the_driver_is_an_error_that_names_it() {
    let gpu = Gpu::stand_in();
    let error = gpu.failure(super::shielded(|| -> () { panic!("device lost") }).unwrap_err());
    assert_eq!(
        error.to_string(),
        "GPU stand-in: device lost; if its memory is full, try a smaller batch; --device cpu needs no GPU"
    );
}
