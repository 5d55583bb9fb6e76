//! Recordings to samples, as streams of blocks: WAV, Wave64, AIFF, AU and CAF by demultiplexers of its
//! own; FLAC, Ogg and MPEG audio with the decoders of symphonia, lewton and opus-decoder (feature
//! `symphonia`, on by default).
//!
//! Nothing in a file can make a reader panic or allocate more than a fixed amount; what is
//! accepted, repaired and refused is the table in `docs/reading.md`.
//!
//! ```no_run
//! let mut source = corsmal_audio::open("recording.wav".as_ref())?;
//! let channels = usize::from(source.spec().channels);
//! let mut block = vec![0.0; 4096 * channels];
//! loop {
//!     let frames = source.read(&mut block)?;
//!     if frames == 0 {
//!         break;
//!     }
//!     let interleaved = &block[..frames * channels];
//!     // use the samples
//! #   let _ = interleaved;
//! }
//! for repair in &source.health().repairs {
//!     eprintln!("{repair}");
//! }
//! # Ok::<(), corsmal_audio::AudioError>(())
//! ```

#[cfg(feature = "symphonia")]
mod codec;
mod error;
#[cfg(feature = "symphonia")]
mod flac;
mod health;
mod input;
#[cfg(feature = "symphonia")]
mod mpeg;
mod notes;
#[cfg(feature = "symphonia")]
mod ogg;
mod open;
mod pcm;
mod report;
mod source;
mod start;
mod stream;
mod tags;

pub use error::{AudioError, Verdict};
pub use health::{ChannelHealth, Health, HealthMeter};
pub use open::{EXTENSIONS, OTHER_EXTENSIONS, from_reader, from_seekable, open};
pub use report::{ReadReport, Repair};
pub use source::{AudioSpec, BlockSource, SampleEncoding};
