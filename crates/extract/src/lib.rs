//! From recordings to feature tensors and tables.
//!
//! [`config`] is the one configuration, [`params`] what its tables share, and [`features`] the
//! registry of what can be computed. [`inputs`] finds recordings, [`engine`] computes, [`ledger`]
//! remembers what is done, and [`run`] ties them together. The outputs are files of `corsmal_files`.
//!
//! A recording to MFCC, block by block as its samples arrive:
//!
//! ```
//! use std::sync::Arc;
//!
//! use corsmal_extract::config::Config;
//! use corsmal_extract::engine::{Features, Signals};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("recording.wav");
//! # let spec = hound::WavSpec {
//! #     channels: 2,
//! #     sample_rate: 22_050,
//! #     bits_per_sample: 16,
//! #     sample_format: hound::SampleFormat::Int,
//! # };
//! # let mut wav = hound::WavWriter::create(&path, spec)?;
//! # (0..44_100).try_for_each(|i| wav.write_sample((i * 37 % 2000) as i16))?;
//! # wav.finalize()?;
//! let config = Config::with_overrides("[features.mfcc]", "example", &["mfcc.n_mfcc=13".into()])?;
//! let mut source = corsmal_audio::open(&path)?;
//! let (rate, channels) = (source.spec().sample_rate, source.spec().channels);
//! let mut signal = Signals::new(Arc::new(config)).start(rate, channels)?;
//! let mut block = vec![0.0; 1000 * usize::from(channels)];
//! loop {
//!     let frames = source.read(&mut block)?;
//!     if frames == 0 {
//!         break;
//!     }
//!     signal.push(&block[..frames * usize::from(channels)])?;
//! }
//! let Features::Frames(arrays) = signal.finish()? else { unreachable!("no [summary]") };
//! let mfcc = &arrays[0];
//! assert_eq!((mfcc.name.as_str(), mfcc.coefficients, mfcc.frames), ("mfcc", 13, 44));
//! # Ok(())
//! # }
//! ```
//!
//! Many recordings into one file, in parallel and resumable:
//!
//! ```no_run
//! use std::sync::Arc;
//! use std::sync::atomic::AtomicBool;
//!
//! use corsmal_extract::config::Config;
//! use corsmal_extract::inputs;
//! use corsmal_extract::run::{self, Quiet, RunOptions};
//! use corsmal_files::npz::Compression;
//! use corsmal_files::shard::Shard;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let recordings = inputs::collect(&["audio/"])?.inputs;
//! let config = Arc::new(Config::preset("logmel")?);
//! let options = RunOptions {
//!     out: "features.npz".into(),
//!     work: None,
//!     partition_by: None,
//!     compression: Compression::Stored,
//!     jobs: 4,
//!     shard: Shard::default(),
//!     resume: true,
//!     overwrite: false,
//!     max_errors: None,
//! };
//! let stop = Arc::new(AtomicBool::new(false));
//! let report = run::run(&recordings, &config, &options, &Quiet, &stop)?;
//! println!("{} of {} have features", recordings.len() - report.failed(), recordings.len());
//! # Ok(())
//! # }
//! ```
//!
//! `examples/own_feature.rs` adds a feature of its own.

pub mod config;
pub mod cut;
pub mod engine;
pub mod features;
pub mod inputs;
pub mod ledger;
pub mod manifest;
pub mod merge;

pub mod params;
pub mod projection;
pub mod run;
pub mod summary;
pub mod survey;
