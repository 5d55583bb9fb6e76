//! The recordings that names in stores stand for.

// Without the feature there is no object, and the compiler sees that nothing below can happen.
#![cfg_attr(not(feature = "cloud"), allow(unreachable_code, unused_mut, unused_variables))]

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::archive;
use super::error::InputError;
use super::folder::has_extension;
use super::found::{Found, Naming};
use super::input::InputSource;
use super::member::Place;
use super::search::Search;
use super::stored::{self, Object, object};
use super::{braces, wildcard};
use crate::manifest;

/// Names of a list that are looked for at the same time: of archives all headers are read.
const NAMES: usize = 8;

impl Search<'_> {
    /// Finds the recordings that a name in a store stands for.
    pub(super) fn find_object(&mut self, name: &str) -> Result<(), InputError> {
        let is_pattern = |named: &Object| {
            let key = stored::key(named);
            wildcard::is_glob(key) || key.contains('{')
        };
        // As on a disk, an object of this very name comes before what the name may stand for.
        let whole = object(name).ok().filter(|named| !stored::is_web(named) && is_pattern(named));
        if let Some(Ok(Some(object))) = whole.as_ref().map(|whole| stored::look(whole, self.stop)) {
            return self.take(object);
        }
        if let Some(names) = braces::expand(name)? {
            return self.find_all(&names, |search, name| search.find_object(name));
        }
        let named = object(name)?;
        if stored::is_web(&named) {
            return self.take(named);
        }
        if stored::is_folder(&named) {
            return self.find_below(&named);
        }
        if wildcard::is_glob(stored::key(&named)) {
            return self.find_objects(&named);
        }
        match stored::look(&named, self.stop).map_err(|reason| failed(&named, reason))? {
            Some(object) => self.take(object),
            None => {
                let folder = stored::with_key(&named, &format!("{}/", stored::key(&named)));
                match self.listing(&folder)?.is_empty() {
                    true => Err(InputError::Missing { path: name.into() }),
                    false => self.find_below(&folder),
                }
            }
        }
    }

    /// Finds what each of `names` stands for, in their order, some at the same time: most of it is
    /// waiting.
    fn find_all<T: Sync>(
        &mut self,
        names: &[T],
        find: impl Fn(&mut Search<'_>, &T) -> Result<(), InputError> + Sync,
    ) -> Result<(), InputError> {
        let stop = self.stop;
        let one = |name: &T| {
            let mut search = Search::new(stop);
            find(&mut search, name).map(|()| search)
        };
        let each = || names.par_iter().map(one).collect::<Result<Vec<_>, _>>();
        let found = match stored::pool(names.len().min(NAMES)) {
            Some(pool) => pool.install(each)?,
            None => names.iter().map(one).collect::<Result<_, _>>()?,
        };
        found.into_iter().for_each(|search| self.append(search));
        Ok(())
    }

    fn listing(&self, folder: &Object) -> Result<Vec<Object>, InputError> {
        stored::list(folder, self.stop).map_err(|reason| failed(folder, reason))
    }

    /// A recording or archive that was named.
    fn take(&mut self, object: Object) -> Result<(), InputError> {
        refuse_lists(&object)?;
        let (key, path) = (PathBuf::from(stored::key(&object)), PathBuf::from(object.to_string()));
        if archive::is_archive(&key) {
            return self.find_archive(&path, &Place::Object(object.into()));
        }
        let relative = key.file_name().map_or_else(|| key.clone(), PathBuf::from);
        self.push(object, relative);
        Ok(())
    }

    fn push(&mut self, object: Object, relative: PathBuf) {
        self.found.push(Found {
            source: InputSource::Object(Arc::new(object)),
            naming: Naming::Derived(relative),
            start: None,
            end: None,
            labels: Vec::new(),
            line: None,
        });
    }

    /// Recordings at any depth below a folder.
    fn find_below(&mut self, folder: &Object) -> Result<(), InputError> {
        let root = stored::key(folder);
        let before = self.places();
        for object in self.listing(folder)? {
            let key = stored::key(&object);
            let relative = PathBuf::from(key.strip_prefix(root).unwrap_or(key));
            self.sort_in(object, relative);
        }
        match self.found.len() > before.0 {
            true => Ok(()),
            false => Err(self.nothing_at(Path::new(&folder.to_string()), before)),
        }
    }

    /// A recording, or what is passed over: other formats are told, all else is not.
    fn sort_in(&mut self, object: Object, relative: PathBuf) {
        if relative.iter().any(|part| part.as_encoded_bytes().starts_with(b".")) {
            return;
        }
        if has_extension(&relative, &corsmal_audio::EXTENSIONS) {
            self.push(object, relative);
        } else if has_extension(&relative, &corsmal_audio::OTHER_EXTENSIONS) {
            self.skipped.push(object.to_string().into());
        } else if archive::is_archive(&relative) {
            self.archives.push(object.to_string().into());
        }
    }

    /// Recordings and archives that a glob matches, and what is below folders that it matches.
    fn find_objects(&mut self, named: &Object) -> Result<(), InputError> {
        let pattern = stored::key(named);
        let root = match wildcard::root(pattern) {
            root if root.as_os_str().is_empty() => String::new(),
            root => format!("{}/", root.display()),
        };
        let keys = wildcard::Keys::new(pattern)?;
        let before = self.places();
        let mut matched = Vec::new();
        for object in self.listing(&stored::with_key(named, &root))? {
            let key = stored::key(&object);
            let named_itself = keys.matches(key);
            if named_itself || keys.matches_above(key) {
                let is_archive = named_itself && archive::is_archive(Path::new(key));
                matched.push((object, is_archive));
            }
        }
        // As on a disk, archives in folders are passed over.
        self.find_all(&matched, |search, (object, is_archive)| {
            if *is_archive {
                let path = PathBuf::from(object.to_string());
                return search.find_archive(&path, &Place::Object(object.clone().into()));
            }
            let key = stored::key(object);
            let relative = PathBuf::from(key.strip_prefix(&root).unwrap_or(key));
            search.sort_in(object.clone(), relative);
            Ok(())
        })?;
        match self.found.len() > before.0 {
            true => Ok(()),
            false => Err(self.nothing_at(Path::new(&named.to_string()), before)),
        }
    }
}

/// The object that a manifest names. The first of each store is asked for, so that a store that refuses
/// all of them is met before the run.
pub(super) fn listed(
    name: &str,
    stores: &mut HashSet<String>,
    stop: &AtomicBool,
) -> Result<Object, InputError> {
    let object = object(name)?;
    refuse_lists(&object)?;
    if archive::is_archive(Path::new(stored::key(&object))) {
        let reason = "is an archive of recordings: give it as an input, not in a manifest";
        return Err(failed(&object, reason.into()));
    }
    if !stored::is_web(&object) && stores.insert(stored::root(&object).to_owned()) {
        // What it says of this object would set its first row apart from the others; one that is not
        // there has a row that says so.
        stored::look(&object, stop).map_err(|reason| failed(&object, reason))?;
    }
    Ok(object)
}

fn failed(object: &Object, reason: String) -> InputError {
    InputError::Store { name: object.to_string(), reason }
}

fn refuse_lists(object: &Object) -> Result<(), InputError> {
    let key = Path::new(stored::key(object));
    if has_extension(key, &manifest::EXTENSIONS) {
        let reason = "manifests are read from files: copy it here; the recordings that it names may stay \
             in stores";
        return Err(failed(object, reason.into()));
    }
    match archive::refusal(Path::new(&object.to_string())) {
        Some(refusal) => Err(refusal),
        None => Ok(()),
    }
}
