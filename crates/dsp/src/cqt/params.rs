//! What a constant-Q transform is asked for.

use crate::error::{DspError, Result};
use crate::frequency::require_rate;
use crate::librosa::LibrosaVersion;
use crate::normalize::Norm;
use crate::resample::ResType;
use crate::stft::PadMode;
use crate::window::Window;

/// Lowest frequency by default: C1 in Hz.
pub const C1: f64 = 32.703_195_662_574_83;

/// Parameters of the transform, in librosa's names.
#[derive(Debug, Clone, PartialEq)]
pub struct CqtParams {
    /// Sample rate in Hz.
    pub sr: f64,
    /// Samples between successive frames.
    pub hop_length: usize,
    /// Lowest centre frequency in Hz.
    pub fmin: f64,
    /// Number of bins.
    pub n_bins: usize,
    /// Bins per octave.
    pub bins_per_octave: usize,
    /// Deviation from A440 in fractions of a bin.
    pub tuning: f64,
    /// Factor on the length of all filters.
    pub filter_scale: f64,
    /// Normalisation of the filters.
    pub norm: Option<Norm>,
    /// Share of the magnitudes of each filter's spectrum that is left out, in [0, 1).
    pub sparsity: f64,
    /// Window of the filters.
    pub window: Window,
    /// Divide by the square root of the filter lengths.
    pub scale: bool,
    /// Padding of the signal's ends, in each octave.
    pub pad_mode: PadMode,
    /// Converter between octaves.
    pub res_type: ResType,
}

/// More bins are refused.
const MOST_BINS: usize = 1 << 16;

impl CqtParams {
    /// librosa's defaults: 84 semitones from C1.
    pub fn new(sr: f64) -> Self {
        Self {
            sr,
            hop_length: 512,
            fmin: C1,
            n_bins: 84,
            bins_per_octave: 12,
            tuning: 0.0,
            filter_scale: 1.0,
            norm: Some(Norm::P(1.0)),
            sparsity: 0.01,
            window: Window::Hann,
            scale: true,
            pad_mode: PadMode::Constant,
            res_type: ResType::SoxrHq,
        }
    }

    /// The same bins by the conventions of another librosa. Up to 0.9 the bandwidth of a filter was
    /// the distance to the next bin above, not half of that between its neighbours, and octaves were
    /// converted by `kaiser_fast`.
    #[must_use]
    pub fn of(self, librosa: LibrosaVersion) -> Self {
        let step = 2.0_f64.powf(1.0 / self.bins_per_octave as f64);
        let narrower = match librosa {
            LibrosaVersion::V08 => (step * step - 1.0) / (step * step + 1.0) / (step - 1.0),
            LibrosaVersion::V011 => 1.0,
        };
        Self {
            filter_scale: self.filter_scale * narrower,
            pad_mode: librosa.pad_mode(),
            res_type: librosa.fast_res_type(),
            ..self
        }
    }

    pub(super) fn check(&self) -> Result<()> {
        require_rate(self.sr)?;
        if self.hop_length == 0 {
            return Err(DspError::parameter("hop_length", 0, "at least 1"));
        }
        for (name, value) in [("n_bins", self.n_bins), ("bins_per_octave", self.bins_per_octave)] {
            if !(1..=MOST_BINS).contains(&value) {
                return Err(DspError::parameter(name, value, format!("1 to {MOST_BINS}")));
            }
        }
        for (name, value) in [("fmin", self.fmin), ("filter_scale", self.filter_scale)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(DspError::parameter(name, value, "above 0"));
            }
        }
        if !self.tuning.is_finite() {
            return Err(DspError::parameter("tuning", self.tuning, "finite"));
        }
        if !(0.0..1.0).contains(&self.sparsity) {
            return Err(DspError::parameter("sparsity", self.sparsity, "0 to below 1"));
        }
        Ok(())
    }
}
