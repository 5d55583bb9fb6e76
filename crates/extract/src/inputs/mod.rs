//! From what the user names to the list of recordings of a run.
//!
//! A name is, in this order of interpretation: `-` (a recording on standard input), an object of a
//! store (`s3://bucket/x`; below), an existing file (a manifest if its extension is one of [`manifest::EXTENSIONS`], an archive if it is `.tar`,
//! else a recording), an existing folder, a list in braces as `{000..012}.tar` or `{a,b}.wav`, or a
//! glob. A name such as `s3://bucket/x` is never looked for on a disk: it is an object, a folder of them where it ends with a
//! slash or no object has it, a list in braces or a glob. Folders and globs give files with an audio extension only, follow
//! symbolic links, skip names that begin with a dot, and are sorted by the bytes of the path
//! relative to their root; names keep the order in which they are given.
//!
//! **Ids.** A recording's id is its path relative to its root, without extension, with `/` between
//! the parts. The root is the folder named, the part of a glob before its first wildcard, or the
//! folder of a file named; the id of a recording in a tar begins with the name of the tar; paths in a manifest are taken as written. Where ids collide, all those
//! that do keep their extension; where that does not help, they take the path as given on the
//! command line. Of several stretches of one file, each has its times behind the id, as
//! `x@0.5-1.0`. What still collides is refused. Ids from a manifest stand as they are. Ids that
//! would begin with `__`, the prefix of an output's own arrays, get `./` in front.

mod archive;
mod beside;
mod braces;
mod error;
mod folder;
mod found;
mod identities;
mod ids;
mod input;
mod objects;
pub(crate) mod stored;
mod wildcard;

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::manifest;
use folder::{has_extension, is_apple_double, walk};
use found::{Found, Naming};

pub use archive::{Fault, Member, Place};
pub use error::InputError;
pub(crate) use identities::Identities;
pub use input::{Input, InputSource, list_hash};
pub use stored::{Object, is_stored, object, require_store, shown};

/// What names stand for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Collected {
    /// The recordings.
    pub inputs: Vec<Input>,
    /// Files in folders whose names are those of recordings, of formats that are not read, and
    /// metadata of macOS (`._x.wav`) wherever it is named.
    pub skipped: Vec<PathBuf>,
    /// Archives without the blocks of zeros that end one: members may be missing.
    pub unended: Vec<PathBuf>,
}

/// What other programs call the ends of a stretch.
const TIMES: [&str; 8] =
    ["start_time", "end_time", "begin", "begin_time", "stop", "stop_time", "onset", "offset"];

impl Collected {
    /// That labels look like the stretches that nothing is cut to.
    fn unused_times(&self) -> Option<String> {
        let first = self.inputs.first()?;
        if self.inputs.iter().any(|input| input.start.is_some() || input.end.is_some()) {
            return None;
        }
        let names = first.labels.iter().map(|(name, _)| name.as_str());
        let times: Vec<&str> = names.filter(|name| TIMES.contains(name)).collect();
        let columns = match times.as_slice() {
            [] => return None,
            [only] => format!("the column {only} is a label"),
            several => format!("the columns {} are labels", several.join(", ")),
        };
        Some(format!(
            "{columns}, so whole recordings are read: to read stretches, use columns called \
             `start` and `end`, in seconds"
        ))
    }

    /// A sentence about the files skipped, one about archives without an end and one about columns of
    /// manifests that look like times and are none, if there are any.
    pub fn warning(&self) -> Option<String> {
        let unended = self.unended.first().map(|first| match self.unended.len() {
            1 => format!("{} has no end mark and may be cut short", first.display()),
            n => {
                let first = first.display();
                format!("{n} tars have no end mark and may be cut short: {first}, ...")
            }
        });
        let told = told(&self.skipped).into_iter();
        let sentences: Vec<String> = told.chain(unended).chain(self.unused_times()).collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }
}

fn told(skipped: &[PathBuf]) -> Option<String> {
    const SHOWN: usize = 3;
    let names: Vec<_> = skipped.iter().take(SHOWN).map(|p| p.display().to_string()).collect();
    let more = if skipped.len() > SHOWN { ", ..." } else { "" };
    let files = match skipped.len() {
        0 => return None,
        1 => "1 file was skipped because its format is".to_string(),
        n => format!("{n} files were skipped because their formats are"),
    };
    Some(format!("{files} not read from folders: {}{more}", names.join(", ")))
}

/// That nothing at `path` is read, and what is there instead.
fn no_audio(path: &Path, skipped: &[PathBuf]) -> InputError {
    let extensions = corsmal_audio::EXTENSIONS.join(", ");
    let mut skipped = skipped.to_vec();
    skipped.sort_unstable();
    let skipped = told(&skipped).map(|told| format!("; {told}")).unwrap_or_default();
    InputError::NoAudio { path: path.into(), extensions, skipped }
}

/// Finds the recordings that `names` stand for, in a stable order, with unique ids.
///
/// # Errors
/// [`InputError`] names the path, and in a manifest the line.
pub fn collect<S: AsRef<OsStr>>(names: &[S]) -> Result<Collected, InputError> {
    collect_until(names, &Arc::default())
}

/// As [`collect`]; waiting for stores ends when `stop` is set.
///
/// # Errors
/// As [`collect`]; [`InputError::Stopped`].
pub fn collect_until<S: AsRef<OsStr>>(
    names: &[S],
    stop: &Arc<AtomicBool>,
) -> Result<Collected, InputError> {
    let mut search = Search::new(stop);
    let searched = names.iter().try_for_each(|name| search.find(name.as_ref()));
    if stop.load(Ordering::Relaxed) {
        return Err(InputError::Stopped);
    }
    searched?;
    let Search { found, mut skipped, unended, .. } = search;
    skipped.sort_unstable();
    skipped.dedup();
    // Where nothing but such files was named, the first of them says so.
    if let (true, Some(path)) = (found.is_empty(), skipped.first()) {
        return Err(no_audio(path, &[]));
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
    Ok(Collected { inputs: inputs.collect(), skipped, unended })
}

/// A search for recordings: what was found so far.
struct Search<'a> {
    found: Vec<Found>,
    skipped: Vec<PathBuf>,
    unended: Vec<PathBuf>,
    stop: &'a Arc<AtomicBool>,
}

impl<'a> Search<'a> {
    fn new(stop: &'a Arc<AtomicBool>) -> Self {
        Self { found: Vec::new(), skipped: Vec::new(), unended: Vec::new(), stop }
    }

    /// Adds what another search has found.
    fn append(&mut self, mut other: Self) {
        self.found.append(&mut other.found);
        self.skipped.append(&mut other.skipped);
        self.unended.append(&mut other.unended);
    }

    fn find(&mut self, name: &OsStr) -> Result<(), InputError> {
        if name == "-" {
            let naming = Naming::Given("stdin".into());
            let (start, end, labels) = (None, None, Vec::new());
            let line = None;
            self.found.push(Found { source: InputSource::Stdin, naming, start, end, labels, line });
            return Ok(());
        }
        // The name of an object is never one of a file.
        if let Some(uri) = name.to_str().filter(|name| is_stored(name)) {
            return self.find_object(uri);
        }
        let path = Path::new(name);
        match std::fs::metadata(path) {
            Ok(meta) if meta.is_dir() => {
                let (mut files, before) = (Vec::new(), self.skipped.len());
                walk(path, &mut files, &mut self.skipped)?;
                if files.is_empty() {
                    return Err(no_audio(path, &self.skipped[before..]));
                }
                self.push_sorted(path, files);
                Ok(())
            }
            Ok(_) if is_apple_double(path) => {
                self.skipped.push(path.into());
                Ok(())
            }
            Ok(_) if has_extension(path, &manifest::EXTENSIONS) => self.find_manifest(path),
            Ok(_) if archive::is_archive(path) => {
                self.find_archive(path, &Place::File(path.into()))
            }
            Ok(_) => {
                if let Some(refusal) = archive::refusal(path) {
                    return Err(refusal);
                }
                let relative = path.file_name().map_or_else(|| path.into(), PathBuf::from);
                self.found.push(Found::file(path.into(), relative));
                Ok(())
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let missing = || InputError::Missing { path: path.into() };
                let pattern = name.to_str().ok_or_else(missing)?;
                match braces::expand(pattern)? {
                    Some(names) => names.iter().try_for_each(|name| self.find(name.as_ref())),
                    None if wildcard::is_glob(pattern) => self.find_glob(pattern),
                    None => Err(missing()),
                }
            }
            Err(error) => Err(InputError::io(path, error)),
        }
    }

    /// The recordings of an archive; their ids begin with its name.
    fn find_archive(&mut self, path: &Path, place: &Place) -> Result<(), InputError> {
        let contents = archive::contents(place, self.stop)?;
        if contents.recordings.is_empty() {
            return Err(no_audio(path, &contents.skipped));
        }
        let shard = PathBuf::from(path.file_stem().unwrap_or_default());
        for archive::Entry { member, name, labels } in contents.recordings {
            if let Some(reason) = ids::label_refusal(&labels) {
                return Err(InputError::Archive { path: path.into(), reason });
            }
            let naming = Naming::Derived(shard.join(name));
            let source = InputSource::Member(Box::new(member));
            self.found.push(Found { source, naming, start: None, end: None, labels, line: None });
        }
        self.skipped.extend(contents.skipped);
        if !contents.is_ended {
            self.unended.push(path.into());
        }
        Ok(())
    }

    fn find_manifest(&mut self, path: &Path) -> Result<(), InputError> {
        // A manifest beside the wrong folder, or one with files that are gone, is mended before the run.
        let mut unreadable: Option<(u64, String, usize)> = None;
        let mut stores = HashSet::new();
        let entries = manifest::read(path)?;
        // All rows have the same labels.
        if let Some(reason) = entries.first().and_then(|e| ids::label_refusal(&e.labels)) {
            return Err(InputError::Labels { reason: format!("{}: {reason}", path.display()) });
        }
        for entry in entries {
            let wrong =
                |reason| InputError::Manifest { path: path.into(), line: entry.line, reason };
            let mut stored = None;
            if is_stored(&entry.written) {
                let object = objects::listed(&entry.written, &mut stores, self.stop);
                stored = Some(object.map_err(|error| wrong(error.to_string()))?);
            } else {
                match std::fs::metadata(&entry.path) {
                    Ok(meta) if meta.is_dir() => {
                        return Err(wrong(format!("{} is a folder", entry.path.display())));
                    }
                    Ok(_) if archive::is_archive(&entry.path) => {
                        return Err(wrong(format!(
                            "{} is an archive of recordings: give it as an input, not in a \
                             manifest",
                            entry.path.display()
                        )));
                    }
                    Ok(_) if is_apple_double(&entry.path) => {
                        self.skipped.push(entry.path);
                        continue;
                    }
                    Ok(meta) if !meta.is_file() => {
                        return Err(wrong(format!(
                            "{} is a pipe or device, whose bytes come once: give it as an input, not in a manifest",
                            entry.path.display()
                        )));
                    }
                    Ok(_) => {}
                    Err(error) => {
                        let first =
                            || (entry.line, format!("{}: {error}", entry.path.display()), 0);
                        unreadable.get_or_insert_with(first).2 += 1;
                        continue;
                    }
                }
            }
            if let Some(reason) = entry.id.as_deref().and_then(ids::refusal) {
                return Err(wrong(reason));
            }
            let naming = match (entry.id, &stored) {
                (Some(id), _) => Naming::Given(id),
                (None, Some(object)) => Naming::Derived(stored::key(object).into()),
                (None, None) => Naming::Derived(entry.written.into()),
            };
            let source = match stored {
                Some(object) => InputSource::Object(object.into()),
                None => InputSource::File(entry.path),
            };
            let (start, end, labels) = (entry.start, entry.end, entry.labels);
            let line = Some(entry.line);
            self.found.push(Found { source, naming, start, end, labels, line });
        }
        let Some((line, mut reason, number)) = unreadable else { return Ok(()) };
        if number > 1 {
            reason.push_str(&format!("; {} other lines name such files", number - 1));
        }
        Err(InputError::Manifest { path: path.into(), line, reason })
    }

    fn find_glob(&mut self, pattern: &str) -> Result<(), InputError> {
        let (mut files, before) = (Vec::new(), self.skipped.len());
        let (mut archives, paths): (Vec<_>, Vec<_>) = wildcard::expand(pattern)?
            .into_iter()
            .partition(|path| archive::is_archive(path) && path.is_file());
        archives.sort_unstable();
        for path in &archives {
            self.find_archive(path, &Place::File(path.clone()))?;
        }
        for path in paths {
            walk(&path, &mut files, &mut self.skipped)?;
        }
        if files.is_empty() && archives.is_empty() {
            return Err(no_audio(Path::new(pattern), &self.skipped[before..]));
        }
        self.push_sorted(&wildcard::root(pattern), files);
        Ok(())
    }

    fn push_sorted(&mut self, root: &Path, mut files: Vec<PathBuf>) {
        files.sort_unstable_by(|a, b| {
            a.as_os_str().as_encoded_bytes().cmp(b.as_os_str().as_encoded_bytes())
        });
        // A glob with ** matches a folder and what is in it.
        files.dedup();
        for path in files {
            let relative = path.strip_prefix(root).unwrap_or(&path).to_path_buf();
            self.found.push(Found::file(path, relative));
        }
    }
}
