use super::definition::Definition;
use crate::batch::Shape;
use crate::layer::Chain;
use crate::layers::{Dropout, Linear, Relu};
use crate::front_end::FrontEnd;
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// Challengers' network.
pub(super) const M1: Definition = Definition {
    name: "m1",
    about: "M1 (Challengers), level or type: five dense layers on mean and deviation of the STFT",
    outputs: 3,
    classifies: true,
    architecture,
    paper: &[],
    takes: "the mean and deviation of 1025 STFT magnitudes",
    front_end: Some(FrontEnd {
        set: &["summary.stats=[\"mean\",\"std\"]"],
        ..FrontEnd::of("m1")
    }),
    // The paper names Adam alone; the rest is our choice.
    recipe: Recipe::adam(1e-3, 32, 100),
};

/// The paper says: five fully connected layers, dropout on the last hidden one. Widths and the way
/// from frames to a vector (mean and standard deviation of 1025 magnitudes) are our choice.
fn architecture(outputs: usize) -> Architecture {
    let mut layers: Chain = Vec::new();
    for (k, pair) in [2050, 1024, 512, 256, 128].windows(2).enumerate() {
        layers.push(Box::new(Linear::new(format!("fc{}", k + 1), pair[0], pair[1])));
        layers.push(Box::new(Relu));
    }
    layers.push(Box::new(Dropout(0.5)));
    layers.push(Box::new(Linear::new("fc5", 128, outputs)));
    Architecture {
        inputs: vec![Input::new("stft", Shape::Vector(2050))],
        body: Body::Chain(layers),
        features: None,
        activation: false,
    }
}
