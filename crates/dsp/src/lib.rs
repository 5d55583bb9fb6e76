//! Signal processing of corsmal-feat: arrays in, arrays out, librosa's definitions and names.
//!
//! Audio is `[channels, samples]`, spectrograms are `[channels, bins, frames]`; every channel is
//! independent unless a function says that it takes a statistic over all of them. Functions are
//! generic over [`Real`] (`f32` or `f64`) and keep the precision of their input.
//!
//! From a signal to cepstral coefficients, as `librosa.feature.mfcc` computes them:
//!
//! ```
//! use corsmal_dsp::decibel::Decibel;
//! use corsmal_dsp::mel::{MelParams, SparseBank, mel_filter};
//! use corsmal_dsp::melspectrogram::melspectrogram;
//! use corsmal_dsp::mfcc::{MfccParams, mfcc};
//! use corsmal_dsp::stft::StftParams;
//! use ndarray::Array2;
//!
//! // One second of 440 Hz on two channels.
//! let y = Array2::from_shape_fn((2, 22050), |(_, i)| (i as f32 * 0.12538).sin());
//! let bank = SparseBank::new(&mel_filter(&MelParams::new(22050.0, 2048))?);
//! let mut mel = melspectrogram(y.view(), &StftParams::new(2048, 512), 2.0, &bank)?;
//! Decibel::default().power(mel.as_slice_mut().expect("in C order"))?;
//! let mfcc = mfcc(mel.view(), &MfccParams::default())?;
//! assert_eq!(mfcc.dim(), (2, 20, 44)); // channels, coefficients, frames
//! # Ok::<(), corsmal_dsp::DspError>(())
//! ```
//!
//! | wanted | module |
//! |---|---|
//! | transforms of whole signals | [`stft`], [`istft`], [`cqt`] |
//! | the same frame by frame, many frames in vector lanes | [`transform`], [`lanes`] |
//! | mel spectra and cepstra | [`mel`], [`melspectrogram`], [`decibel`], [`mfcc`], [`delta`] |
//! | shape, pitch, tone | [`spectral`], [`pitch`], [`chroma`], [`tonnetz`], [`onset`], [`hpss`] |
//! | features of the waveform | [`time_domain`] |
//! | other rates, block by block or whole | [`resample`] |
//! | the compound systems of the CORSMAL benchmark | [`corsmal`] |

pub mod chroma;
mod columns;
pub mod corsmal;
pub mod cqt;
pub mod decibel;
pub mod delta;
pub mod error;
pub mod frequency;
pub mod hpss;
pub mod istft;
pub mod lanes;
pub mod librosa;
mod log2;
pub mod median;
pub mod mel;
pub mod melspectrogram;
pub mod mfcc;
pub mod mono;
pub mod normalize;
pub mod onset;
pub mod pca;
pub mod pcen;
pub mod pitch;
mod pool;
pub mod real;
pub mod resample;
pub mod resize;
pub mod simd;
pub mod spectral;
pub mod stft;
mod sums;
mod tiles;
pub mod time_domain;
pub mod tonnetz;
pub mod transform;
mod tuned;
mod vector;
pub mod window;

pub use error::{DspError, Result, room_for};
pub use real::Real;
pub use tuned::ByTuning;
pub use vector::Lane;
