//! `chroma_stft`: energy in pitch classes.

use corsmal_dsp::ByTuning;
use corsmal_dsp::chroma::{Chroma, ChromaParams, chroma_filter};
use corsmal_dsp::normalize::Norm;
use corsmal_dsp::pitch::{PitchParams, estimate_tuning};
use corsmal_dsp::stft::{StftParams, spectrogram};
use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::indices;
use super::melspectrogram::quantity_of;
use crate::params::{AutoOr, Keys, StftSpec, at_most};

/// Most pitch classes.
pub const MAX_CHROMA: usize = 1024;

/// Refuses a tuning that is none.
pub fn check_tuning(tuning: AutoOr) -> corsmal_dsp::Result<()> {
    match tuning {
        AutoOr::Value(t) if !(-1.0..=1.0).contains(&t) => {
            Err(corsmal_dsp::DspError::parameter("tuning", t, "-1 to 1, or \"auto\""))
        }
        _ => Ok(()),
    }
}

/// Cells of the tuning histogram, in bins.
const RESOLUTION: f64 = 0.01;

/// Parameters of `chroma_stft`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct ChromaStft {
    #[serde(flatten)]
    stft: StftSpec,
    n_chroma: usize,
    power: f64,
    /// In fractions of a class; `auto` estimates it from the channel, as librosa does.
    tuning: AutoOr,
}

impl Default for ChromaStft {
    fn default() -> Self {
        Self { stft: StftSpec::default(), n_chroma: 12, power: 2.0, tuning: AutoOr::Auto }
    }
}

struct Classes {
    stft: StftParams,
    params: ChromaParams,
    power: f64,
    tuning: AutoOr,
    banks: ByTuning<Chroma<f32>>,
}

impl WholeKernel for Classes {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let y = ArrayView2::from_shape((1, y.len()), y).expect("one row");
        let spectrum = spectrogram(y, &self.stft, self.power)?;
        let ChromaParams { sr, n_fft, n_chroma, .. } = self.params;
        let tuning = match self.tuning {
            AutoOr::Value(tuning) => tuning,
            AutoOr::Auto => {
                // librosa's guess from the number of bins, one less than an odd length.
                let pitch = PitchParams::new(sr, n_fft / 2 * 2);
                let found = estimate_tuning(spectrum.view(), None, pitch, RESOLUTION, n_chroma)?;
                found.unwrap_or(0.0)
            }
        };
        let bank = self.banks.get(tuning, || {
            let bank = chroma_filter(&ChromaParams { tuning, ..self.params })?;
            Ok(Chroma::new(bank.view(), Some(Norm::Max)))
        })?;
        let chroma = bank.chromagram(spectrum.view())?;
        Ok(chroma.index_axis_move(Axis(0), 0))
    }
}

impl FeatureKind for ChromaStft {
    const KIND: &'static str = "chroma_stft";
    const ABOUT: &'static str = "Power (power = 2) or magnitude (power = 1) in n_chroma pitch \
                                 classes from C on, each frame divided by its maximum \
                                 (librosa.feature.chroma_stft), with the tuning of the channel or \
                                 a given one. Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        &[
            ("n_chroma", "Number of pitch classes."),
            ("power", "Exponent of the magnitudes: 2 is power, 1 magnitude."),
            (
                "tuning",
                "Deviation from A = 440 Hz in fractions of a class; \"auto\": estimated from each channel.",
            ),
        ],
    ];
    const PYTHON: &'static str = "feature.chroma_stft";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        quantity_of(self.power)?;
        at_most("n_chroma", self.n_chroma, MAX_CHROMA)?;
        let params = ChromaParams { n_chroma: self.n_chroma, ..ChromaParams::new(sr, stft.n_fft) };
        check_tuning(self.tuning)?;
        chroma_filter::<f32>(&params)?;
        let labels = indices(self.n_chroma);
        let extent = Extent::Frames(stft.hop_length as f64);
        let (power, tuning) = (self.power, self.tuning);
        let classes = Classes { stft, params, power, tuning, banks: ByTuning::default() };
        Ok(Feature::whole(extent, classes, labels))
    }
}
