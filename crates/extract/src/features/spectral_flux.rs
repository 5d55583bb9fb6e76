//! `spectral_flux`: how much each mel band rises from frame to frame.

use std::collections::VecDeque;

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::onset::max_filter;
use serde::{Deserialize, Serialize};

use super::derived::{Derived, FrameShape, InTime, TooFewFrames};
use super::exact_mel::{ExactMel, Unit};
use super::kernel::Feature;
use super::kind::FeatureKind;
use super::labels::indices;
use super::mel_bands::DecibelFinish;
use super::rise::{Rise, RiseSpec};
use crate::params::{DbSpec, Keys, Scale};

/// Parameters of `spectral_flux`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct SpectralFlux {
    #[serde(flatten)]
    rise: RiseSpec,
}

/// Rises over `lag` frames, as late as the analysis is centred.
struct Rises {
    lag: usize,
    /// Frames before the first rise.
    before: usize,
    max_size: usize,
}

impl Derived for Rises {
    fn start(&self, shape: FrameShape) -> Box<dyn InTime + '_> {
        let FrameShape { coefficients, channels } = shape;
        Box::new(Rising {
            rises: self,
            channels,
            history: VecDeque::new(),
            earlier: vec![0.0; coefficients],
            highest: vec![0.0; coefficients],
        })
    }
}

/// The last frames, as far as a rise reaches back.
struct Rising<'r> {
    rises: &'r Rises,
    channels: usize,
    history: VecDeque<Vec<f32>>,
    earlier: Vec<f32>,
    highest: Vec<f32>,
}

impl InTime for Rising<'_> {
    fn push(&mut self, frames: &[f32], out: &mut Vec<f32>) {
        let channels = self.channels;
        for frame in frames.chunks_exact(self.earlier.len() * channels) {
            // The oldest frame makes room for the new one.
            let full = self.history.len() > self.rises.before;
            let mut newest = if full { self.history.pop_front() } else { None }.unwrap_or_default();
            newest.clear();
            newest.extend_from_slice(frame);
            self.history.push_back(newest);
            let at = out.len();
            out.resize(at + frame.len(), 0.0);
            if self.history.len() <= self.rises.before {
                continue;
            }
            let (now, earlier) = (&self.history[self.rises.lag], &self.history[0]);
            for c in 0..channels {
                let values = earlier[c..].iter().step_by(channels);
                self.earlier.iter_mut().zip(values).for_each(|(band, x)| *band = *x);
                if self.rises.max_size > 1 {
                    max_filter(&self.earlier, self.rises.max_size, &mut self.highest);
                    std::mem::swap(&mut self.earlier, &mut self.highest);
                }
                let now = now[c..].iter().step_by(channels);
                let out = out[at + c..].iter_mut().step_by(channels);
                for ((now, earlier), out) in now.zip(&self.earlier).zip(out) {
                    *out = (now - earlier).max(0.0);
                }
            }
        }
    }

    fn finish(&mut self, _: &mut Vec<f32>) -> Result<(), TooFewFrames> {
        Ok(())
    }
}

impl FeatureKind for SpectralFlux {
    const KIND: &'static str = "spectral_flux";
    const ABOUT: &'static str = "Rise over lag frames of each of n_mels mel bands in dB, 80 dB \
                                 below the maximum of each channel, 0 where a band falls; \
                                 onset_strength averages these values \
        (librosa.onset.onset_strength_multi with aggregate=False).";
    const KEYS: &'static [Keys] = RiseSpec::KEYS;
    const PYTHON: &'static str = "onset.onset_strength_multi";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let Rise { stft, mel, onset } = self.rise.params(sr)?;
        let unit = Unit::Decibel(Decibel { top_db: None, ..Decibel::default() });
        let before = onset.lag.saturating_add(onset.center.unwrap_or(0));
        let rises = Rises { lag: onset.lag, before, max_size: onset.max_size };
        Ok(Feature {
            finish: DecibelFinish::of(Scale::PowerToDb, &DbSpec::default(), mel.n_mels),
            derived: Some(Box::new(rises)),
            ..Feature::exact(stft, ExactMel::new(&mel, 2.0, unit)?, indices(mel.n_mels))
        })
    }
}
