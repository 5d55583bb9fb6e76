//! `pcen`: mel bands normalised by their own level.

use corsmal_dsp::DspError;
use corsmal_dsp::mel::MelNorm;
use corsmal_dsp::onset::max_filter;
use corsmal_dsp::pcen::{Pcen as Normalisation, PcenParams};
use serde::{Deserialize, Serialize};

use super::derived::{Derived, FrameShape, InTime, TooFewFrames};
use super::exact_mel::{ExactMel, Unit};
use super::kernel::Feature;
use super::kind::FeatureKind;
use super::labels::indices;
use crate::params::{AutoOr, Keys, MelSpec, StftSpec};

/// Parameters of `pcen`: librosa's, and those of the mel bands behind it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Pcen {
    gain: f64,
    bias: f64,
    power: f64,
    time_constant: f64,
    eps: f64,
    b: AutoOr,
    max_size: usize,
    factor: f64,
    spectrum_power: f64,
    #[serde(flatten)]
    stft: StftSpec,
    #[serde(flatten)]
    mel: MelSpec,
    mel_norm: MelNorm,
}

impl Default for Pcen {
    fn default() -> Self {
        let PcenParams { gain, bias, power, time_constant, eps, max_size, .. } =
            PcenParams::default();
        Self {
            gain,
            bias,
            power,
            time_constant,
            eps,
            b: AutoOr::Auto,
            max_size,
            factor: 2_147_483_648.0,
            spectrum_power: 1.0,
            stft: StftSpec::default(),
            mel: MelSpec::default(),
            mel_norm: MelNorm::Slaney,
        }
    }
}

impl Derived for Normalisation {
    fn is_recursive(&self) -> bool {
        true
    }

    fn start(&self, shape: FrameShape) -> Box<dyn InTime + '_> {
        let FrameShape { coefficients, channels } = shape;
        Box::new(Smoothing {
            pcen: self,
            channels,
            state: vec![self.initial(); shape.len()],
            bands: vec![0.0; coefficients],
            levels: vec![0.0; coefficients],
        })
    }
}

/// The level of every band, from frame to frame.
struct Smoothing<'p> {
    pcen: &'p Normalisation,
    channels: usize,
    /// `[channels][bands]`
    state: Vec<f64>,
    bands: Vec<f32>,
    levels: Vec<f32>,
}

impl InTime for Smoothing<'_> {
    fn push(&mut self, frames: &[f32], out: &mut Vec<f32>) {
        let (bands, channels) = (self.bands.len(), self.channels);
        for frame in frames.chunks_exact(bands * channels) {
            let at = out.len();
            out.resize(at + frame.len(), 0.0);
            for (c, state) in self.state.chunks_exact_mut(bands).enumerate() {
                let values = frame[c..].iter().step_by(channels);
                self.bands.iter_mut().zip(values).for_each(|(band, x)| *band = *x);
                let levels = if self.pcen.max_size() > 1 {
                    max_filter(&self.bands, self.pcen.max_size(), &mut self.levels);
                    &self.levels
                } else {
                    &self.bands
                };
                let out = out[at + c..].iter_mut().step_by(channels);
                for (((value, level), state), out) in
                    self.bands.iter().zip(levels).zip(state).zip(out)
                {
                    let next = self.pcen.next(f64::from(*value), f64::from(*level), state);
                    *out = next as f32;
                }
            }
        }
    }

    fn finish(&mut self, _: &mut Vec<f32>) -> Result<(), TooFewFrames> {
        Ok(())
    }
}

impl FeatureKind for Pcen {
    const KIND: &'static str = "pcen";
    const ABOUT: &'static str = "Per-channel energy normalisation (librosa.pcen) of n_mels mel bands: \
        each band divided by its own smoothed level and compressed, which evens out distance and \
        steady noise. The bands are multiplied by factor first, as librosa advises for samples \
        within -1 and 1.";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        MelSpec::KEYS,
        &[
            ("gain", "Exponent of the gain control; 0: none, near 1: full."),
            ("bias", "Value added before the compression."),
            ("power", "Exponent of the compression; 0: a logarithm."),
            ("time_constant", "Time constant of the smoothed level in seconds."),
            ("eps", "Smallest level."),
            ("b", "Coefficient of the smoothing, 0 to 1; \"auto\": that of time_constant."),
            ("max_size", "Bands of a maximum filter before the smoothing; 1: no filter."),
            (
                "factor",
                "Factor by which the bands are multiplied first: 2^31 by default; 1: no change.",
            ),
            (
                "spectrum_power",
                "Exponent of the magnitudes before the bands: 1 is magnitude, 2 power.",
            ),
            (
                "mel_norm",
                "Weight of the bands: slaney (equal area), none, or a number p for the p-norm.",
            ),
        ],
    ];
    const PYTHON: &'static str = "pcen";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        if !(self.factor.is_finite() && self.factor > 0.0) {
            return Err(DspError::parameter("factor", self.factor, "above 0"));
        }
        let params = PcenParams {
            gain: self.gain,
            bias: self.bias,
            power: self.power,
            time_constant: self.time_constant,
            eps: self.eps,
            b: match self.b {
                AutoOr::Value(b) => Some(b),
                AutoOr::Auto => None,
            },
            max_size: self.max_size,
        };
        let normalisation = Normalisation::new(&params, sr, stft.hop_length)?;
        let bank = self.mel.params(sr, stft.n_fft, self.mel_norm);
        let mel = ExactMel::new(&bank, self.spectrum_power, Unit::Factor(self.factor))?;
        Ok(Feature {
            derived: Some(Box::new(normalisation)),
            ..Feature::exact(stft, mel, indices(self.mel.n_mels))
        })
    }
}
