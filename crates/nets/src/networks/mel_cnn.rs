use super::definition::Definition;
use crate::batch::Shape;
use crate::front_end::{FrontEnd, Stretches};
use crate::layer::Chain;
use crate::layers::{BatchNorm, Conv2d, Dropout, FramePool, Linear, MaxPool, Relu};
use crate::network::{Architecture, Body, Input};
use crate::recipe::{Recipe, Schedule};

/// Our own small network on recordings of any kind, for any classes.
pub(super) const MEL_CNN: Definition = Definition {
    name: "mel_cnn",
    about: "Ours: four convolutions on windows of 3 s of log-mel frames, for any recordings",
    outputs: 4,
    classifies: true,
    architecture,
    paper: &[],
    takes: "windows of 128 frames of 64 mel bands of one channel",
    front_end: Some(FRONT_END),
    recipe: Recipe {
        weight_decay: 1e-4,
        schedule: Schedule::Cosine,
        ..Recipe::adam(2e-3, 32, 15)
    },
};

/// Decibels below the maximum of the recording, at least -80, as -1 to 1.
const FRONT_END: FrontEnd = FrontEnd {
    preset: "mel-cnn",
    set: &[],
    windows: Some(Stretches {
        frames: FRAMES,
        step: FRAMES / 4,
        hop: 1024.0 / 44_100.0,
        fill: Some(SILENCE),
        quiet: Some(40.0),
    }),
    item: |tensor| tensor.values.into_iter().map(|v| v / 40.0 + 1.0).collect(),
};
const FRAMES: usize = 128;
const BANDS: usize = 64;
const SILENCE: f32 = -80.0;
const WIDTHS: [usize; 4] = [16, 32, 64, 128];

fn architecture(outputs: usize) -> Architecture {
    let window = Shape::Image { height: FRAMES, width: BANDS, channels: 1 };
    let mut layers: Chain = Vec::new();
    let mut channels = 1;
    for (k, width) in (1..).zip(WIDTHS) {
        let convolution = Conv2d::same3(format!("conv{k}"), channels, width).unbiased();
        layers.push(Box::new(convolution));
        layers.push(Box::new(BatchNorm::new(format!("bn{k}"), width)));
        layers.push(Box::new(Relu));
        layers.push(Box::new(MaxPool::new(2)));
        channels = width;
    }
    layers.push(Box::new(FramePool));
    layers.push(Box::new(Dropout(0.3)));
    layers.push(Box::new(Linear::new("fc", channels, outputs)));
    Architecture {
        inputs: vec![Input::new("window", window)],
        body: Body::Chain(layers),
        features: None,
        activation: false,
    }
}
