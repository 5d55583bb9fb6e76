//! The recordings that names in stores stand for.

// Without the feature there is no object, and the compiler sees that nothing below can happen.
#![cfg_attr(not(feature = "cloud"), allow(unreachable_code, unused_variables))]

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::archive::{self, Place};
use super::error::InputError;
use super::folder::has_extension;
use super::found::{Found, Naming};
use super::input::InputSource;
use super::stored::{self, Object, object};
use super::{braces, find_archive, no_audio, wildcard};
use crate::manifest;

/// Finds the recordings that a name in a store stands for.
pub(super) fn find(
    name: &str,
    found: &mut Vec<Found>,
    skipped: &mut Vec<PathBuf>,
    unended: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    let is_pattern = |named: &Object| {
        let key = stored::key(named);
        wildcard::is_glob(key) || key.contains('{')
    };
    // As on a disk, an object of this very name comes before what the name may stand for.
    let whole = object(name).ok().filter(|named| !stored::is_web(named) && is_pattern(named));
    if let Some(Ok(Some(object))) = whole.as_ref().map(stored::look) {
        return take(object, found, skipped, unended);
    }
    if let Some(names) = braces::expand(name)? {
        return names.iter().try_for_each(|name| find(name, found, skipped, unended));
    }
    let named = object(name)?;
    if stored::is_web(&named) {
        return take(named, found, skipped, unended);
    }
    if stored::is_folder(&named) {
        return find_below(&named, found, skipped);
    }
    if wildcard::is_glob(stored::key(&named)) {
        return find_glob(&named, found, skipped, unended);
    }
    match stored::look(&named).map_err(|reason| failed(&named, reason))? {
        Some(object) => take(object, found, skipped, unended),
        None => {
            let folder = stored::with_key(&named, &format!("{}/", stored::key(&named)));
            match listing(&folder)?.is_empty() {
                true => Err(InputError::Missing { path: name.into() }),
                false => find_below(&folder, found, skipped),
            }
        }
    }
}

/// The object that a manifest names. The first of each store is asked for, so that a store that refuses
/// all of them is met before the run.
pub(super) fn listed(name: &str, stores: &mut HashSet<String>) -> Result<Object, InputError> {
    let object = object(name)?;
    refuse_lists(&object)?;
    if archive::is_archive(Path::new(stored::key(&object))) {
        let reason = "is an archive of recordings: name it on its own, not in a manifest";
        return Err(failed(&object, reason.into()));
    }
    if !stored::is_web(&object) && stores.insert(stored::root(&object).to_owned()) {
        // What it says of this object would set its first row apart from the others; one that is not
        // there has a row that says so.
        stored::look(&object).map_err(|reason| failed(&object, reason))?;
    }
    Ok(object)
}

fn failed(object: &Object, reason: String) -> InputError {
    InputError::Store { name: object.to_string(), reason }
}

fn listing(folder: &Object) -> Result<Vec<Object>, InputError> {
    stored::list(folder).map_err(|reason| failed(folder, reason))
}

fn refuse_lists(object: &Object) -> Result<(), InputError> {
    let key = Path::new(stored::key(object));
    if has_extension(key, &manifest::EXTENSIONS) {
        let reason =
            "manifests are read from files: copy it here; what it names may stay in stores";
        return Err(failed(object, reason.into()));
    }
    match archive::refusal(Path::new(&object.to_string())) {
        Some(refusal) => Err(refusal),
        None => Ok(()),
    }
}

/// A recording or archive that was named.
fn take(
    object: Object,
    found: &mut Vec<Found>,
    skipped: &mut Vec<PathBuf>,
    unended: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    refuse_lists(&object)?;
    let (key, path) = (PathBuf::from(stored::key(&object)), PathBuf::from(object.to_string()));
    if archive::is_archive(&key) {
        return find_archive(&path, &Place::Object(object.into()), found, skipped, unended);
    }
    let relative = key.file_name().map_or_else(|| key.clone(), PathBuf::from);
    push(object, relative, found);
    Ok(())
}

fn push(object: Object, relative: PathBuf, found: &mut Vec<Found>) {
    found.push(Found {
        source: InputSource::Object(Arc::new(object)),
        naming: Naming::Derived(relative),
        start: None,
        end: None,
        labels: Vec::new(),
        line: None,
    });
}

/// Recordings at any depth below a folder.
fn find_below(
    folder: &Object,
    found: &mut Vec<Found>,
    skipped: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    let root = stored::key(folder);
    let (before, passed) = (found.len(), skipped.len());
    for object in listing(folder)? {
        let key = stored::key(&object);
        let relative = PathBuf::from(key.strip_prefix(root).unwrap_or(key));
        sort_in(object, relative, found, skipped);
    }
    match found.len() > before {
        true => Ok(()),
        false => Err(no_audio(Path::new(&folder.to_string()), &skipped[passed..])),
    }
}

/// A recording, or what is passed over: other formats are told, all else is not.
fn sort_in(object: Object, relative: PathBuf, found: &mut Vec<Found>, skipped: &mut Vec<PathBuf>) {
    if relative.iter().any(|part| part.as_encoded_bytes().starts_with(b".")) {
        return;
    }
    if has_extension(&relative, &corsmal_audio::EXTENSIONS) {
        push(object, relative, found);
    } else if has_extension(&relative, &corsmal_audio::OTHER_EXTENSIONS) {
        skipped.push(object.to_string().into());
    }
}

/// Recordings and archives that a glob matches, and what is below folders that it matches.
fn find_glob(
    named: &Object,
    found: &mut Vec<Found>,
    skipped: &mut Vec<PathBuf>,
    unended: &mut Vec<PathBuf>,
) -> Result<(), InputError> {
    let pattern = stored::key(named);
    let root = match wildcard::root(pattern) {
        root if root.as_os_str().is_empty() => String::new(),
        root => format!("{}/", root.display()),
    };
    let keys = wildcard::Keys::new(pattern)?;
    let (before, passed) = (found.len(), skipped.len());
    for object in listing(&stored::with_key(named, &root))? {
        let key = stored::key(&object).to_owned();
        let named_itself = keys.matches(&key);
        if !named_itself && !keys.matches_above(&key) {
            continue;
        }
        // As on a disk, archives in folders are passed over.
        if named_itself && archive::is_archive(Path::new(&key)) {
            let path = PathBuf::from(object.to_string());
            find_archive(&path, &Place::Object(object.into()), found, skipped, unended)?;
        } else {
            let relative = PathBuf::from(key.strip_prefix(&root).unwrap_or(&key));
            sort_in(object, relative, found, skipped);
        }
    }
    match found.len() > before {
        true => Ok(()),
        false => Err(no_audio(Path::new(&named.to_string()), &skipped[passed..])),
    }
}
