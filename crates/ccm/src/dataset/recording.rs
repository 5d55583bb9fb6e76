//! One recording of a data set on disk.

use std::path::PathBuf;

use super::container::{Container, Subset};
use super::filling::Filling;
use super::name::SequenceName;

/// One recording on disk.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The file.
    pub path: PathBuf,
    /// Part of the data set.
    pub part: Subset,
    /// Container; `None` for a flat file that no annotation explains.
    pub container: Option<Container>,
    /// Flat number (2021 release).
    pub id: Option<u32>,
    /// Sequence number within the container (2020 order), or the file number of a test recording.
    pub sequence: Option<u16>,
    /// Settings and filling, where known.
    pub name: Option<SequenceName>,
}

impl Recording {
    /// Type and level, where known.
    pub fn filling(&self) -> Option<Filling> {
        self.name.map(|n| n.filling)
    }
}
