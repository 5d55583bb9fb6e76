//! A search for recordings, as far as it has come.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::archive;
use super::beside::Entry;
use super::error::InputError;
use super::found::{Found, Naming};
use super::ids;
use super::input::InputSource;
use super::member::Place;

/// A search for recordings: what was found so far.
pub(super) struct Search<'a> {
    pub(super) found: Vec<Found>,
    pub(super) skipped: Vec<PathBuf>,
    pub(super) archives: Vec<PathBuf>,
    pub(super) unended: Vec<PathBuf>,
    pub(super) stop: &'a Arc<AtomicBool>,
}

impl<'a> Search<'a> {
    pub(super) fn new(stop: &'a Arc<AtomicBool>) -> Self {
        let (found, skipped) = (Vec::new(), Vec::new());
        Self { found, skipped, archives: Vec::new(), unended: Vec::new(), stop }
    }

    /// Adds what another search has found.
    pub(super) fn append(&mut self, mut other: Self) {
        self.found.append(&mut other.found);
        self.skipped.append(&mut other.skipped);
        self.archives.append(&mut other.archives);
        self.unended.append(&mut other.unended);
    }

    /// How much was found, skipped and passed over so far.
    pub(super) fn places(&self) -> (usize, usize, usize) {
        (self.found.len(), self.skipped.len(), self.archives.len())
    }

    /// That nothing at `path` is read, and what is there instead since `before`.
    pub(super) fn nothing_at(&self, path: &Path, before: (usize, usize, usize)) -> InputError {
        no_audio(path, &self.skipped[before.1..], &self.archives[before.2..])
    }

    /// The recordings of an archive; their ids begin with its name.
    pub(super) fn find_archive(&mut self, path: &Path, place: &Place) -> Result<(), InputError> {
        let contents = archive::contents(place, self.stop)?;
        if contents.recordings.is_empty() {
            return Err(no_audio(path, &contents.skipped, &[]));
        }
        let shard = PathBuf::from(path.file_stem().unwrap_or_default());
        for Entry { member, name, labels } in contents.recordings {
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
}

pub(super) fn told(skipped: &[PathBuf]) -> Option<String> {
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

/// That tars in folders are not read.
pub(super) fn archives_told(archives: &[PathBuf]) -> Option<String> {
    let first = archives.iter().min()?.display();
    Some(match archives.len() {
        1 => {
            format!("{first} lies in a folder, so it is not read: to read its recordings, name it")
        }
        n => format!(
            "{n} tars lie in folders, so they are not read, such as {first}: to read their recordings, name them \
             (quoted, 'FOLDER/*.tar')"
        ),
    })
}

/// That nothing at `path` is read, and what is there instead.
pub(super) fn no_audio(path: &Path, skipped: &[PathBuf], archives: &[PathBuf]) -> InputError {
    let extensions = corsmal_audio::EXTENSIONS.join(", ");
    let mut skipped = skipped.to_vec();
    skipped.sort_unstable();
    let instead = told(&skipped).into_iter().chain(archives_told(archives));
    let skipped = instead.map(|told| format!("; {told}")).collect();
    InputError::NoAudio { path: path.into(), extensions, skipped }
}
