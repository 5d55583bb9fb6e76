//! Arrays deflated away from the archive, so that the threads that compute them also compress them.

use std::io::Write;

use super::encoder::{Encoder, Totals};
use super::entry::Compression;
use crate::npy::Header;

/// A deflated array, ready for [`super::NpzWriter::packed`]. Its entry has the same bytes as if the
/// writer had deflated it.
#[derive(Debug)]
pub struct Packed {
    pub(super) header: Header,
    pub(super) totals: Totals,
    pub(super) bytes: Vec<u8>,
}

impl Packed {
    /// Deflates an array. That `data` is as long as the header says is checked by the writer.
    pub fn deflate(header: &Header, data: &[u8]) -> Self {
        let mut bytes = Vec::new();
        let mut sink = Encoder::new(&mut bytes, Compression::Deflated);
        let totals = sink
            .write_all(&header.encode())
            .and_then(|()| sink.write_all(data))
            .and_then(|()| sink.finish())
            .expect("memory takes every byte");
        Self { header: header.clone(), totals, bytes }
    }
}
