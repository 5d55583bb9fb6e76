//! The recordings that names on a disk stand for.

use std::collections::HashSet;
use std::ffi::OsStr;
use std::io;
use std::path::{Path, PathBuf};

use super::error::InputError;
use super::folder::{has_extension, is_apple_double, walk};
use super::found::{Found, Naming};
use super::input::InputSource;
use super::member::Place;
use super::search::Search;
use super::stored::{self, is_stored};
use super::{archive, braces, ids, objects, wildcard};
use crate::manifest;

impl Search<'_> {
    /// Finds the recordings that a name stands for.
    pub(super) fn find(&mut self, name: &OsStr) -> Result<(), InputError> {
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
                let (mut files, before) = (Vec::new(), self.places());
                walk(path, &mut files, (&mut self.skipped, &mut self.archives))?;
                if files.is_empty() {
                    return Err(self.nothing_at(path, before));
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
        let (mut files, before) = (Vec::new(), self.places());
        let (mut archives, paths): (Vec<_>, Vec<_>) = wildcard::expand(pattern)?
            .into_iter()
            .partition(|path| archive::is_archive(path) && path.is_file());
        archives.sort_unstable();
        for path in &archives {
            self.find_archive(path, &Place::File(path.clone()))?;
        }
        for path in paths {
            walk(&path, &mut files, (&mut self.skipped, &mut self.archives))?;
        }
        if files.is_empty() && archives.is_empty() {
            return Err(self.nothing_at(Path::new(pattern), before));
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
