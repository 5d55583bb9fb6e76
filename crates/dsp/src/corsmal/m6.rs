//! M6 (ACC): a 96 x 96 spectrogram from the second onset on.

use ndarray::{Array2, ArrayView1, ArrayView2, Axis};

use super::image::decibel_image;
use super::mono_at;
use crate::decibel::Decibel;
use crate::error::Result;
use crate::librosa::LibrosaVersion;
use crate::mel::{MelParams, SparseBank, mel_filter};
use crate::onset::{OnsetParams, PeakPick, onset_detect, onset_strength};
use crate::simd::vectorized;
use crate::stft::{StftParams, spectrogram};
use crate::sums::extremes;

const SR: f64 = 22_050.0;
const SAMPLES: usize = 220_500;
const N_FFT: usize = 2048;
const HOP: usize = 512;

/// Where the ten seconds begin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum M6Crop {
    /// At the second detected onset, at the start where there are fewer (the released code).
    #[default]
    Onset,
    /// At an annotated time in seconds (what the paper says of training).
    At(f64),
}

/// Decibel spectrogram of ten seconds of the mean channel at 22,050 Hz, peak-normalised, as an
/// image of 96 x 96.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct M6Spectrogram {
    /// Conventions of padding and resampling; the system ran on 0.8.
    pub librosa: LibrosaVersion,
    /// Where to begin.
    pub crop: M6Crop,
}

impl Default for M6Spectrogram {
    fn default() -> Self {
        Self { librosa: LibrosaVersion::V08, crop: M6Crop::Onset }
    }
}

impl M6Spectrogram {
    /// `[96, 96]` (frequency, time) of `y [channels, samples]`.
    ///
    /// # Errors
    /// No or non-finite samples, impossible rates.
    pub fn run(&self, y: ArrayView2<f32>, sr: f64) -> Result<Array2<f32>> {
        let mut y = mono_at(y, sr, SR, self.librosa.fast_res_type())?.to_vec();
        let (_, peak) = vectorized(
            #[inline(always)]
            || extremes(&y, |v: f32| v.abs().into()),
        );
        if peak >= f64::from(f32::MIN_POSITIVE) {
            y.iter_mut().for_each(|v| *v /= peak as f32);
        }
        let start = match self.crop {
            M6Crop::Onset => self.onsets(ArrayView1::from(&y))?.get(1).copied().unwrap_or(0),
            M6Crop::At(seconds) => (seconds.max(0.0) * SR) as usize,
        };
        y.drain(..start.min(y.len()));
        y.truncate(SAMPLES);
        decibel_image::<f32, f32>(y, SAMPLES, &self.transform())
    }

    fn transform(&self) -> StftParams {
        StftParams { pad_mode: self.librosa.pad_mode(), ..StftParams::new(N_FFT, HOP) }
    }

    /// Sample numbers of the onsets of `y` at 22,050 Hz (librosa `onset_detect`, defaults).
    ///
    /// # Errors
    /// No or non-finite samples.
    pub fn onsets(&self, y: ArrayView1<f32>) -> Result<Vec<usize>> {
        let y = y.insert_axis(Axis(0));
        let power = spectrogram(y, &self.transform(), 2.0)?;
        let mut mel = SparseBank::new(&mel_filter(&MelParams::new(SR, N_FFT))?).apply(power.view());
        Decibel::default().power(mel.as_slice_mut().expect("made in C order"))?;
        let envelope = onset_strength(mel.view(), None, &OnsetParams::new(N_FFT, HOP)?)?;
        let frames = onset_detect(&envelope.row(0).to_vec(), true, &PeakPick::new(SR, HOP)?)?;
        Ok(frames.into_iter().map(|t| t * HOP).collect())
    }
}
