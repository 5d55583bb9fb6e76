use super::definition::Definition;
use crate::batch::Shape;
use crate::layers::{Linear, Recurrent, Relu};
use crate::network::{Architecture, Body, Input};
use crate::recipe::{InitialKind, Recipe};

/// 25 epochs for the level, 30 for the type.
const XAVIER: Recipe =
    Recipe { initial: InitialKind::Xavier, seed: 1337, ..Recipe::adam(3e-4, 64, 25) };

/// Because It's Tactile's network for the level from VGGish embeddings.
pub(super) const M5_VGGISH_LEVEL: Definition = Definition {
    name: "m5_vggish_level",
    about: "M5 (Because It's Tactile), level: five GRU layers on VGGish embeddings",
    outputs: 3,
    classifies: true,
    architecture,
    paper: &[],
    takes: "VGGish embeddings",
    front_end: None,
    recipe: XAVIER,
};

/// The same for the type.
pub(super) const M5_VGGISH_TYPE: Definition = Definition {
    name: "m5_vggish_type",
    about: "M5 (Because It's Tactile), type: five GRU layers on VGGish embeddings",
    outputs: 4,
    recipe: Recipe { epochs: 30, ..XAVIER },
    ..M5_VGGISH_LEVEL
};

fn architecture(outputs: usize) -> Architecture {
    Architecture {
        inputs: vec![Input::new("vggish", Shape::Sequence { steps: 0, numbers: 128 })],
        body: Body::Chain(vec![
            Box::new(Recurrent::gru("rnn", 128, 512, 5)),
            Box::new(Relu),
            Box::new(Linear::new("fc", 512, outputs)),
        ]),
        features: None,
        activation: false,
    }
}
