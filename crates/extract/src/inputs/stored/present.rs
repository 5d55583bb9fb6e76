//! Objects, by the crate `corsmal-stores`.

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_files::identity;
use corsmal_stores::{Existing, ObjectReader, StoreError, Uri, Version};

use super::{Blocks, Purpose};

pub use corsmal_stores::Object;
pub(crate) use corsmal_stores::Pin;

pub(super) fn parse(name: &str) -> Result<Object, String> {
    match Uri::parse(name) {
        Ok(uri) => Ok(Object::new(uri)),
        Err(StoreError::Name { reason, .. }) => Err(reason),
        Err(error) => Err(error.to_string()),
    }
}

/// A pin that keeps to what a listing has shown.
pub(crate) fn pin_to_listed(object: &Object) -> Pin {
    Pin::to(object.listed.clone())
}

/// Opens an object, or so many bytes of it from an offset.
pub(crate) fn open(
    object: &Object,
    stretch: Option<(u64, u64)>,
    purpose: Purpose,
    (pin, stop): (&Pin, &Arc<AtomicBool>),
) -> io::Result<Box<dyn Blocks>> {
    let purpose = match purpose {
        Purpose::Header => corsmal_stores::Purpose::Header,
        Purpose::Part => corsmal_stores::Purpose::Part,
        Purpose::Content => corsmal_stores::Purpose::Content,
    };
    Ok(Box::new(ObjectReader::open(object, stretch, purpose, (pin, stop))?))
}

fn identity_of(version: &Version) -> String {
    version.identity().unwrap_or_else(|| identity::STREAM.into())
}

/// What the bytes that were read are known by; `None` before any came.
pub(crate) fn identity_of_read(pin: &Pin) -> Option<String> {
    pin.version().map(|version| identity_of(&version))
}

/// An identity of what lies at the object's address: without an entity tag, files that a web server tells apart by
/// the query could have the same one.
pub(crate) fn of_address(object: &Object, identity: String) -> String {
    match object.address().strip_prefix(object.name()) {
        Some(query) if !query.is_empty() && identity.contains(":modified:") => {
            format!("{identity}:query:{}", identity::of_bytes(query.as_bytes()))
        }
        _ => identity,
    }
}

/// What the object is known by now; empty where it cannot be asked.
pub(crate) fn identity_now(object: &Object, stop: &AtomicBool) -> String {
    let version = object.listed.clone().or_else(|| object.look(stop).ok());
    version.map(|version| of_address(object, identity_of(&version))).unwrap_or_default()
}

/// The object with its present version; `None` where there is none.
pub(crate) fn look(object: &Object, stop: &AtomicBool) -> Result<Option<Object>, String> {
    match object.look(stop) {
        Ok(version) => Ok(Some(Object { uri: object.uri.clone(), listed: Some(version) })),
        Err(StoreError::Missing) => Ok(None),
        Err(error) => Err(error.to_string()),
    }
}

/// Why no object of its store can be asked for at all, such as credentials that are not there.
pub(crate) fn setup_fault(object: &Object, stop: &AtomicBool) -> Option<String> {
    match object.look(stop) {
        Err(error @ StoreError::Setup(_)) => Some(error.to_string()),
        _ => None,
    }
}

/// The object in the version that was read.
pub(crate) fn as_read(object: &Object, pin: &Pin) -> Object {
    Object { uri: object.uri.clone(), listed: pin.version() }
}

/// All objects below a folder, sorted by their keys.
pub(crate) fn list(folder: &Object, stop: &AtomicBool) -> Result<Vec<Object>, String> {
    corsmal_stores::list(&folder.uri, stop).map_err(|e| e.to_string())
}

/// Puts a file into a store, whole or not at all; `replace` says whether another object may be there.
pub(crate) fn upload(
    file: &Path,
    object: &Object,
    replace: bool,
    stop: &Arc<AtomicBool>,
) -> Result<(), String> {
    let existing = if replace { Existing::Replace } else { Existing::Keep };
    corsmal_stores::upload(file, object, existing, stop).map_err(|e| e.to_string())
}

/// The key in its bucket.
pub(crate) fn key(object: &Object) -> &str {
    object.uri.key()
}

/// Bucket and key.
pub(crate) fn path_in_store(object: &Object) -> &str {
    object.uri.path_in_store()
}

/// Scheme and bucket.
pub(crate) fn root(object: &Object) -> &str {
    object.uri.root()
}

/// Another object of the same bucket.
pub(crate) fn with_key(object: &Object, key: &str) -> Object {
    Object::new(object.uri.with_key(key))
}

/// Whether it stands for all objects below it.
pub(crate) fn is_folder(object: &Object) -> bool {
    object.uri.is_folder()
}

/// Whether it is on a web server, which cannot say what there is.
pub(crate) fn is_web(object: &Object) -> bool {
    object.uri.is_web()
}
