//! Where the reference data is.

use std::path::PathBuf;

/// A file of the CCM reference data, or `None` with a line that says so.
pub fn ccm(file: &str) -> Option<PathBuf> {
    let root = std::env::var_os("CORSMAL_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let path = root.join("data/ccm").join(file);
    if path.exists() {
        Some(path)
    } else {
        println!("skipped: {} absent", path.display());
        None
    }
}
