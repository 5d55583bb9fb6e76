//! Recordings in tar archives, read where they lie: nothing is unpacked.
//!
//! A recording's labels are in the members beside it (see [`beside`]).

use std::cell::Cell;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Component, Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_files::quote::quoted;
use serde_json::Value;
use tar::{Archive, EntryType};

use super::beside::{self, Entry};
use super::error::InputError;
use super::folder::{ARCHIVE, has_extension};
use super::member::{Fault, Member, Place};
use super::stored::{self, Blocks, Pin, Purpose};
use crate::manifest;

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
    has_extension(path, &[ARCHIVE])
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
    // Archives that were put one after the other.
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
