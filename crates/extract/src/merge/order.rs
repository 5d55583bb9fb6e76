//! The shards of one run, in their order.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use corsmal_files::feature_file::FeatureFile;
use corsmal_files::identity::{self, Stamp};
use corsmal_files::npz::NpzError;
use corsmal_files::partition;
use corsmal_files::provenance::Provenance;
use corsmal_files::quote::shown;
use corsmal_files::settings;
use corsmal_files::shard::Shard;
use serde_json::Value;

use super::error::{MergeError, go_on};
use crate::config::meaning;

/// A shard as it was found.
pub(super) struct Piece {
    pub path: PathBuf,
    pub identity: String,
    stamp: Option<Stamp>,
}

impl Piece {
    /// Takes the identity of a file before anything is read from it.
    pub fn find(path: &Path) -> Result<Self, MergeError> {
        let io = |e| NpzError::io(path, e);
        let stamp = Stamp::of_path(path).map_err(io)?;
        let identity = identity::of_file(path).map_err(io)?;
        Ok(Self { path: path.into(), identity, stamp })
    }

    /// Refuses what was read where the file is another one by now.
    pub fn require_same(&self) -> Result<(), MergeError> {
        match Stamp::of_path(&self.path) {
            Ok(now) if now == self.stamp => Ok(()),
            _ => Err(MergeError::Changed { path: self.path.clone() }),
        }
    }
}

/// Brings the shards into order, checks that they are all of one run, and says how that was made.
pub(super) fn in_order(
    shards: &[PathBuf],
    out: &Path,
    stop: &AtomicBool,
) -> Result<(Vec<Piece>, Provenance), MergeError> {
    let mut pieces = Vec::with_capacity(shards.len());
    for path in shards {
        go_on(stop)?;
        let piece = Piece::find(path)?;
        let made = FeatureFile::open(path)?.provenance()?;
        if let Some(part) = &made.part {
            // Its shard is that of the whole run, `0/1`, but its recordings are only those of one value.
            let actual = format!(
                "the part {} of a partitioned output",
                partition::folder(&part.label, &part.value)
            );
            return Err(not_one_run(path, "a shard".into(), actual));
        }
        pieces.push((piece, made));
    }
    pieces.sort_by_key(|(_, made)| made.shard.parse::<Shard>().map_or(0, |s| s.index));
    let count = pieces.len();
    let Some(first) = pieces.first().map(|(_, made)| made.clone()) else {
        return Err(not_one_run(out, "at least one shard".into(), "none".into()));
    };
    let mut ordered = Vec::with_capacity(count);
    for (index, (piece, made)) in pieces.into_iter().enumerate() {
        let path = &piece.path;
        let shard = Shard { index, count }.to_string();
        let of = made.shard.parse::<Shard>().map_or(count, |s| s.count);
        if of != count {
            return Err(not_one_run(path, format!("all {of} shards"), format!("{count}")));
        }
        if made.shard != shard {
            return Err(not_one_run(path, format!("shard {shard}"), made.shard));
        }
        let fields = |p: &Provenance| {
            [
                ("layout version", p.layout_version.to_string()),
                ("tool version", p.tool_version.clone()),
                ("configuration", p.config_hash.clone()),
                (
                    "a list of inputs (ids, paths, times, labels) with the hash",
                    p.inputs_hash.clone(),
                ),
                ("configuration text", meaning(&p.config)),
            ]
        };
        let both = fields(&first).into_iter().zip(fields(&made));
        if let Some(((field, expected), (_, found))) = both.into_iter().find(|(a, b)| a != b) {
            let keys = match field.starts_with("configuration") {
                true => keys(&first, &made),
                false => String::new(),
            };
            let found = found + &keys;
            return Err(not_one_run(path, format!("{field} {expected}"), found));
        }
        ordered.push(piece);
    }
    Ok((ordered, Provenance { shard: Shard::default().to_string(), ..first }))
}

/// The first keys of the configuration that differ.
fn keys(expected: &Provenance, found: &Provenance) -> String {
    const NAMED: usize = 3;
    let differing = settings::differing(&expected.config, &found.config);
    let text = |value: &Option<Value>| value.as_ref().map_or("absent".into(), Value::to_string);
    let named: Vec<String> = differing
        .iter()
        .take(NAMED)
        .map(|s| shown(&format!("{}: expected {}, found {}", s.key, text(&s.a), text(&s.b))))
        .collect();
    match (differing.len(), differing.len().saturating_sub(NAMED)) {
        (0, _) => String::new(),
        (_, 0) => format!(" ({})", named.join("; ")),
        (_, more) => format!(" ({}; and {more} more)", named.join("; ")),
    }
}

pub(super) fn not_one_run(path: &Path, expected: String, actual: String) -> MergeError {
    MergeError::NotOneRun { path: path.into(), expected, actual }
}
