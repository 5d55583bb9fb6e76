//! Short-time Fourier transform of whole arrays (librosa 0.11 `stft`, `istft` conventions).

mod params;
mod spectrogram;

pub use params::{MAX_N_FFT, PadMode, StftParams};
pub(crate) use spectrogram::{LONGEST_ROWS, magnitude, spectrogram_as};
pub use spectrogram::{spectrogram, spectrogram_into, stft, stft_into};
