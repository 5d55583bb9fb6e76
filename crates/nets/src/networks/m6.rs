use super::definition::Definition;
use crate::batch::Shape;
use crate::layer::Chain;
use crate::layers::{Conv2d, Dropout, Flatten, Linear, MaxPool, Relu};
use crate::front_end::FrontEnd;
use crate::network::{Architecture, Body, Input};
use crate::recipe::{InitialKind, Recipe};

/// Keras's initial values. The published code keeps the epoch of the best loss on a fifth of the
/// recordings.
const KERAS: Recipe = Recipe { initial: InitialKind::Glorot, ..Recipe::adam(1e-3, 16, 100) };

/// ACC's network for the action.
pub(super) const M6_ACTION: Definition = Definition {
    name: "m6_action",
    about: "M6 (ACC), action (none, pouring, shaking): four convolutions on a 96 x 96 spectrogram",
    outputs: 3,
    classifies: true,
    architecture: |outputs| architecture(&[64, 128], &[512, 512], false, outputs),
    paper: &[],
    takes: "a spectrogram of 96 x 96",
    front_end: Some(FrontEnd::of("m6-code")),
    recipe: KERAS,
};

/// ACC's network for what is poured.
pub(super) const M6_POURING: Definition = Definition {
    name: "m6_pouring",
    about: "M6 (ACC), type and level of what is poured: six convolutions on a spectrogram",
    outputs: 6,
    classifies: true,
    architecture: |outputs| architecture(&[64, 128, 256], &[512, 512], true, outputs),
    paper: &[],
    takes: "a spectrogram of 96 x 96",
    front_end: Some(FrontEnd::of("m6-code")),
    recipe: KERAS,
};

/// ACC's network for what is shaken.
pub(super) const M6_SHAKING: Definition = Definition {
    name: "m6_shaking",
    about: "M6 (ACC), type and level of what is shaken: four convolutions on a spectrogram",
    outputs: 4,
    classifies: true,
    architecture: |outputs| architecture(&[64, 128], &[512], false, outputs),
    paper: &[],
    takes: "a spectrogram of 96 x 96",
    front_end: Some(FrontEnd::of("m6-code")),
    recipe: KERAS,
};

/// Blocks of two convolutions and a pooling, then dense layers. The published softmax belongs to
/// the loss: outputs are logits.
fn architecture(widths: &[usize], dense: &[usize], dropout: bool, outputs: usize) -> Architecture {
    let mut layers: Chain = Vec::new();
    let (mut channels, mut side) = (1, 96);
    for (b, &width) in widths.iter().enumerate() {
        for k in 1..=2 {
            layers.push(Box::new(Conv2d::same3(format!("conv{}_{k}", b + 1), channels, width)));
            layers.push(Box::new(Relu));
            channels = width;
        }
        if dropout {
            layers.push(Box::new(Dropout(0.3)));
        }
        layers.push(Box::new(MaxPool::new(3)));
        side /= 3;
    }
    layers.push(Box::new(Flatten));
    let mut inputs = channels * side * side;
    for (k, &width) in dense.iter().enumerate() {
        layers.push(Box::new(Linear::new(format!("fc{}", k + 1), inputs, width)));
        layers.push(Box::new(Relu));
        inputs = width;
    }
    if dropout {
        layers.push(Box::new(Dropout(0.3)));
    }
    layers.push(Box::new(Linear::new("out", inputs, outputs)));
    let shape = Shape::Image { height: 96, width: 96, channels: 1 };
    Architecture {
        inputs: vec![Input::new("spectrogram", shape)],
        body: Body::Chain(layers),
        features: None,
        activation: false,
    }
}
