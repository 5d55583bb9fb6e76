//! Recordings to samples, as streams of blocks: WAV, Wave64, AIFF, AU and CAF by demultiplexers of its
//! own; FLAC, Ogg, MPEG audio, AAC and ALAC with the decoders of symphonia, lewton and opus-pure (feature
//! `symphonia`, on by default).
//!
//! Nothing in a file can make a reader panic or allocate more than a fixed amount; what is
//! accepted, repaired and refused is the table in `docs/reading.md`.
//!
//! ```
//! # // A WAV file of two channels and three frames.
//! # let mut bytes = b"RIFF\x30\0\0\0WAVEfmt \x10\0\0\0\x01\0\x02\0\x40\x1f\0\0\0\x7d\0\0\x04\0\x10\0data\x0c\0\0\0".to_vec();
//! # [0_i16, 0, 16384, -16384, 0, 0].iter().for_each(|sample| bytes.extend(sample.to_le_bytes()));
//! // `open` takes a path, `from_reader` anything that gives bytes.
//! let mut source = corsmal_audio::from_reader(std::io::Cursor::new(bytes))?;
//! let channels = usize::from(source.spec().channels);
//! let mut block = vec![0.0; 4096 * channels];
//! let mut peak = 0.0_f32;
//! loop {
//!     let frames = source.read(&mut block)?;
//!     if frames == 0 {
//!         break;
//!     }
//!     let interleaved = &block[..frames * channels];
//!     peak = interleaved.iter().fold(peak, |peak, x| peak.max(x.abs()));
//! }
//! assert_eq!((channels, peak), (2, 0.5));
//! // What was repaired on the way; nothing here.
//! assert!(source.health().repairs.is_empty());
//! # Ok::<(), corsmal_audio::AudioError>(())
//! ```

#[cfg(feature = "symphonia")]
mod aac;
#[cfg(feature = "symphonia")]
mod codec;
mod error;
#[cfg(feature = "symphonia")]
mod flac;
mod health;
mod input;
#[cfg(feature = "symphonia")]
mod mp4;
#[cfg(feature = "symphonia")]
mod mpeg;
mod notes;
#[cfg(feature = "symphonia")]
mod ogg;
mod open;
mod pcm;
mod replay;
mod report;
mod source;
mod start;
mod stream;
mod tags;

pub use error::{AudioError, Verdict};
pub use health::{ChannelHealth, Health, HealthMeter};
pub use open::{EXTENSIONS, OTHER_EXTENSIONS, from_reader, from_seekable, open};
pub use replay::Replay;
pub use report::{ReadReport, Repair};
pub use source::{AudioSpec, BlockSource, SampleEncoding};
