//! Dropout.

use rayon::prelude::*;

use crate::batch::{Batch, Shape};
use crate::error::Result;
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::random::Stream;

/// In training, each number is dropped with this probability and the rest is scaled up.
#[derive(Clone, Copy, Debug)]
pub struct Dropout(pub f32);

impl Layer for Dropout {
    fn describe(&self) -> String {
        format!("dropout {}", self.0)
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        Ok(input)
    }

    fn drops(&self) -> bool {
        true
    }

    fn forward(&self, mut input: Batch, pass: &mut Pass<'_>) -> Batch {
        let Some(training) = &mut pass.training else { return input };
        let stream = training.next_dropout();
        let kept = match stream {
            Some(stream) => kept(stream, self.0, input.values.values().len()),
            None => Vec::new(),
        };
        if stream.is_some() {
            apply(input.values.values_mut(), &kept, self.0);
        }
        let shape = input.shape;
        pass.save(|| Saved::Bytes(kept, shape));
        input
    }

    fn backward(&self, mut gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Bytes(kept, _) = pass.saved() else { unreachable!("dropout saves its choice") };
        if !kept.is_empty() {
            apply(gradient.values.values_mut(), &kept, self.0);
        }
        gradient
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        pass.drop(input, self.0)
    }
}

/// Random numbers of the dropout layers in a step, in the order of the layers.
#[derive(Debug)]
pub(crate) struct Draws {
    step: Option<Stream>,
    layers: u64,
}

impl Draws {
    /// Those of a step; none: dropout is off.
    pub(crate) fn new(step: Option<Stream>) -> Self {
        Self { step, layers: 0 }
    }

    /// Those of the next layer, when dropout is on.
    pub(crate) fn next_layer(&mut self) -> Option<Stream> {
        self.layers += 1;
        self.step.map(|step| step.part(self.layers))
    }
}

/// What `n` numbers are multiplied by.
#[cfg(any(test, feature = "gpu"))]
pub(crate) fn factors(stream: Stream, probability: f32, n: usize) -> Vec<f32> {
    let mut factors = vec![1.0; n];
    apply(&mut factors, &kept(stream, probability, n), probability);
    factors
}

/// Which of `n` numbers are kept, a byte each.
pub(crate) fn kept(stream: Stream, probability: f32, n: usize) -> Vec<u8> {
    (0..n)
        .into_par_iter()
        .with_min_len(1 << 14)
        .map(|i| u8::from(stream.uniform(i as u64) >= probability))
        .collect()
}

/// Drops what is not kept and scales the rest.
pub(crate) fn apply(values: &mut [f32], kept: &[u8], probability: f32) {
    let factor = 1.0 / (1.0 - probability);
    values.par_iter_mut().with_min_len(1 << 14).zip(kept).for_each(|(v, &k)| {
        *v = if k == 1 { *v * factor } else { 0.0 };
    });
}
