use super::definition::Definition;
use crate::batch::Shape;
use crate::layers::{Conv2d, Dropout, Flatten, Linear, Relu};
use crate::front_end::FrontEnd;
use crate::network::{Architecture, Body, Input};
use crate::recipe::{OptimizerKind, Recipe};

/// NTNU-ERC's network for the type.
pub(super) const M2_TYPE: Definition = Definition {
    name: "m2_type",
    about: "M2 (NTNU-ERC), type: two convolutions on 30 s of 40 normalised MFCC",
    outputs: 4,
    classifies: true,
    architecture,
    paper: &[("epochs", 200.0)],
    takes: "1501 frames of 40 MFCC",
    front_end: Some(FrontEnd::of("m2")),
    // 500 epochs in the code, 200 in the report.
    recipe: Recipe {
        optimizer: OptimizerKind::Sgd,
        momentum: 0.9,
        class_weights: true,
        ..Recipe::adam(2.5e-4, 16, 500)
    },
};

fn architecture(outputs: usize) -> Architecture {
    let mfcc = Shape::Image { height: 1501, width: 40, channels: 1 };
    Architecture {
        inputs: vec![Input::new("mfcc", mfcc)],
        body: Body::Chain(vec![
            Box::new(Conv2d::new("conv1", 1, 16, (120, 40)).stride(4)),
            Box::new(Relu),
            Box::new(Dropout(0.25)),
            Box::new(Conv2d::new("conv2", 16, 8, (40, 1)).stride(2)),
            Box::new(Relu),
            Box::new(Dropout(0.25)),
            Box::new(Flatten),
            Box::new(Linear::new("linear1", 1232, outputs)),
        ]),
        features: None,
        activation: false,
    }
}
