//! M2 (NTNU-ERC): standardised cepstra of the first half minute.

use ndarray::{Array2, ArrayView2, Axis, s};

use super::mono_at;
use crate::decibel::Decibel;
use crate::error::Result;
use crate::librosa::LibrosaVersion;
use crate::mel::{MelParams, SparseBank, mel_filter};
use crate::mfcc::{MfccParams, mfcc};
use crate::stft::{StftParams, spectrogram};

const SR: f64 = 22_050.0;
const SECONDS: f64 = 30.0;
const FRAMES: usize = 1501;
const N_FFT: usize = 2048;
const HOP: usize = 441;

/// 40 cepstral coefficients at 22,050 Hz (mean channel, hop 20 ms), each with zero mean and unit
/// deviation over the frames of the recording. Code and report agree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct M2Mfcc {
    /// Conventions of padding and resampling; the system ran on 0.8.
    pub librosa: LibrosaVersion,
    /// Zero frames up to the network's 1501, or the frames of the recording only.
    pub padded: bool,
}

impl Default for M2Mfcc {
    fn default() -> Self {
        Self { librosa: LibrosaVersion::V08, padded: true }
    }
}

impl M2Mfcc {
    /// `[1501 or frames, 40]` of `y [channels, samples]`. A coefficient that never changes (a
    /// recording of one frame, or silence) gives zeros where the original divides by zero.
    ///
    /// # Errors
    /// No or non-finite samples, impossible rates.
    pub fn run(&self, y: ArrayView2<f32>, sr: f64) -> Result<Array2<f32>> {
        let kept = ((sr * SECONDS).ceil() as usize).min(y.ncols());
        let y = y.slice(s![.., ..kept]);
        let y = mono_at(y, sr, SR, self.librosa.fast_res_type())?.insert_axis(Axis(0));
        let pad_mode = self.librosa.pad_mode();
        let params = StftParams { pad_mode, ..StftParams::new(N_FFT, HOP) };
        let power = spectrogram(y.view(), &params, 2.0)?;
        let bank = SparseBank::new(&mel_filter(&MelParams::new(SR, N_FFT))?);
        let mut mel = bank.apply(power.view());
        Decibel::default().power(mel.as_slice_mut().expect("made in C order"))?;
        let cepstra = mfcc(mel.view(), &MfccParams { n_mfcc: 40, ..MfccParams::default() })?;
        let cepstra = cepstra.index_axis(Axis(0), 0);

        let frames = cepstra.ncols();
        let rows = if self.padded { FRAMES } else { frames };
        let mut out = Array2::zeros((rows, cepstra.nrows()));
        for (c, row) in cepstra.outer_iter().enumerate() {
            let n = frames as f64;
            let mean = row.iter().map(|&v| f64::from(v)).sum::<f64>() / n;
            let variance = row.iter().map(|&v| (f64::from(v) - mean).powi(2)).sum::<f64>() / n;
            let deviation = variance.sqrt();
            if deviation > 0.0 {
                for (t, &v) in row.iter().enumerate().take(rows) {
                    out[[t, c]] = ((f64::from(v) - mean) / deviation) as f32;
                }
            }
        }
        Ok(out)
    }
}
