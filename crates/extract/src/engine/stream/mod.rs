//! Passes over the frames of a signal. A kernel lives in the stream that it reads.

mod cursor;
mod exact;
mod framing;
mod shared;
mod spectrum;
mod wave;

pub use cursor::{Cursor, Window};
pub use exact::ExactMember;
pub use framing::{Framing, Scratch, Stream};
pub use shared::SharedStreams;
pub use spectrum::SpectrumMember;
