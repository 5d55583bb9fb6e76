use super::definition::Definition;
use crate::batch::Shape;
use crate::layers::{Attention, Bidirectional, Dropout, Linear};
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// Our own small network on VGGish embeddings, for any classes.
pub(super) const ATTENTION_GRU: Definition = Definition {
    name: "attention_gru",
    about: "Ours: a bidirectional GRU with attention on VGGish embeddings",
    outputs: 3,
    classifies: true,
    architecture,
    paper: &[],
    takes: "VGGish embeddings",
    front_end: None,
    recipe: Recipe::adam(1e-3, 32, 40),
};

fn architecture(outputs: usize) -> Architecture {
    Architecture {
        inputs: vec![Input::new("vggish", Shape::Sequence { steps: 0, numbers: 128 })],
        body: Body::Chain(vec![
            Box::new(Bidirectional::gru("rnn", 128, 64)),
            Box::new(Attention::new("attention", 128)),
            Box::new(Dropout(0.5)),
            Box::new(Linear::new("fc", 128, outputs)),
        ]),
        features: None,
        activation: false,
    }
}
