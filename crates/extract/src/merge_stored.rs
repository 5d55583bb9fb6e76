//! Merges shards that are in stores, or into a store.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use tempfile::TempDir;

use crate::inputs::is_stored;
use crate::merge::{self, Existing, MergeError};
use crate::run::{RunError, StoredOutput, fetch_to};

/// As [`merge::merge`], where the result or shards may be in stores: shards are copied into a temporary folder
/// in `work`, by default the current one, the result is made in `work`, and sent when it is complete. Waiting
/// ends when `stop` is set.
///
/// # Errors
/// As [`merge::merge`]; [`MergeError::Stored`].
pub fn merge(
    shards: &[PathBuf],
    (out, work): (&Path, Option<&Path>),
    existing: Existing,
    stop: &Arc<AtomicBool>,
) -> Result<(), MergeError> {
    let stored = StoredOutput::of(out, work, None)?;
    if let Some(stored) = &stored
        && existing != Existing::Overwrite
        && stored.is_there(stop)?
    {
        return Err(MergeError::Exists { path: stored.name().into() });
    }
    // Removed when it is dropped.
    let mut copies: Option<TempDir> = None;
    let mut here = Vec::with_capacity(shards.len());
    for (index, shard) in shards.iter().enumerate() {
        let Some(name) = shard.to_str().filter(|name| is_stored(name)) else {
            here.push(shard.clone());
            continue;
        };
        let folder = match &copies {
            Some(folder) => folder.path(),
            None => copies.insert(temporary(work)?).path(),
        };
        let copy = folder.join(index.to_string());
        fetch_to(name, &copy, stop)?;
        here.push(copy);
    }
    let Some(stored) = stored else {
        return merge::merge(&here, out, existing);
    };
    // A result that was not sent is made again: its shards may be others by now.
    let local = if stored.file.exists() { Existing::Overwrite } else { existing };
    merge::merge(&here, &stored.file, local)?;
    Ok(stored.publish(existing == Existing::Overwrite, stop)?)
}

fn temporary(work: Option<&Path>) -> Result<TempDir, MergeError> {
    let work = work.unwrap_or(Path::new("."));
    let made = tempfile::Builder::new().prefix(".corsmal-feat-merge-").tempdir_in(work);
    Ok(made.map_err(RunError::Folder)?)
}
