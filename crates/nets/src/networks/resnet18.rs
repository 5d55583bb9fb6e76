use super::definition::Definition;
use crate::batch::Shape;
use crate::layer::Chain;
use crate::layers::{AveragePool, BatchNorm, Conv2d, Linear, MaxPool, Relu, Residual};
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// The vision baseline's network for the level: empty, half, full, opaque.
pub(super) const RESNET18_LEVEL: Definition = Definition {
    name: "resnet18_level",
    about: "ResNet-18 (vision baseline), level: empty, half, full, or opaque, from a picture",
    outputs: 4,
    ..RESNET18_TYPE
};

/// The vision baseline's network for the type: none, pasta, rice, water, opaque.
pub(super) const RESNET18_TYPE: Definition = Definition {
    name: "resnet18_type",
    about: "ResNet-18 (vision baseline), type: none, pasta, rice, water, or opaque, from a picture",
    outputs: 5,
    classifies: true,
    architecture,
    paper: &[],
    takes: "cropped pictures of containers",
    front_end: None,
    // The paper names neither size nor training: both are our choice.
    recipe: Recipe::adam(1e-4, 32, 30),
};

/// Containers are seldom larger in the data set's images; the layers take any size.
const SIDE: usize = 112;

/// With torchvision's names.
fn architecture(outputs: usize) -> Architecture {
    let mut layers: Chain = vec![
        Box::new(Conv2d::new("conv1", 3, 64, (7, 7)).stride(2).padding(3).unbiased()),
        Box::new(BatchNorm::new("bn1", 64)),
        Box::new(Relu),
        Box::new(MaxPool::new(3).stride(2).padding(1)),
    ];
    let mut channels = 64;
    for (stage, width) in [64, 128, 256, 512].into_iter().enumerate() {
        for block in 0..2 {
            let stride = if stage > 0 && block == 0 { 2 } else { 1 };
            let name = format!("layer{}.{block}", stage + 1);
            layers.push(Box::new(basic_block(&name, channels, width, stride)));
            layers.push(Box::new(Relu));
            channels = width;
        }
    }
    layers.push(Box::new(AveragePool));
    let features = Some(layers.len());
    layers.push(Box::new(Linear::new("fc", channels, outputs)));
    let picture = Shape::Image { height: SIDE, width: SIDE, channels: 3 };
    Architecture {
        inputs: vec![Input::new("picture", picture)],
        body: Body::Chain(layers),
        features,
        activation: false,
    }
}

/// Two convolutions, beside them the input itself, or one convolution where the shapes differ.
fn basic_block(name: &str, inputs: usize, outputs: usize, stride: usize) -> Residual {
    let conv = |k: usize, inputs| {
        Conv2d::same3(format!("{name}.conv{k}"), inputs, outputs).unbiased()
    };
    let main: Chain = vec![
        Box::new(conv(1, inputs).stride(stride)),
        Box::new(BatchNorm::new(format!("{name}.bn1"), outputs)),
        Box::new(Relu),
        Box::new(conv(2, outputs)),
        Box::new(BatchNorm::new(format!("{name}.bn2"), outputs)),
    ];
    let mut shortcut: Chain = Vec::new();
    if stride != 1 || inputs != outputs {
        let place = format!("{name}.downsample");
        let fit = Conv2d::new(format!("{place}.0"), inputs, outputs, (1, 1)).stride(stride);
        shortcut.push(Box::new(fit.unbiased()));
        shortcut.push(Box::new(BatchNorm::new(format!("{place}.1"), outputs)));
    }
    Residual::new(main, shortcut)
}
