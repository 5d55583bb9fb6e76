//! Merges shards that are in stores, or into a store.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_files::workplace::Workplace;

use super::Existing;
use super::error::MergeError;
use crate::inputs::is_stored;
use crate::run::{RunError, StoredOutput, fetch_to};

/// As [`super::merge`], where the result or shards may be in stores: shards are copied into a temporary folder
/// in `work`, by default the current one, the result is made in `work`, and sent when it is complete. Waiting
/// ends when `stop` is set.
///
/// # Errors
/// As [`super::merge`].
pub fn merge(
    shards: &[PathBuf],
    (out, work): (&Path, Option<&Path>),
    existing: Existing,
    stop: &Arc<AtomicBool>,
) -> Result<Option<String>, MergeError> {
    if shards.iter().any(|shard| shard == out) {
        return Err(MergeError::IsShard { path: out.into() });
    }
    // Apart from an output of `extract` that has not reached its store.
    let stored = StoredOutput::of(out, work, None)?.map(|stored| stored.kept_apart("merged"));
    if let Some(stored) = &stored
        && existing != Existing::Overwrite
        && stored.is_there(stop)?
    {
        let path = stored.name().into();
        return Err(match existing {
            Existing::Resume => MergeError::Whole { path },
            _ => MergeError::Exists { path },
        });
    }
    let is_any_stored = shards.iter().any(|shard| shard.to_str().is_some_and(is_stored));
    if let (None, false, Some(work)) = (&stored, is_any_stored, work) {
        return Err(RunError::Work { path: out.into(), work: work.into() }.into());
    }
    // Removed when it is dropped.
    let mut copies: Option<Workplace> = None;
    let mut here = Vec::with_capacity(shards.len());
    let in_stores = |error, here: &[PathBuf]| named_as_given(error, here.iter().zip(shards));
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
        return super::merge(&here, out, existing, stop).map_err(|e| in_stores(e, &here));
    };
    // A result that was not sent is made again: its shards may be others by now.
    let local = if stored.file.exists() { Existing::Overwrite } else { existing };
    let warning =
        super::merge(&here, &stored.file, local, stop).map_err(|e| in_stores(e, &here))?;
    stored.publish(existing == Existing::Overwrite, stop)?;
    Ok(warning)
}

/// The error with the names of shards instead of their copies, which are gone by the time it is read.
fn named_as_given<'a>(
    error: MergeError,
    copies: impl Iterator<Item = (&'a PathBuf, &'a PathBuf)>,
) -> MergeError {
    if matches!(error, MergeError::Run(RunError::Interrupted)) {
        return error;
    }
    let message = error.to_string();
    let mut copied = copies.filter(|(copy, given)| copy != given).collect::<Vec<_>>();
    // `10` before `1`.
    copied.sort_by_key(|(copy, _)| std::cmp::Reverse(copy.as_os_str().len()));
    let named = copied.iter().fold(message.clone(), |message, (copy, given)| {
        message.replace(&*copy.to_string_lossy(), &given.to_string_lossy())
    });
    if named == message { error } else { MergeError::Copied(named) }
}

fn temporary(work: Option<&Path>) -> Result<Workplace, MergeError> {
    let work = work.unwrap_or(Path::new("."));
    Ok(Workplace::create(work, ".corsmal-feat-merge-").map_err(RunError::Folder)?)
}
