//! From what the user names to the list of recordings of a run.
//!
//! A name is, in this order of interpretation: `-` (a recording on standard input), an object of a
//! store (`s3://bucket/x`; below), an existing file (a manifest if its extension is one of [`manifest::EXTENSIONS`](crate::manifest::EXTENSIONS), an archive if it is `.tar`,
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
//! command line. Of several stretches of one file, each has its times after the id, as
//! `x@0.5-1.0`. What still collides is refused. Ids from a manifest stand as they are. Ids that
//! would begin with `__`, the prefix of an output's own arrays, get `./` in front.

mod archive;
mod beside;
mod braces;
pub(crate) mod cells;
mod disk;
pub(crate) mod error;
mod folder;
mod found;
mod identities;
mod ids;
mod input;
mod member;
mod objects;
mod search;
pub(crate) mod stored;
pub(crate) mod times;
mod twice;
mod wildcard;

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::quote::quoted;

use search::{Search, archives_told, no_audio, told};

pub use error::InputError;
pub(crate) use identities::Identities;
pub use input::{Input, InputSource, list_hash};
pub use member::{Fault, Member, Place};
pub use stored::{Object, is_stored, object, require_store, shown};
pub use times::{Given, times_refusal};

/// What names stand for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Collected {
    /// The recordings.
    pub inputs: Vec<Input>,
    /// Files in folders whose names are those of recordings, of formats that are not read, and
    /// metadata of macOS (`._x.wav`) wherever it is named.
    pub skipped: Vec<PathBuf>,
    /// Tar archives in folders, which are read where they are named.
    pub archives: Vec<PathBuf>,
    /// Archives without the blocks of zeros that end one: members may be missing.
    pub unended: Vec<PathBuf>,
}

impl Collected {
    /// That labels look like the stretches that nothing is cut to.
    fn unused_times(&self) -> Option<String> {
        let first = self.inputs.first()?;
        if self.inputs.iter().any(|input| input.start.is_some() || input.end.is_some()) {
            return None;
        }
        times::unused_times(first.labels.iter().map(|(name, _)| name.as_str()))
    }

    /// Sentences about files skipped, archives in folders, archives without an end, labels that look like
    /// times, and files given twice, as far as there are any.
    pub fn warning(&self) -> Option<String> {
        let unended = self.unended.first().map(|first| match self.unended.len() {
            1 => format!("{} has no end mark and may be cut short", first.display()),
            n => {
                let first = first.display();
                format!("{n} tars have no end mark and may be cut short: {first}, ...")
            }
        });
        let told = told(&self.skipped).into_iter();
        let sentences: Vec<String> = told
            .chain(archives_told(&self.archives))
            .chain(unended)
            .chain(self.unused_times())
            .chain(twice::told(&self.inputs))
            .collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }
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
    let Search { found, mut skipped, mut archives, unended, .. } = search;
    if !archives.is_empty() {
        // Some may have been named as well.
        let real = |path: &Path| path.canonicalize().unwrap_or(path.into());
        let read: HashSet<PathBuf> = found.iter().filter_map(|f| f.source.archive()).collect();
        let read: HashSet<PathBuf> = read.iter().map(|path| real(path)).collect();
        archives.retain(|path| !read.contains(&real(path)));
    }
    for paths in [&mut skipped, &mut archives] {
        paths.sort_unstable();
        paths.dedup();
    }
    // Where nothing but such files was named, the first of them says so.
    if let (true, Some(path)) = (found.is_empty(), skipped.first()) {
        return Err(no_audio(path, &[], &[]));
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
    let bytes = columns.iter().map(String::len).sum();
    cells::require_cells(found.len(), columns.len(), bytes)
        .map_err(|reason| InputError::Labels { reason })?;
    for (found, id) in found.iter().zip(&ids) {
        // numpy's texts end before it.
        let has_nul = |(column, value): &&(String, String)| {
            [column, value].into_iter().any(|text| text.contains('\0'))
        };
        if let Some((column, _)) = found.labels.iter().find(has_nul) {
            let column = quoted(column);
            let reason = format!("{id}: the label {column} has a NUL character: remove it");
            return Err(InputError::Labels { reason });
        }
    }
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
    Ok(Collected { inputs: inputs.collect(), skipped, archives, unended })
}
