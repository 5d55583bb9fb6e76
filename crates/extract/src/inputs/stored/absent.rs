//! A build that reads no objects: there are none.

use std::fmt;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::{Blocks, Purpose};

/// An object of a store: none in this build.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Object {}

impl Object {
    /// Its URI.
    pub fn name(&self) -> &str {
        match *self {}
    }

    /// Its URI, with the query of a web address.
    pub fn address(&self) -> String {
        match *self {}
    }
}

impl fmt::Display for Object {
    fn fmt(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {}
    }
}

/// Keeps reads of an object to one version.
#[derive(Debug, Clone, Default)]
pub(crate) struct Pin(());

impl Pin {
    pub(crate) fn changed(&self) -> Option<String> {
        None
    }
}

pub(super) fn parse(_: &str) -> Result<Object, String> {
    Err("this build cannot read object stores: a build with `--features cloud` can, and so can \
         the Python package; or mount the bucket (s3fs, gcsfuse, rclone mount), or copy the files"
        .into())
}

pub(crate) fn pin_to_listed(object: &Object) -> Pin {
    match *object {}
}

pub(crate) fn open(
    object: &Object,
    _: Option<(u64, u64)>,
    _: Purpose,
    _: (&Pin, &Arc<AtomicBool>),
) -> io::Result<Box<dyn Blocks>> {
    match *object {}
}

pub(crate) fn identity_of_read(_: &Pin) -> Option<String> {
    None
}

pub(crate) fn of_address(object: &Object, _: String) -> String {
    match *object {}
}

pub(crate) fn identity_now(object: &Object, _: &AtomicBool) -> String {
    match *object {}
}

pub(crate) fn look(object: &Object, _: &AtomicBool) -> Result<Option<Object>, String> {
    match *object {}
}

pub(crate) fn setup_fault(object: &Object, _: &AtomicBool) -> Option<String> {
    match *object {}
}

pub(crate) fn as_read(object: &Object, _: &Pin) -> Object {
    match *object {}
}

pub(crate) fn list(folder: &Object, _: &AtomicBool) -> Result<Vec<Object>, String> {
    match *folder {}
}

pub(crate) fn upload(
    _: &Path,
    object: &Object,
    _: bool,
    _: &Arc<AtomicBool>,
) -> Result<(), String> {
    match *object {}
}

pub(crate) fn key(object: &Object) -> &str {
    match *object {}
}

pub(crate) fn path_in_store(object: &Object) -> &str {
    match *object {}
}

pub(crate) fn root(object: &Object) -> &str {
    match *object {}
}

pub(crate) fn with_key(object: &Object, _: &str) -> Object {
    match *object {}
}

pub(crate) fn is_folder(object: &Object) -> bool {
    match *object {}
}

pub(crate) fn is_web(object: &Object) -> bool {
    match *object {}
}
