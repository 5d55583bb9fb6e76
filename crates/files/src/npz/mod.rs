//! `.npz` archives: a streaming writer that can continue a partial file, and a reader for ours and
//! anyone else's.
//!
//! The writer is our own because resuming an interrupted run means continuing a zip archive after
//! its last sound entry, before any central directory exists; no zip library offers that.

mod disk;
mod encoder;
mod entry;
mod error;
mod headers;
mod intact;
pub mod limits;
mod packed;
pub mod reader;
pub mod writer;

pub use entry::{Compression, EntryRecord};
pub use error::NpzError;
pub use intact::intact_entries;
pub use packed::Packed;
pub use reader::NpzFile;
pub use writer::NpzWriter;

#[cfg(test)]
mod tests;
