//! What is odd about a file of a data set.

use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

/// Something that is not as it should be.
#[derive(Clone, Debug, Serialize)]
pub struct Oddity {
    /// The file.
    #[serde(serialize_with = "in_words")]
    pub path: PathBuf,
    /// What is odd about it.
    pub what: String,
}

/// A path as messages have it, also where it is no text.
pub(super) fn in_words<S: Serializer>(path: &Path, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(&path.display())
}

/// Paths as messages have them.
pub(super) fn all_in_words<S: Serializer>(paths: &[PathBuf], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(paths.iter().map(|path| path.display().to_string()))
}

/// A path, if there is one, as messages have it.
pub(super) fn perhaps_in_words<S: Serializer>(
    path: &Option<PathBuf>,
    to: S,
) -> Result<S::Ok, S::Error> {
    path.as_ref().map(|path| path.display().to_string()).serialize(to)
}
