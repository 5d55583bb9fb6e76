use super::definition::Definition;
use crate::batch::Shape;
use crate::layer::Chain;
use crate::layers::{BatchNorm, Conv2d, Dropout, Flatten, Linear, MaxPool, Relu, Softmax};
use crate::front_end::{FrontEnd, Stretches};
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// HVRL's network for the type of a window.
pub(super) const M4_TYPE: Definition = Definition {
    name: "m4_type",
    about: "M4 (HVRL), type: thirteen convolutions on windows of 64 frames x 64 mel x 8 channels",
    outputs: 4,
    classifies: true,
    architecture,
    paper: &[],
    takes: "windows of 64 frames of 64 mel bands of 8 channels",
    front_end: Some(FRONT_END),
    recipe: Recipe { weight_decay: 1e-5, ..Recipe::adam(1e-5, 32, 200) },
};

/// Windows of 64 frames, 75 % overlap, scaled by the published extremes: the decibels of silence and
/// of the loudest recording.
const FRONT_END: FrontEnd = FrontEnd {
    preset: "m4-code",
    set: &[],
    windows: Some(Stretches::whole(64, 16)),
    item: |tensor| {
        let scale = |v: f32| ((f64::from(v) - MIN) / (MAX - MIN)) as f32;
        tensor.values.into_iter().map(scale).collect()
    },
};
const MIN: f64 = -313.071_195_49;
const MAX: f64 = 194.191_876_53;

const BLOCKS: [&[usize]; 5] =
    [&[32, 32], &[64, 64], &[128, 128, 128], &[256, 256, 256], &[256, 256, 256]];

fn architecture(outputs: usize) -> Architecture {
    let window = Shape::Image { height: 64, width: 64, channels: 8 };
    let mut layers: Chain = Vec::new();
    let mut channels = 8;
    for (b, widths) in BLOCKS.iter().enumerate() {
        for (k, &width) in widths.iter().enumerate() {
            let name = format!("conv{}_{}", b + 1, k + 1);
            layers.push(Box::new(Conv2d::same3(name, channels, width)));
            layers.push(Box::new(Relu));
            channels = width;
        }
        layers.push(Box::new(BatchNorm::new(format!("bn{}", b + 1), channels)));
        layers.push(Box::new(MaxPool::new(2)));
    }
    layers.push(Box::new(Flatten));
    let features = Some(layers.len());
    for (name, inputs) in [("fc1", 1024), ("fc2", 512)] {
        layers.push(Box::new(Linear::new(name, inputs, 512)));
        layers.push(Box::new(Relu));
        layers.push(Box::new(Dropout(0.5)));
    }
    layers.push(Box::new(Linear::new("fc3", 512, outputs)));
    layers.push(Box::new(Softmax));
    Architecture { inputs: vec![Input::new("window", window)], body: Body::Chain(layers), features, activation: true }
}
