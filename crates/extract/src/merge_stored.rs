//! Merges shards that are in stores, or into a store.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_files::feature_file::FeatureFile;

use crate::merge::{self, Existing, MergeError};
use crate::run::{RunError, StoredOutput};

/// As [`merge::merge`], where the result or shards may be in stores: they are copied into `work`, by default the
/// current folder, the result is made there, and sent when it is complete. Waiting ends when `stop` is set.
///
/// # Errors
/// As [`merge::merge`]; [`MergeError::Stored`].
pub fn merge(
    shards: &[PathBuf],
    (out, work): (&Path, Option<&Path>),
    existing: Existing,
    stop: &Arc<AtomicBool>,
) -> Result<(), MergeError> {
    let mut copies = Vec::new();
    let merged = merge_copies(shards, (out, work), existing, stop, &mut copies);
    // The first error is the one that matters.
    let forgotten = copies.iter().try_for_each(StoredOutput::forget);
    merged?;
    Ok(forgotten?)
}

/// Copies shards that are in stores, which `copies` tells, and merges all.
fn merge_copies(
    shards: &[PathBuf],
    (out, work): (&Path, Option<&Path>),
    existing: Existing,
    stop: &Arc<AtomicBool>,
    copies: &mut Vec<StoredOutput>,
) -> Result<(), MergeError> {
    let mut here = Vec::new();
    for shard in shards {
        match StoredOutput::of(shard, work, None)? {
            None => here.push(shard.clone()),
            Some(stored) => {
                let copy = stored.present(stop)?.ok_or_else(|| RunError::Store {
                    name: stored.name(),
                    reason: "the store has no such object".into(),
                })?;
                copy.publish().map_err(RunError::Folder)?;
                here.push(stored.file.clone());
                copies.push(stored);
            }
        }
    }
    let Some(stored) = StoredOutput::of(out, work, None)? else {
        return merge::merge(&here, out, existing);
    };
    if existing != Existing::Overwrite && stored.is_there(stop)? {
        return Err(MergeError::Exists { path: stored.name().into() });
    }
    if existing == Existing::Resume && stored.file.exists() {
        // One that is complete, and was not sent.
        let provenance = merge::provenance(&here, &stored.file)?;
        if FeatureFile::open(&stored.file)?.provenance()? != provenance {
            return Err(MergeError::Exists { path: stored.file });
        }
    } else {
        merge::merge(&here, &stored.file, existing)?;
    }
    Ok(stored.publish(existing == Existing::Overwrite, stop)?)
}
