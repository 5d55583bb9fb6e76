use super::definition::Definition;
use crate::batch::Shape;
use crate::layers::{Linear, Relu};
use crate::front_end::FrontEnd;
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// Concatenation's perceptron for a category and a task.
pub(super) const M3_MLP: Definition = Definition {
    name: "m3_mlp",
    about: "M3 (Concatenation), level or type: a perceptron on a spectrogram of 6193 values",
    outputs: 3,
    classifies: true,
    architecture,
    paper: &[],
    takes: "a spectrogram of 6193 values",
    front_end: Some(FrontEnd { item: |tensor| tensor.by_coefficient(), ..FrontEnd::of("m3") }),
    // The paper names none: our choice.
    recipe: Recipe::adam(1e-4, 32, 100),
};

fn architecture(outputs: usize) -> Architecture {
    Architecture {
        inputs: vec![Input::new("spectrogram", Shape::Vector(6193))],
        body: Body::Chain(vec![
            Box::new(Linear::new("fc1", 6193, 3096)),
            Box::new(Relu),
            Box::new(Linear::new("fc2", 3096, 512)),
            Box::new(Relu),
            Box::new(Linear::new("out", 512, outputs)),
        ]),
        features: None,
        activation: false,
    }
}
