//! Features: one file each, with its parameters and one line in the registry.
//!
//! A feature declares what it reads (rows of a spectrum, frames of the waveform, or the whole
//! recording, which is then held in memory) and what it computes from that alone; how stored values
//! are finished once the maximum of the recording is known, where they depend on it (`top_db`); and
//! what it computes of the finished frames in their order of time, where it looks at neighbours
//! ([`Derived`]).
//!
//! A program adds features of its own with [`register`]; `examples/own_feature.rs` does it.

mod a34_short;
mod a34f136;
mod af193;
mod chroma_cqt;
mod chroma_stft;
mod configured;
mod cqt;
mod delta;
mod derived;
mod exact_mel;
mod hpss;
mod kernel;
mod kind;
mod labels;
mod m2_mfcc;
mod m3_spectrogram;
mod m4_logmel;
mod m6_spectrogram;
mod mel_bands;
mod melspectrogram;
mod mfcc;
mod onset_strength;
mod pcen;
mod poly_features;
mod registry;
mod rise;
mod rms;
mod spec9216;
mod spectral_bandwidth;
mod spectral_centroid;
mod spectral_contrast;
mod spectral_flatness;
mod spectral_flux;
mod spectral_rolloff;
mod stft;
mod tonnetz;
mod vggish_patches;
mod zero_crossing_rate;

pub use configured::FeatureConfig;
pub use derived::{Derived, FrameShape, InTime, TooFewFrames};
pub use kernel::{
    Extent, Feature, Finish, Kernel, Quantity, SlotFn, SlotKernel, SpectrumKernel, WaveKernel,
    WholeKernel,
};
pub use kind::FeatureKind;
pub use registry::{Entry, Taken, find, kinds, register, registry};
