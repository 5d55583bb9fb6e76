//! Signal processing of corsmal-feat: arrays in, arrays out, librosa's definitions and names.
//!
//! Audio is `[channels, samples]`, spectrograms are `[channels, bins, frames]`; every channel is
//! independent unless a function says that it takes a statistic over all of them. Functions are
//! generic over [`Real`] (`f32` or `f64`) and keep the precision of their input.

pub mod af193;
pub mod chroma;
pub mod columns;
pub mod cqt;
pub mod decibel;
pub mod delta;
pub mod error;
pub mod frequency;
pub mod frontends;
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
pub mod paa;
pub mod pca;
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
pub mod tuned;
pub mod vector;
pub mod window;

pub use error::{DspError, Result};
pub use real::Real;
