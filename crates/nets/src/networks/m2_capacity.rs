use super::definition::Definition;
use crate::batch::Shape;
use crate::layer::Chain;
use crate::layers::{BatchNorm, Conv2d, Flatten, Join, Linear, MaxPool, Relu};
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// NTNU-ERC's network for the capacity.
pub(super) const M2_CAPACITY: Definition = Definition {
    name: "m2_capacity",
    about: "M2 (NTNU-ERC), capacity / 4000 mL: four convolutions on a depth image, and its box",
    outputs: 1,
    classifies: false,
    architecture,
    paper: &[],
    takes: "a depth image and the box of the container",
    front_end: None,
    recipe: Recipe::adam(2.5e-4, 8, 500),
};

fn architecture(outputs: usize) -> Architecture {
    let depth = Shape::Image { height: 112, width: 112, channels: 1 };
    let mut layers: Chain = Vec::new();
    for (k, pair) in [1, 32, 64, 64, 128].windows(2).enumerate() {
        layers.push(Box::new(Conv2d::same3(format!("conv{}", k + 1), pair[0], pair[1])));
        layers.push(Box::new(Relu));
        layers.push(Box::new(BatchNorm::new(format!("bn{}", k + 1), pair[1])));
        layers.push(Box::new(MaxPool::new(2)));
    }
    layers.push(Box::new(Flatten));
    layers.push(Box::new(Linear::new("linear1", 6272, 64)));
    layers.push(Box::new(Relu));
    layers.push(Box::new(BatchNorm::new("bn5", 64)));
    layers.push(Box::new(Linear::new("linear2", 64, 6)));
    layers.push(Box::new(Relu));
    layers.push(Box::new(Join { other: 0, numbers: 2 }));
    layers.push(Box::new(Linear::new("linear3", 8, outputs)));
    Architecture {
        inputs: vec![Input::new("depth", depth), Input::new("box", Shape::Vector(2))],
        body: Body::Chain(layers),
        features: None,
        activation: false,
    }
}
