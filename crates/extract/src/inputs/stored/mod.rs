//! Recordings in object stores and on web servers, and what stands for them in a build without the
//! feature `cloud`.

#[cfg(not(feature = "cloud"))]
mod absent;
#[cfg(feature = "cloud")]
mod present;

use std::io::{Read, Seek};
use std::sync::atomic::AtomicBool;

use super::error::InputError;

#[cfg(not(feature = "cloud"))]
pub use absent::*;
#[cfg(feature = "cloud")]
pub use present::*;

/// Bytes that are read where they lie, block by block: of a file, of a member of an archive, of an
/// object of a store.
pub(crate) trait Blocks: Read + Seek + Send {}

impl<T: Read + Seek + Send> Blocks for T {}

/// What a recording is opened for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// A look at its header.
    Header,
    /// A part of it, after its header.
    Part,
    /// All of it.
    Content,
}

/// Requests that wait at the same time.
pub(crate) const LOOKS: usize = 32;

/// Threads that wait for stores, more than there are cores; `None` where they cannot be started.
pub(crate) fn pool(threads: usize) -> Option<rayon::ThreadPool> {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok()
}

/// Whether a name is one of a store, and not of a file: it begins with a scheme other than `file`. One
/// letter is a drive. Which schemes can be read, [`object`] says.
pub fn is_stored(name: &str) -> bool {
    let Some((scheme, _)) = name.split_once("://") else { return false };
    let allowed = |b: u8| b.is_ascii_alphanumeric() || b"+-.".contains(&b);
    scheme.len() > 1
        && scheme.starts_with(|first: char| first.is_ascii_alphabetic())
        && scheme.bytes().all(allowed)
        && !scheme.eq_ignore_ascii_case("file")
}

/// The object of this name.
///
/// # Errors
/// [`InputError::Store`] says what is wrong with the name, or how to get a build that reads objects.
pub fn object(name: &str) -> Result<Object, InputError> {
    parse(name).map_err(|reason| InputError::Store { name: shown(name), reason })
}

/// Refuses a store of which no object can be asked for: where credentials are missing, each of them would
/// take seconds to fail. What is wrong with this object alone is not looked at. Waiting ends when `stop` is
/// set.
///
/// # Errors
/// [`InputError::Store`].
pub fn require_store(name: &str, stop: &AtomicBool) -> Result<(), InputError> {
    match setup_fault(&object(name)?, stop) {
        None => Ok(()),
        Some(reason) => Err(InputError::Store { name: shown(name), reason }),
    }
}

/// A name without the query of a web address, which may hold a signature, or a user and password.
pub fn shown(name: &str) -> String {
    let bucket = name.split_once("://").and_then(|(_, rest)| rest.split('/').next());
    let is_web = name.split_once("://").is_some_and(|(scheme, _)| {
        ["http", "https"].iter().any(|web| scheme.eq_ignore_ascii_case(web))
    });
    match name.split(['?', '#']).next() {
        Some(address) if is_web && address.contains('@') => "a web address".into(),
        Some(address) if is_web => address.into(),
        _ if is_stored(name) && bucket.is_some_and(|bucket| bucket.contains(':')) => {
            "an address in a store".into()
        }
        _ => name.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_stores_are_told_from_files() {
        for name in
            ["s3://b/x.wav", "S3://b", "https://h/x.wav?a=b", "hdfs://n/x.wav", "git+ssh://x"]
        {
            assert!(is_stored(name), "{name}");
        }
        for name in
            ["x.wav", "/a/s3/x.wav", "file:///x.wav", "c://x.wav", "s3:/b", "a/b://x", "://x"]
        {
            assert!(!is_stored(name), "{name}");
        }
        for name in
            ["https://h/x.wav?secret", "http://me:secret@h/x.wav", "s3://me:secret/y@b/x.wav"]
        {
            assert!(!shown(name).contains("secret"), "{name}");
        }
        for name in ["http#1.wav", "https/a?b.wav", "s3://b/a?b#c.wav"] {
            assert_eq!(shown(name), name);
        }
    }
}
