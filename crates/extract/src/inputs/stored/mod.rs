//! Recordings in object stores and on web servers, and what stands for them in a build without the
//! feature `cloud`.

#[cfg(not(feature = "cloud"))]
mod absent;
#[cfg(feature = "cloud")]
mod present;

use std::io::{Read, Seek};

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

/// Beginnings of the names of objects, whether or not they can be read.
const SCHEMES: [&str; 10] =
    ["s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "http", "https", "hdfs"];

/// Whether a name is one of a store, and not of a file.
pub fn is_stored(name: &str) -> bool {
    name.split_once("://")
        .is_some_and(|(scheme, _)| SCHEMES.iter().any(|known| scheme.eq_ignore_ascii_case(known)))
}

/// The object of this name.
///
/// # Errors
/// [`InputError::Store`] says what is wrong with the name, or how to get a build that reads objects.
pub fn object(name: &str) -> Result<Object, InputError> {
    parse(name).map_err(|reason| InputError::Store { name: shown(name), reason })
}

/// A name without the query of a web address, which may hold a signature, or its user and password.
fn shown(name: &str) -> String {
    let is_web = name.get(..4).is_some_and(|scheme| scheme.eq_ignore_ascii_case("http"));
    match name.split(['?', '#']).next() {
        Some(name) if is_web && name.contains('@') => "a web address".into(),
        Some(name) if is_web => name.into(),
        _ => name.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_stores_are_told_from_files() {
        for name in ["s3://b/x.wav", "S3://b", "https://h/x.wav?a=b", "hdfs://n/x.wav"] {
            assert!(is_stored(name), "{name}");
        }
        for name in ["x.wav", "/a/s3/x.wav", "file:///x.wav", "c://x.wav", "s3:/b"] {
            assert!(!is_stored(name), "{name}");
        }
        for name in ["https://h/x.wav?secret", "http://me:secret@h/x.wav"] {
            assert!(!shown(name).contains("secret"), "{name}");
        }
    }
}
