//! A recording in a tar archive, read where it lies.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_audio::{AudioError, BlockSource};
use corsmal_files::identity;
use serde::{Deserialize, Serialize};

use super::stored::{self, Blocks, Object, Pin, Purpose};

/// A recording in an archive.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Member {
    /// The archive.
    pub archive: Place,
    /// Archive and name as one path.
    pub path: PathBuf,
    /// Its first byte in the archive.
    pub offset: u64,
    /// Its bytes.
    pub size: u64,
    /// Why it cannot be read where it lies.
    pub fault: Option<Fault>,
}

/// Where an archive lies.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Place {
    /// A file.
    File(PathBuf),
    /// An object of a store.
    Object(Arc<Object>),
}

impl Place {
    pub(super) fn path(&self) -> PathBuf {
        match self {
            Self::File(path) => path.clone(),
            Self::Object(object) => object.to_string().into(),
        }
    }

    pub(super) fn open(
        &self,
        purpose: Purpose,
        with: (&Pin, &Arc<AtomicBool>),
    ) -> io::Result<Box<dyn Blocks>> {
        match self {
            Self::File(path) => Ok(Box::new(File::open(path)?)),
            Self::Object(object) => stored::open(object, None, purpose, with),
        }
    }
}

/// Why a member cannot be read where it lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// A link to a member or a file.
    Link,
    /// A file whose holes are left out.
    Sparse,
    /// The archive ends so many bytes before it.
    Cut(u64),
}

impl Member {
    /// Opens the recording.
    ///
    /// # Errors
    /// As [`corsmal_audio::open`], and what cannot be read where it lies.
    pub(super) fn open(
        &self,
        purpose: Purpose,
        with: (&Pin, &Arc<AtomicBool>),
    ) -> Result<Box<dyn BlockSource>, AudioError> {
        let offset = self.offset;
        let unsupported = |actual: &str| AudioError::Unsupported {
            offset,
            actual: actual.into(),
            expected: "regular files in a tar, without holes",
        };
        match self.fault {
            None => {}
            Some(Fault::Link) => return Err(unsupported("a link in a tar")),
            Some(Fault::Sparse) => return Err(unsupported("a sparse file in a tar")),
            Some(Fault::Cut(missing)) => {
                let actual = format!("a tar that ends {missing} bytes too early");
                return Err(AudioError::Corrupt { offset, actual, expected: "a whole member" });
            }
        }
        let failed = |source| AudioError::Open { path: self.archive.path(), source };
        match &self.archive {
            Place::File(path) => corsmal_audio::from_seekable(self.slice(path).map_err(failed)?),
            Place::Object(object) => {
                let stretch = Some((offset, self.size));
                let blocks = stored::open(object, stretch, purpose, with).map_err(failed)?;
                corsmal_audio::from_seekable(blocks)
            }
        }
    }

    /// The identity of its bytes, as [`identity::of_file`] has it for a file; in a store, that of its
    /// place and of the archive, for which waiting ends when `stop` is set.
    ///
    /// # Errors
    /// Whatever opening, seeking or reading reports.
    pub fn identity(&self, stop: &AtomicBool) -> io::Result<String> {
        match &self.archive {
            Place::File(path) => identity::of_reader(&mut self.slice(path)?, self.size),
            Place::Object(object) => Ok(match stored::identity_now(object, stop) {
                unknown if unknown.is_empty() || unknown == identity::STREAM => unknown,
                archive => self.identity_in(&archive),
            }),
        }
    }

    /// Its identity in an archive of some identity.
    pub(crate) fn identity_in(&self, archive: &str) -> String {
        format!("{}@{} of {archive}", self.size, self.offset)
    }

    fn slice(&self, path: &Path) -> io::Result<Slice> {
        let mut file = File::open(path)?;
        file.seek(SeekFrom::Start(self.offset))?;
        Ok(Slice { file, start: self.offset, size: self.size, position: 0 })
    }
}

/// The bytes of a member.
struct Slice {
    file: File,
    start: u64,
    size: u64,
    position: u64,
}

impl Read for Slice {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = self.size.saturating_sub(self.position);
        let most = usize::try_from(left).unwrap_or(usize::MAX).min(out.len());
        let read = self.file.read(&mut out[..most])?;
        self.position += read as u64;
        Ok(read)
    }
}

impl Seek for Slice {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let position = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.size.checked_add_signed(by),
            SeekFrom::Current(by) => self.position.checked_add_signed(by),
        };
        let in_file = position.and_then(|at| self.start.checked_add(at));
        let (Some(position), Some(in_file)) = (position, in_file) else {
            return Err(io::ErrorKind::InvalidInput.into());
        };
        self.file.seek(SeekFrom::Start(in_file))?;
        self.position = position;
        Ok(position)
    }
}
