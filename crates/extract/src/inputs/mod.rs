//! From what the user names to the list of recordings of a run.
//!
//! A name is, in this order of interpretation: `-` (a WAV stream on standard input), an existing
//! file (a manifest if its extension is one of [`manifest::EXTENSIONS`], else a recording), an
//! existing folder, or a glob. Folders and globs give files with an audio extension only, follow
//! symbolic links, skip names that begin with a dot, and are sorted by the bytes of the path
//! relative to their root; names keep the order in which they are given.
//!
//! **Ids.** A recording's id is its path relative to its root, without extension, with `/` between
//! the parts. The root is the folder named, the part of a glob before its first wildcard, or the
//! folder of a file named; paths in a manifest are taken as written. Where ids collide, all those
//! that do keep their extension; where that does not help, they take the path as given on the
//! command line. Of several stretches of one file, each has its times behind the id, as
//! `x@0.5-1.0`. What still collides is refused. Ids from a manifest stand as they are. Ids that
//! would begin with `__`, the prefix of an output's own arrays, get `./` in front.

mod error;
mod ids;
mod wildcard;

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use walkdir::WalkDir;

use crate::manifest;

pub use error::InputError;

/// Where the bytes of a recording come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum InputSource {
    /// A file.
    File(PathBuf),
    /// Standard input.
    Stdin,
}

impl fmt::Display for InputSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => path.display().fmt(f),
            Self::Stdin => f.write_str("-"),
        }
    }
}

/// One recording, or a stretch of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Unique in the run.
    pub id: String,
    /// Where its bytes come from.
    pub source: InputSource,
    /// Start of the stretch in seconds.
    pub start: Option<f64>,
    /// End of the stretch in seconds.
    pub end: Option<f64>,
    /// Label columns as (name, value); every input of a run has the same names in the same order.
    pub labels: Vec<(String, String)>,
}

/// What names stand for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Collected {
    /// The recordings.
    pub inputs: Vec<Input>,
    /// Files in folders whose names are those of recordings, of formats that are not read, and
    /// metadata of macOS (`._x.wav`) wherever it is named.
    pub skipped: Vec<PathBuf>,
}

impl Collected {
    /// A sentence about the files skipped, if there are any.
    pub fn warning(&self) -> Option<String> {
        const SHOWN: usize = 3;
        let names: Vec<_> =
            self.skipped.iter().take(SHOWN).map(|p| p.display().to_string()).collect();
        let more = if self.skipped.len() > SHOWN { ", ..." } else { "" };
        let files = match self.skipped.len() {
            0 => return None,
            1 => "1 file was skipped, whose format is".to_string(),
            n => format!("{n} files were skipped, whose formats are"),
        };
        Some(format!("{files} not read: {}{more}", names.join(", ")))
    }
}

/// Finds the recordings that `names` stand for, in a stable order, with unique ids.
///
/// # Errors
/// [`InputError`] names the path, and in a manifest the line.
pub fn collect<S: AsRef<OsStr>>(names: &[S]) -> Result<Collected, InputError> {
    let (mut found, mut skipped) = (Vec::new(), Vec::new());
    for name in names {
        find(name.as_ref(), &mut found, &mut skipped)?;
    }
    skipped.sort_unstable();
    skipped.dedup();
    // Where nothing but such files was named, the first of them says so.
    if let (true, Some(path)) = (found.is_empty(), skipped.first()) {
        let extensions = corsmal_audio::EXTENSIONS.join(", ");
        return Err(InputError::NoAudio { path: path.clone(), extensions });
    }
    let ids = ids::assign(&found)?;
    let mut columns: Vec<String> = Vec::new();
    let mut known = HashSet::new();
    for (column, _) in found.iter().flat_map(|f| &f.labels) {
        if !known.contains(column.as_str()) {
            known.insert(column.as_str());
            columns.push(column.clone());
        }
    }
    manifest::require_cells(found.len(), columns.len())
        .map_err(|reason| InputError::Labels { reason })?;
    let inputs = found.into_iter().zip(ids).map(|(found, id)| {
        let mut values: BTreeMap<String, String> = found.labels.into_iter().collect();
        let labels = columns.iter().map(|c| (c.clone(), values.remove(c).unwrap_or_default()));
        Input {
            id,
            source: found.source,
            start: found.start,
            end: found.end,
            labels: labels.collect(),
        }
    });
    Ok(Collected { inputs: inputs.collect(), skipped })
}

/// BLAKE3 (hex) over ids, paths, stretches and labels of all inputs: equal for equal lists only.
pub fn list_hash(inputs: &[Input]) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut put = |text: &str| {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    };
    for input in inputs {
        put(&input.id);
        put(&input.source.to_string());
        for time in [input.start, input.end] {
            put(&time.map(|t| t.to_string()).unwrap_or_default());
        }
        put(&input.labels.len().to_string());
        for (column, value) in &input.labels {
            put(column);
            put(value);
        }
    }
    hasher.finalize().to_hex().to_string()
}

/// An input before it has its final id.
struct Found {
    source: InputSource,
    naming: Naming,
    start: Option<f64>,
    end: Option<f64>,
    labels: Vec<(String, String)>,
}

/// What the id is made of.
enum Naming {
    Given(String),
    /// Path relative to the root.
    Derived(PathBuf),
}

impl Found {
    fn file(path: PathBuf, relative: PathBuf) -> Self {
        Self {
            source: InputSource::File(path),
            naming: Naming::Derived(relative),
            start: None,
            end: None,
            labels: Vec::new(),
        }
    }
}

fn find(
    name: &OsStr,
    found: &mut Vec<Found>,
    skipped: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    if name == "-" {
        let naming = Naming::Given("stdin".into());
        let (start, end, labels) = (None, None, Vec::new());
        found.push(Found { source: InputSource::Stdin, naming, start, end, labels });
        return Ok(());
    }
    let path = Path::new(name);
    match std::fs::metadata(path) {
        Ok(meta) if meta.is_dir() => {
            let mut files = Vec::new();
            walk(path, &mut files, skipped)?;
            push_sorted(path, path, files, found)
        }
        Ok(_) if is_apple_double(path) => {
            skipped.push(path.into());
            Ok(())
        }
        Ok(_) if has_extension(path, &manifest::EXTENSIONS) => find_manifest(path, found, skipped),
        Ok(_) => {
            let relative = path.file_name().map_or_else(|| path.into(), PathBuf::from);
            found.push(Found::file(path.into(), relative));
            Ok(())
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            match name.to_str().filter(|name| wildcard::is_glob(name)) {
                Some(pattern) => find_glob(pattern, found, skipped),
                None => Err(InputError::Missing { path: path.into() }),
            }
        }
        Err(error) => Err(InputError::io(path, error)),
    }
}

fn find_manifest(
    path: &Path,
    found: &mut Vec<Found>,
    skipped: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    for entry in manifest::read(path)? {
        let wrong = |reason| InputError::Manifest { path: path.into(), line: entry.line, reason };
        match std::fs::metadata(&entry.path) {
            Ok(meta) if meta.is_dir() => {
                return Err(wrong(format!("{} is a folder", entry.path.display())));
            }
            Ok(_) if is_apple_double(&entry.path) => {
                skipped.push(entry.path);
                continue;
            }
            Ok(_) => {}
            Err(error) => return Err(wrong(format!("{}: {error}", entry.path.display()))),
        }
        if let Some(reason) = entry.id.as_deref().and_then(ids::refusal) {
            return Err(wrong(reason));
        }
        let naming = match entry.id {
            Some(id) => Naming::Given(id),
            None => Naming::Derived(entry.written.into()),
        };
        let source = InputSource::File(entry.path);
        let (start, end, labels) = (entry.start, entry.end, entry.labels);
        found.push(Found { source, naming, start, end, labels });
    }
    Ok(())
}

fn find_glob(
    pattern: &str,
    found: &mut Vec<Found>,
    skipped: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    let mut files = Vec::new();
    for path in wildcard::expand(pattern)? {
        walk(&path, &mut files, skipped)?;
    }
    push_sorted(Path::new(pattern), &wildcard::root(pattern), files, found)
}

/// Appends the audio files at or below `path`, and to `skipped` those whose formats are not read.
fn walk(
    path: &Path,
    files: &mut Vec<PathBuf>,
    skipped: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    let is_audio = |path: &Path| has_extension(path, &corsmal_audio::EXTENSIONS);
    let visible = |entry: &walkdir::DirEntry| !is_hidden(entry);
    for entry in WalkDir::new(path).follow_links(true).into_iter().filter_entry(visible) {
        match entry {
            Ok(entry) if entry.file_type().is_file() && is_audio(entry.path()) => {
                files.push(entry.into_path());
            }
            Ok(entry) => {
                let is_other = has_extension(entry.path(), &corsmal_audio::OTHER_EXTENSIONS);
                if entry.file_type().is_file() && is_other {
                    skipped.push(entry.into_path());
                }
            }
            Err(error) => {
                let at = error.path().map(Path::to_path_buf);
                let is_loop = error.loop_ancestor().is_some();
                let below = error.depth() > 0;
                match unless_harmless(path, error) {
                    // A dangling link to a recording, which will fail on its own.
                    Ok(()) => files.extend(at.filter(|at| !is_loop && is_audio(at))),
                    // So will a folder that cannot be read: the others do not have to wait for it.
                    Err(_) if below => files.extend(at),
                    Err(error) => return Err(error),
                }
            }
        }
    }
    Ok(())
}

/// Whether an entry below a folder that was named is skipped.
fn is_hidden(entry: &walkdir::DirEntry) -> bool {
    entry.depth() > 0 && entry.file_name().as_encoded_bytes().starts_with(b".")
}

/// Whether a file holds what macOS puts beside another one, `._x.wav` beside `x.wav`: by name and by
/// content, since a recording may have such a name, too.
fn is_apple_double(path: &Path) -> bool {
    let is_named = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"._"));
    let mut mark = [0; 4];
    is_named
        && File::open(path).and_then(|mut file| file.read_exact(&mut mark)).is_ok()
        && mark == *b"\0\x05\x16\x07"
}

/// Passes over links back to a folder that is being searched, and links to nothing.
fn unless_harmless(folder: &Path, error: walkdir::Error) -> Result<(), InputError> {
    let at = error.path().unwrap_or(folder).to_path_buf();
    let is_loop = error.loop_ancestor().is_some();
    match io::Error::from(error) {
        _ if is_loop => Ok(()),
        error if error.kind() == io::ErrorKind::NotFound => Ok(()),
        error => Err(InputError::io(&at, error)),
    }
}

fn push_sorted(
    name: &Path,
    root: &Path,
    mut files: Vec<PathBuf>,
    found: &mut Vec<Found>,
) -> Result<(), InputError> {
    if files.is_empty() {
        let extensions = corsmal_audio::EXTENSIONS.join(", ");
        return Err(InputError::NoAudio { path: name.into(), extensions });
    }
    files.sort_unstable_by(|a, b| {
        a.as_os_str().as_encoded_bytes().cmp(b.as_os_str().as_encoded_bytes())
    });
    // A glob with ** matches a folder and what is in it.
    files.dedup();
    for path in files {
        let relative = path.strip_prefix(root).unwrap_or(&path).to_path_buf();
        found.push(Found::file(path, relative));
    }
    Ok(())
}

fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|e| extensions.iter().any(|x| e.eq_ignore_ascii_case(x)))
}
