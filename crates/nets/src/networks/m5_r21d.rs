use super::definition::Definition;
use crate::batch::Shape;
use crate::layer::Chain;
use crate::layers::{Linear, Recurrent, Relu};
use crate::network::{Architecture, Body, Input};
use crate::recipe::{InitialKind, Recipe};

const XAVIER: Recipe =
    Recipe { initial: InitialKind::Xavier, seed: 1337, ..Recipe::adam(1e-4, 64, 30) };

/// Because It's Tactile's network for the level from R(2+1)D features of four views.
pub(super) const M5_R21D_LEVEL: Definition = Definition {
    name: "m5_r21d_level",
    about: "M5 (Because It's Tactile), level: three GRU layers for each view on R(2+1)D features",
    outputs: 3,
    classifies: true,
    architecture: |outputs| architecture(outputs, 512, 3),
    paper: &[],
    takes: "R(2+1)D features of four views",
    front_end: None,
    recipe: XAVIER,
};

/// The same for the type, smaller.
pub(super) const M5_R21D_TYPE: Definition = Definition {
    name: "m5_r21d_type",
    about: "M5 (Because It's Tactile), type: two GRU layers for each view on R(2+1)D features",
    outputs: 4,
    classifies: true,
    architecture: |outputs| architecture(outputs, 256, 2),
    paper: &[],
    takes: "R(2+1)D features of four views",
    front_end: None,
    recipe: XAVIER,
};

/// The views' logits are summed.
fn architecture(outputs: usize, hidden: usize, layers: usize) -> Architecture {
    let view = |v: usize| -> Chain {
        vec![
            Box::new(Recurrent::gru(format!("c{v}.rnn"), 512, hidden, layers)),
            Box::new(Relu),
            Box::new(Linear::new(format!("c{v}.fc"), hidden, outputs)),
        ]
    };
    let shape = Shape::Sequence { steps: 0, numbers: 512 };
    Architecture {
        inputs: (1..=4).map(|v| Input::new(format!("c{v}"), shape)).collect(),
        body: Body::Sum((1..=4).map(view).collect()),
        features: None,
        activation: false,
    }
}
