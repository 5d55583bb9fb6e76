use super::definition::Definition;
use crate::batch::Shape;
use crate::layers::{Dropout, Linear, Recurrent, Sigmoid};
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// HVRL's network for the level.
pub(super) const M4_LEVEL: Definition = Definition {
    name: "m4_level",
    about: "M4 (HVRL), level: three LSTM layers on the type network's features of windows",
    outputs: 3,
    classifies: true,
    architecture,
    paper: &[("lr", 1e-5), ("batch", 32.0), ("epochs", 200.0)],
    takes: "m4_type's features of each window",
    front_end: None,
    // As in the code; the paper has 1e-5, 32 and 200.
    recipe: Recipe { clip_grad_norm: 0.5, drop_last: true, ..Recipe::adam(1e-4, 16, 400) },
};

fn architecture(outputs: usize) -> Architecture {
    Architecture {
        inputs: vec![Input::new("features", Shape::Sequence { steps: 0, numbers: 1024 })],
        body: Body::Chain(vec![
            Box::new(Recurrent::lstm("lstm", 1024, 256, 3).dropout(0.2)),
            Box::new(Dropout(0.2)),
            Box::new(Linear::new("fc", 256, outputs)),
            Box::new(Sigmoid),
        ]),
        features: None,
        activation: true,
    }
}
