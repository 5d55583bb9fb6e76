//! Recordings to samples: WAV in all its dialects by a demultiplexer of its own, FLAC, Ogg Vorbis
//! and MP3 through symphonia (feature `symphonia`, on by default), all as streams of blocks.
//!
//! Nothing in a file can make a reader panic or allocate more than a fixed amount; what is
//! accepted, repaired and refused is the table in `docs/wav-policy.md`.
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
