//! How to run, and what a run tells.

use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;

use corsmal_files::npz::Compression;
use corsmal_files::outcome::Outcome;
use corsmal_files::shard::Shard;

use crate::inputs::is_stored;

/// Most worker threads.
pub const MAX_JOBS: usize = 1024;

/// How to run.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// The output, `.npz` or `.parquet`: a file, or an object of a store by its URI.
    pub out: PathBuf,
    /// Folder in which an output for a store is made; by default the current one.
    pub work: Option<PathBuf>,
    /// Label by whose values the output is partitioned: a folder of Parquet files.
    pub partition_by: Option<String>,
    /// Compression of `.npz` members.
    pub compression: Compression,
    /// Worker threads, 1 to [`MAX_JOBS`].
    pub jobs: usize,
    /// Part of the inputs.
    pub shard: Shard,
    /// Continue an interrupted run, with `overwrite` also one that replaces an existing output.
    pub resume: bool,
    /// Replace an existing output and, without `resume`, forget an interrupted run.
    pub overwrite: bool,
    /// Failed files after which to stop; `None` never stops.
    pub max_errors: Option<usize>,
}

/// What happened to the inputs.
#[derive(Debug, Clone, Default)]
pub struct RunReport {
    /// One row per input, in order.
    pub outcomes: Vec<Outcome>,
    /// Inputs taken over from an interrupted run.
    pub resumed: usize,
    /// The output was complete already.
    pub up_to_date: bool,
}

impl RunReport {
    /// Inputs without features.
    pub fn failed(&self) -> usize {
        self.outcomes.iter().filter(|o| !o.status.has_features()).count()
    }
}

/// That stretches of one recording are of several contents, in words: it was replaced during the run.
pub(crate) fn mixed(outcomes: &[Outcome]) -> Option<String> {
    let mut seen: HashMap<&str, &str> = HashMap::new();
    let mut mixed = BTreeSet::new();
    for outcome in outcomes {
        let Outcome { path, identity, status, start_frame, .. } = outcome;
        // Names that are not UTF-8 look alike in an outcome.
        let is_read = status.has_features()
            && start_frame.is_some()
            && !identity.is_empty()
            && !path.contains(char::REPLACEMENT_CHARACTER);
        if is_read && *seen.entry(path).or_insert(identity) != identity {
            mixed.insert(path.as_str());
        }
    }
    let first = mixed.first()?;
    let replaced = match mixed.len() {
        1 => format!("{first} was replaced during the run: its rows come"),
        n => {
            format!("{n} recordings were replaced during the run, {first} for one: their rows come")
        }
    };
    // Whose queries no output has.
    let web = if is_stored(first) { ", or its addresses differ in their queries" } else { "" };
    Some(format!("{replaced} from different versions of the file{web}; extract again"))
}

/// Told what goes on, from several threads.
pub trait Progress: Sync {
    /// The run begins: inputs in all, and those already done.
    fn start(&self, inputs: usize, done: usize);
    /// An input is written.
    fn done(&self, outcome: &Outcome);
    /// Something the user should know, once per run.
    fn warning(&self, message: &str);
}

/// Tells nobody.
pub struct Quiet;

impl Progress for Quiet {
    fn start(&self, _: usize, _: usize) {}
    fn done(&self, _: &Outcome) {}
    fn warning(&self, _: &str) {}
}
