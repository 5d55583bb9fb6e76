//! From recordings to finished features.
//!
//! A recording is cut into spans of time. Each span is read and computed by itself ([`Extractor`],
//! fed block by block, with the few samples of context that its first and last frames need), so that
//! spans of one long file can run in parallel; [`Recording`] joins them, finishes values that depend
//! on the maximum of the whole recording, and takes the statistics. No number depends on where blocks
//! or spans begin. [`Signals`] computes what is pushed from memory, [`Windows`] stretches of a
//! recording or of an endless stream.

mod decoders;
mod extractor;
mod failed;
mod held;
mod live;
mod pass;
mod plan;
mod plans;
pub(crate) mod reading;
mod recording;
mod samples;
mod signal;
mod signal_chain;
mod store;
mod stream;
pub(crate) mod stretch;
pub(crate) mod together;
mod watch;
mod windows;
mod workspace;

pub use decoders::{Decoders, Reader};
pub use extractor::{Extractor, Refused, Span};
pub use failed::{Failed, FinishError};
pub use plan::{Plan, PlannedFeature};
pub use plans::{Planned, Plans};
pub use recording::{FeatureArray, Features, Recording};
pub use samples::LARGEST_SAMPLE;
pub use signal::{Signal, SignalError, Signals};
pub use signal_chain::{SignalChain, channels_out};
pub use store::Store;
pub use watch::Watch;
pub use windows::{Window, Windowing, Windows};
