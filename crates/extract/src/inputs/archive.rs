//! Recordings in tar archives, read where they lie: nothing is unpacked.
//!
//! A recording's labels are in the members beside it (see [`beside`]).

use std::cell::Cell;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_audio::{AudioError, BlockSource};
use corsmal_files::identity;
use corsmal_files::quote::quoted;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use tar::{Archive, EntryType};

use super::beside;
use super::error::InputError;
use super::folder::has_extension;
use super::stored::{self, Blocks, Object, Pin, Purpose};
use crate::manifest;

/// File name extension, lower case.
pub(super) const EXTENSION: &str = "tar";
/// Ends of names of compressed archives, in which nothing can be read where it lies.
const COMPRESSED: [&str; 6] = [".tar.gz", ".tgz", ".tar.bz2", ".tar.xz", ".tar.zst", ".tar.lz4"];
/// Bytes of a block of an archive.
const BLOCK: u64 = 512;
/// Most bytes read to find the next member: its headers, long names among them.
const MOST_HEADERS: u64 = 16 << 20;
/// Most bytes of a member with labels.
const MOST_LABELS: u64 = 1 << 20;
/// The label that a `.cls` holds.
const CLASS: &str = "cls";

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
    fn path(&self) -> PathBuf {
        match self {
            Self::File(path) => path.clone(),
            Self::Object(object) => object.to_string().into(),
        }
    }

    fn open(
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

/// A recording with what stands beside it.
pub(super) struct Entry {
    pub(super) member: Member,
    /// Name in the archive.
    pub(super) name: PathBuf,
    pub(super) labels: Vec<(String, String)>,
}

/// What an archive holds.
#[derive(Default)]
pub(super) struct Contents {
    /// Recordings and their labels, in the order of the archive.
    pub(super) recordings: Vec<Entry>,
    /// Sound files of formats that are not read.
    pub(super) skipped: Vec<PathBuf>,
    /// Whether the blocks are there that end an archive.
    pub(super) is_ended: bool,
}

/// Whether a file is an archive, by its name.
pub(super) fn is_archive(path: &Path) -> bool {
    has_extension(path, &[EXTENSION])
}

/// Why a file cannot be taken that is an archive by its name.
pub(super) fn refusal(path: &Path) -> Option<InputError> {
    let name = path.file_name()?.to_string_lossy().to_ascii_lowercase();
    COMPRESSED.iter().any(|end| name.ends_with(end)).then(|| compressed(path))
}

fn compressed(path: &Path) -> InputError {
    let reason = "is compressed as a whole, so no member can be read in place; decompress it to \
                  .tar (sound files hardly get smaller)";
    InputError::Archive { path: path.into(), reason: reason.into() }
}

/// Whether the first bytes are those of a compressed file, whatever its name.
fn is_compressed(file: &mut Box<dyn Blocks>) -> io::Result<bool> {
    /// gzip, bzip2, xz, zstd, lz4.
    const BEGINNINGS: [&[u8]; 5] =
        [b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"];
    let mut start = Vec::new();
    file.take(5).read_to_end(&mut start)?;
    file.rewind()?;
    Ok(BEGINNINGS.iter().any(|begin| start.starts_with(begin)))
}

/// Finds the recordings of an archive and their labels.
///
/// # Errors
/// What is no archive, or damaged so that members may be missed; labels that cannot be read.
// Without the feature there is no object.
#[cfg_attr(not(feature = "cloud"), allow(unreachable_code))]
pub(super) fn contents(place: &Place, stop: &Arc<AtomicBool>) -> Result<Contents, InputError> {
    let path = &place.path();
    let failed = |e: io::Error| {
        // The operating system's errors have a number, those of the format do not.
        match e.raw_os_error() {
            Some(_) => InputError::io(path, e),
            None => InputError::Archive { path: path.into(), reason: e.to_string() },
        }
    };
    let pin = Pin::default();
    let mut blocks = place.open(Purpose::Content, (&pin, stop)).map_err(failed)?;
    if is_compressed(&mut blocks).map_err(failed)? {
        return Err(compressed(path));
    }
    let length = blocks.seek(SeekFrom::End(0)).map_err(failed)?;
    blocks.rewind().map_err(failed)?;
    let place = &match place {
        Place::File(path) => Place::File(path.clone()),
        Place::Object(object) => Place::Object(Arc::new(stored::as_read(object, &pin))),
    };
    let left = Rc::new(Cell::new(MOST_HEADERS));
    let mut archive = Archive::new(Headers { blocks, left: left.clone() });
    // Archives that were put one behind the other.
    archive.set_ignore_zeros(true);
    let mut found = Contents::default();
    let mut labels: Vec<beside::Labels> = Vec::new();
    let mut end = 0;
    for entry in archive.entries_with_seek().map_err(failed)? {
        left.set(MOST_HEADERS);
        let mut entry = entry.map_err(failed)?;
        let (name, member) = member(place, length, &mut entry).map_err(failed)?;
        end = member.offset.saturating_add(member.size.div_ceil(BLOCK).saturating_mul(BLOCK));
        let kind = entry.header().entry_type();
        if is_hidden(&name) || !(kind.is_file() || member.fault.is_some()) {
            continue;
        }
        if has_extension(&name, &corsmal_audio::EXTENSIONS) {
            found.recordings.push(Entry { member, name, labels: Vec::new() });
        } else if has_extension(&name, &corsmal_audio::OTHER_EXTENSIONS) {
            found.skipped.push(member.path);
        } else if has_extension(&name, &["json", CLASS]) {
            let read = labels_of(&member, &mut entry).map_err(|reason| InputError::Archive {
                path: path.into(),
                reason: format!("{}: {reason}", quoted(&name.to_string_lossy())),
            })?;
            labels.push((name, read));
        }
    }
    let refused = |reason| InputError::Archive { path: path.into(), reason };
    beside::join(&mut found.recordings, labels).map_err(refused)?;
    found.is_ended = is_ended(place, (&pin, stop), end).map_err(failed)?;
    Ok(found)
}

fn member(
    archive: &Place,
    length: u64,
    entry: &mut tar::Entry<'_, Headers>,
) -> io::Result<(PathBuf, Member)> {
    let (offset, size) = (entry.raw_file_position(), entry.size());
    let is_sparse = match entry.pax_extensions()? {
        None => false,
        Some(extensions) => extensions
            .filter_map(Result::ok)
            .any(|extension| extension.key_bytes().starts_with(b"GNU.sparse.")),
    };
    let missing = offset.saturating_add(size).saturating_sub(length);
    let fault = match entry.header().entry_type() {
        EntryType::Link | EntryType::Symlink => Some(Fault::Link),
        EntryType::GNUSparse => Some(Fault::Sparse),
        _ if is_sparse => Some(Fault::Sparse),
        _ if missing > 0 => Some(Fault::Cut(missing)),
        _ => None,
    };
    let name = inner(&entry.path()?);
    let path = archive.path().join(&name);
    Ok((name, Member { archive: archive.clone(), path, offset, size, fault }))
}

/// A name without what leads out of the archive.
fn inner(name: &Path) -> PathBuf {
    name.components().filter(|part| matches!(part, Component::Normal(_))).collect()
}

fn is_hidden(name: &Path) -> bool {
    name.iter().any(|part| part.as_encoded_bytes().starts_with(b"."))
}

/// The labels that a member holds.
fn labels_of(member: &Member, content: &mut impl Read) -> Result<Vec<(String, String)>, String> {
    if member.fault.is_some() || member.size > MOST_LABELS {
        return Err(format!("labels must be a file of at most {MOST_LABELS} bytes"));
    }
    let mut text = String::new();
    content.take(MOST_LABELS).read_to_string(&mut text).map_err(|e| e.to_string())?;
    if has_extension(&member.path, &[CLASS]) {
        return Ok(vec![(CLASS.into(), text.trim().into())]);
    }
    // Values that are lists or objects are no labels; an output has ids of its own.
    let fields = manifest::fields(&text)?.into_iter().filter(|(name, _)| name != manifest::ID);
    let label = |(name, value): (String, Value)| match manifest::label(value) {
        Ok(text) => text.map(|text| Ok((name, text))),
        Err(rounded) => Some(Err(format!("{}: {rounded}", quoted(&name)))),
    };
    fields.filter_map(label).collect()
}

/// Whether a block of zeros follows the last member.
fn is_ended(place: &Place, with: (&Pin, &Arc<AtomicBool>), end: u64) -> io::Result<bool> {
    let mut blocks = place.open(Purpose::Header, with)?;
    let mut block = Vec::new();
    blocks.seek(SeekFrom::Start(end.min(i64::MAX as u64)))?;
    blocks.take(BLOCK).read_to_end(&mut block)?;
    Ok(block.len() as u64 == BLOCK && block.iter().all(|byte| *byte == 0))
}

/// Reads headers, up to some number of bytes; contents are passed over by seeking.
struct Headers {
    blocks: Box<dyn Blocks>,
    left: Rc<Cell<u64>>,
}

impl Read for Headers {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.blocks.read(out)?;
        match self.left.get().checked_sub(read as u64) {
            Some(left) => self.left.set(left),
            None => {
                let reason = format!("more than {MOST_HEADERS} bytes before the next member");
                return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
            }
        }
        Ok(read)
    }
}

impl Seek for Headers {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.blocks.seek(to)
    }
}
