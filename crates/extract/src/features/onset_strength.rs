//! `onset_strength`: how much the spectrum rises from frame to frame.

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::mel::{SparseBank, mel_filter};
use corsmal_dsp::onset::{OnsetParams, onset_strength};
use corsmal_dsp::stft::{StftParams, spectrogram};
use ndarray::{Array2, ArrayView2};
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::mel_bands::{check_bank, empty};
use super::rise::{Rise, RiseSpec};
use crate::params::Keys;

/// Parameters of `onset_strength`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct OnsetStrength {
    #[serde(flatten)]
    rise: RiseSpec,
}

struct Envelope {
    stft: StftParams,
    bank: SparseBank,
    params: OnsetParams,
    empty: Option<String>,
}

impl WholeKernel for Envelope {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let power = spectrogram(
            ArrayView2::from_shape((1, y.len()), y).expect("one row"),
            &self.stft,
            2.0,
        )?;
        let mut mel = self.bank.apply(power.view());
        Decibel::default().power(mel.as_slice_mut().expect("made in C order"))?;
        onset_strength(mel.view(), None, &self.params)
    }

    fn warning(&self) -> Option<String> {
        self.empty.clone()
    }
}

impl FeatureKind for OnsetStrength {
    const KIND: &'static str = "onset_strength";
    const ABOUT: &'static str = "Mean rise over lag frames of the mel bands in dB \
        (librosa.onset.onset_strength), 80 dB below the maximum of each channel. `center` is \
        that of the frames; the shift that librosa.onset calls `center` is always made. Holds the \
        whole recording in memory.";
    const KEYS: &'static [Keys] = RiseSpec::KEYS;
    const PYTHON: &'static str = "onset.onset_strength";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let Rise { stft, mel, onset } = self.rise.params(sr)?;
        check_bank(&mel)?;
        let bank = mel_filter(&mel)?;
        let extent = Extent::Frames(stft.hop_length as f64);
        let empty = empty(&bank);
        let kernel = Envelope { stft, bank: SparseBank::new(&bank), params: onset, empty };
        Ok(Feature::whole(extent, kernel, vec![String::new()]))
    }
}
