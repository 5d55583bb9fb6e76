//! Magnitudes of a transform in double precision, one (frame, channel) after the other, shared by
//! the features that read them.

use corsmal_dsp::stft::StftParams;
use corsmal_dsp::transform::Forward;

use super::framing::{Frames, Framing, Scratch, Stream};
use crate::features::SlotKernel;

/// Magnitudes with these parameters.
pub struct ExactStream {
    params: StftParams,
    /// The transform of a frame that starts with its first sample.
    forward: Forward<f64>,
    members: Vec<ExactMember>,
}

/// A feature of exact magnitudes.
pub struct ExactMember {
    /// Its index.
    pub feature: usize,
    /// Values stored per frame and channel.
    pub rows: usize,
    /// What it computes.
    pub kernel: Box<dyn SlotKernel>,
}

impl ExactStream {
    /// Magnitudes that no feature reads yet.
    ///
    /// # Errors
    /// An impossible window or transform.
    pub fn new(params: &StftParams) -> corsmal_dsp::Result<Self> {
        // Padding is the stream's: the transform sees whole frames.
        let forward = Forward::new(&StftParams { center: false, ..params.clone() })?;
        Ok(Self { params: params.clone(), forward, members: Vec::new() })
    }

    /// Parameters of the transform.
    pub fn params(&self) -> &StftParams {
        &self.params
    }

    /// Adds a feature.
    pub fn add(&mut self, member: ExactMember) {
        self.members.push(member);
    }
}

impl Stream for ExactStream {
    fn framing(&self) -> Framing {
        Framing::of_transform(&self.params)
    }

    fn n_fft(&self) -> Option<usize> {
        Some(self.params.n_fft)
    }

    fn run(&self, frames: Frames<'_>, raw: &mut [Vec<f32>], _: &mut Scratch) {
        let Frames { samples, count, channels } = frames;
        let mut transform = self.forward.scratch();
        let mut signal = vec![0.0_f32; self.params.n_fft];
        let mut magnitude = vec![0.0_f32; self.params.n_bins()];
        let mut workers = Vec::with_capacity(self.members.len());
        for ExactMember { feature, rows, kernel } in &self.members {
            let raw = &mut raw[*feature];
            let start = raw.len();
            raw.resize(start + count * rows * channels, 0.0);
            workers.push((*feature, start, kernel.worker(), vec![0.0_f64; *rows]));
        }
        for t in 0..count {
            let frame = &samples[t * self.params.hop_length * channels..];
            for c in 0..channels {
                let source = frame[c..].iter().step_by(channels);
                signal.iter_mut().zip(source).for_each(|(slot, x)| *slot = *x);
                let spectrum = self.forward.spectrum(&signal, 0, &mut transform);
                for (slot, z) in magnitude.iter_mut().zip(spectrum) {
                    *slot = (z.re as f32).hypot(z.im as f32);
                }
                for (feature, start, worker, values) in &mut workers {
                    worker(&magnitude, values);
                    let at = *start + t * values.len() * channels + c;
                    let out = raw[*feature][at..].iter_mut().step_by(channels);
                    out.zip(&*values).for_each(|(slot, v)| *slot = *v as f32);
                }
            }
        }
    }
}
