//! What is odd about a file of a data set.

use std::path::PathBuf;

/// Something that is not as it should be.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Oddity {
    /// The file.
    pub path: PathBuf,
    /// What is odd about it.
    pub what: String,
}
