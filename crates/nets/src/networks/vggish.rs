use super::definition::Definition;
use crate::batch::Shape;
use crate::layer::Chain;
use crate::layers::{Conv2d, FlattenPixels, Linear, MaxPool, Relu};
use crate::front_end::{FrontEnd, Stretches};
use crate::network::{Architecture, Body, Input};
use crate::recipe::Recipe;

/// Google's embedding of .96 s of sound, whose outputs M5's networks take.
pub(super) const VGGISH: Definition = Definition {
    name: "vggish",
    about: "VGGish (M5's input): six convolutions on a log-mel patch, 128 numbers",
    outputs: 128,
    classifies: false,
    architecture,
    paper: &[],
    takes: "log-mel patches of 96 x 64",
    front_end: Some(FrontEnd {
        windows: Some(Stretches::whole(96, 96)),
        ..FrontEnd::of("m5-vggish")
    }),
    // Never trained in the benchmark; for those who go on with its weights.
    recipe: Recipe::adam(1e-5, 32, 10),
};

/// With the names of the usual PyTorch port. Pixels are flattened channels last, as in the
/// original, and there is no principal component analysis and no quantisation after it.
fn architecture(outputs: usize) -> Architecture {
    let mut layers: Chain = Vec::new();
    let mut channels = 1;
    for (place, width, pool) in [
        (0, 64, true),
        (3, 128, true),
        (6, 256, false),
        (8, 256, true),
        (11, 512, false),
        (13, 512, true),
    ] {
        layers.push(Box::new(Conv2d::same3(format!("features.{place}"), channels, width)));
        layers.push(Box::new(Relu));
        if pool {
            layers.push(Box::new(MaxPool::new(2)));
        }
        channels = width;
    }
    layers.push(Box::new(FlattenPixels));
    for (place, inputs, width) in [(0, 12288, 4096), (2, 4096, 4096), (4, 4096, outputs)] {
        layers.push(Box::new(Linear::new(format!("embeddings.{place}"), inputs, width)));
        layers.push(Box::new(Relu));
    }
    let patch = Shape::Image { height: 96, width: 64, channels: 1 };
    Architecture {
        inputs: vec![Input::new("patch", patch)],
        body: Body::Chain(layers),
        features: None,
        activation: false,
    }
}
