//! From samples to finished features.
//!
//! A recording is cut into spans of time. Each span is computed by itself ([`Extractor`], fed block
//! by block, with the few samples of context that its first and last frames need), so that spans of
//! one long file can run in parallel; [`Recording`] joins them, finishes values that depend on the
//! maximum of the whole recording, and takes the statistics. No number depends on where blocks or
//! spans begin.

mod extractor;
mod plan;
mod recording;
mod store;
mod stream;

pub use extractor::{Extractor, Refused, Span};
pub use plan::Plan;
pub use recording::{FeatureArray, Features, FinishError, Recording};
pub use store::Store;
