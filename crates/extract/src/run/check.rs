//! What a run refuses before it starts.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::feature_file::{FeatureFileError, FeatureTable};
use corsmal_files::format::{OutputFormat, require_npz};
use corsmal_files::layout::TIMES;
use corsmal_files::outcome::Outcome;
use corsmal_files::parquet::ParquetTableError;
use corsmal_files::provenance::Provenance;
use corsmal_files::{draft, identity, partition};

use super::error::RunError;
use super::options::{MAX_JOBS, RunOptions, RunReport};
use super::partitions::{PartitionBy, is_ours};
use super::stored::StoredOutput;
use crate::config::{Config, meaning};
use crate::inputs::{Identities, Input, list_hash};
use crate::ledger::{self, Ledger};

/// What is known of a run before it starts.
pub struct Checked {
    /// The output, behind any link.
    pub(super) out: PathBuf,
    pub(super) format: OutputFormat,
    pub(super) provenance: Provenance,
    /// The report of an output that is there already.
    pub(super) done: Option<RunReport>,
    /// Where the output goes when it is complete, if that is a store.
    pub(super) stored: Option<StoredOutput>,
    /// Whether it is there already.
    pub(super) is_sent: bool,
    advice: Option<String>,
}

/// Members of an `.npz` above which it is hard to use: numpy reads the names of all when it opens one.
const MANY_MEMBERS: usize = 50_000;

impl Checked {
    /// What the user should think of before a long run.
    pub fn advice(&self) -> Option<&str> {
        self.advice.as_deref()
    }
}

/// Whether another kind of output would serve better.
fn advice(inputs: usize, config: &Config, format: OutputFormat) -> Option<String> {
    let frames = config.summary.is_none() && format != OutputFormat::Parquet;
    // Each array has its times beside it.
    let members = inputs.saturating_mul(2 * config.features.len());
    (frames && members > MANY_MEMBERS).then(|| {
        format!(
            "the output will have {members} members, and archives of more than {MANY_MEMBERS} \
             open slowly: --out x.parquet writes one table, --shard i/n writes several archives"
        )
    })
}

/// Everything that a run refuses before it starts.
///
/// # Errors
/// As [`run`](super::run()), in what concerns the output, the inputs as a whole and the number of jobs.
pub fn check(
    inputs: &[Input],
    config: &Config,
    options: &RunOptions,
    stop: &Arc<AtomicBool>,
) -> Result<Checked, RunError> {
    let by = options.partition_by.as_deref();
    if let Some(label) = by {
        PartitionBy::of(label, inputs, options.shard.of(inputs))?;
    }
    let stored = StoredOutput::of(&options.out, options.work.as_deref(), by)?;
    if let (None, Some(work)) = (&stored, &options.work) {
        return Err(RunError::Work { path: options.out.clone(), work: work.clone() });
    }
    let out = stored.as_ref().map_or(&options.out, |stored| &stored.file);
    let format = check_output(out, options, config)?;
    // Without the slash that a folder may be named with.
    let out = &draft::destination(&out.components().collect::<PathBuf>());
    require_jobs(options.jobs)?;
    let is_out = |i: &&Input| {
        let same = |path: &Path| path.file_name() == out.file_name() && draft::same(path, out);
        i.source.file().is_some_and(same)
    };
    if let Some(input) = inputs.iter().find(is_out) {
        let why = format!("is the input {} itself", input.id);
        return Err(RunError::Format { path: out.clone(), why });
    }
    if config.projection.as_ref().is_some_and(|projection| draft::same(projection.file(), out)) {
        let why = "is the projection itself: give the output another name".into();
        return Err(RunError::Format { path: out.clone(), why });
    }
    let (text, hash) = (config.to_value().to_string(), config.hash());
    let provenance = Provenance::new(text, hash, list_hash(inputs), options.shard);
    if let (OutputFormat::Parquet, None) = (format, &config.summary) {
        require_other_names(inputs, &provenance.features(), out)?;
    }
    let (mut done, mut is_sent) = (None, false);
    let own = options.shard.of(inputs);
    let finished = Finished { inputs: own, provenance: &provenance, format, by };
    let is_pending = Ledger::is_pending(out);
    if options.overwrite && (options.resume || stored.is_some()) && out.exists() {
        // What did not reach its store is sent, not made again; and what an interrupted run was to replace
        // may have been replaced.
        done = finished.report(out, out, stop).ok();
    }
    if let Some(stored) = &stored
        && options.overwrite
        && options.resume
        && done.is_none()
        && let Some(copy) = stored.present(stop)?
    {
        done = finished.report(copy.place(), &PathBuf::from(stored.name()), stop).ok();
        is_sent = done.is_some();
    }
    if !options.overwrite {
        if let Some(stored) = &stored
            && let Some(copy) = stored.present(stop)?
        {
            let name = PathBuf::from(stored.name());
            done = Some(finished.report(copy.place(), &name, stop)?);
            is_sent = true;
        } else if out.exists() && !(out.is_dir() && is_ours(out) && !partition::is_partitioned(out))
        {
            done = Some(finished.report(out, out, stop).map_err(|error| match error {
                RunError::Exists { path, why } if is_pending => RunError::Replaced { path, why },
                error => error,
            })?);
        }
        if done.is_none() && !options.resume && is_pending {
            Ledger::require_idle(out)?;
            return Err(RunError::Pending { path: ledger::ledger_path(out) });
        }
    }
    // A run that is done already has nothing to be advised of.
    let advice = match done {
        Some(_) => None,
        None => advice(options.shard.of(inputs).len(), config, format),
    };
    Ok(Checked { out: out.clone(), format, provenance, done, stored, is_sent, advice })
}

/// Refuses labels that are called like the columns of frames.
fn require_other_names(inputs: &[Input], features: &[String], out: &Path) -> Result<(), RunError> {
    let taken = |label: &str| {
        features.iter().any(|f| label == f || label.strip_prefix(TIMES) == Some(f.as_str()))
    };
    let mut labels = inputs.first().into_iter().flat_map(|input| &input.labels);
    match labels.find(|(label, _)| taken(label)) {
        None => Ok(()),
        Some((label, _)) => {
            let why = format!(
                "would have two columns {label:?}, a label and frames: rename the label, or write .npz"
            );
            Err(RunError::Format { path: out.into(), why })
        }
    }
}

/// Refuses numbers of threads that cannot be.
pub(super) fn require_jobs(jobs: usize) -> Result<(), RunError> {
    match (1..=MAX_JOBS).contains(&jobs) {
        true => Ok(()),
        false => Err(RunError::Jobs { jobs, why: format!("jobs must be 1 to {MAX_JOBS}") }),
    }
}

/// The format of the output, if it can be written.
fn check_output(
    out: &Path,
    options: &RunOptions,
    config: &Config,
) -> Result<OutputFormat, RunError> {
    let refuse = |why: String| Err(RunError::Format { path: out.into(), why });
    if draft::is_device(out) {
        let why =
            "is a device; an output gets its name when it is whole: name a file, .npz or .parquet";
        return refuse(why.into());
    }
    let partitioned = options.partition_by.is_some();
    let format = match partitioned {
        false => OutputFormat::of_name(out, options.compression)?,
        true if require_npz(out).is_ok() => {
            let why = "is the name of an .npz; --partition-by writes a folder of Parquet files";
            return refuse(why.into());
        }
        true => OutputFormat::Parquet,
    };
    let complex = |config: &Config| {
        let value = config.to_value();
        let features = value["features"].as_object().into_iter().flatten();
        features.into_iter().any(|(_, feature)| feature["output"] == "complex")
    };
    if format == OutputFormat::Parquet && config.summary.is_none() && complex(config) {
        let why = "Parquet holds no complex numbers: choose another output of stft, or write .npz";
        return refuse(why.into());
    }
    if out.is_dir() && !partitioned {
        return refuse("is a folder".into());
    }
    if partitioned && out.exists() {
        // Not even --overwrite removes what is somebody else's.
        if !is_ours(out) {
            return refuse("exists and is not a partitioned output".into());
        }
    } else if out.exists() && !out.is_file() {
        return refuse("is not a regular file".into());
    }
    let target = draft::destination(out);
    let folder = draft::folder(&target);
    if !folder.is_dir() {
        return refuse(format!("there is no folder {}", folder.display()));
    }
    // A partitioned output may be named like the folder that it is.
    let place = if partitioned { target.components().collect() } else { target };
    draft::check_place(&place).map_err(RunError::Folder)?;
    Ok(format)
}

/// What an output holds that is complete.
struct Finished<'a> {
    inputs: &'a [Input],
    provenance: &'a Provenance,
    format: OutputFormat,
    by: Option<&'a str>,
}

impl Finished<'_> {
    /// The report of the complete output in `file`, which messages call `name`; an error where it holds
    /// something else.
    fn report(
        &self,
        file: &Path,
        name: &Path,
        stop: &Arc<AtomicBool>,
    ) -> Result<RunReport, RunError> {
        let refuse = |why: &str| RunError::Exists { path: name.to_path_buf(), why: why.into() };
        let opened = match self.by {
            None => FeatureTable::open(file).map(|table| (table, None)),
            Some(_) => partition::open(file).map(|(table, label)| (table, Some(label))),
        };
        let (opened, label) = opened.map_err(|error| match error {
            FeatureFileError::Io { source, .. } => refuse(&format!("cannot be read: {source}")),
            FeatureFileError::Parquet(ParquetTableError::Damaged { reason, .. }) => {
                refuse(&format!("is damaged: {reason}"))
            }
            _ => refuse("is not an output of this tool"),
        })?;
        if let Some(label) = label.filter(|label| Some(label.as_str()) != self.by) {
            return Err(refuse(&format!("is partitioned by {label}")));
        }
        let FeatureTable { table, provenance: theirs, format: found, .. } = opened;
        let (format, provenance) = (self.format, self.provenance);
        if found != format {
            return Err(refuse(&format!("is {found}, not {format}")));
        }
        // A projection that lies elsewhere is the same.
        let config = match meaning(&theirs.config) == meaning(&provenance.config) {
            true => provenance.config.clone(),
            false => theirs.config.clone(),
        };
        let theirs = Provenance { config, ..theirs };
        if theirs != *provenance {
            let why = if theirs.config_hash != provenance.config_hash {
                "holds features of another configuration"
            } else if theirs.inputs_hash != provenance.inputs_hash {
                "holds features of other inputs"
            } else if theirs.shard != provenance.shard {
                "holds another shard"
            } else {
                "was written by another version of this tool"
            };
            return Err(refuse(why));
        }
        let outcomes = table.outcomes().to_vec();
        if outcomes.iter().any(|outcome| outcome.identity == identity::STREAM) {
            let why = "holds features of a stream, which cannot be read again to compare";
            return Err(refuse(why));
        }
        let now = Identities::of(self.inputs, stop);
        let changed = |(i, outcome): &(usize, &Outcome)| outcome.identity != now.get(*i);
        let changed: Vec<&Outcome> =
            outcomes.iter().enumerate().filter(changed).map(|(_, outcome)| outcome).collect();
        if stop.load(Ordering::Relaxed) {
            return Err(RunError::Interrupted);
        }
        if outcomes.len() != self.inputs.len() || !changed.is_empty() {
            // Nothing was known of files that could not be read.
            let were_read =
                changed.is_empty() || changed.iter().any(|outcome| !outcome.identity.is_empty());
            return Err(refuse(match were_read {
                true => "holds features of files that have changed since",
                false => "has failures for files that can be read now",
            }));
        }
        Ok(RunReport { resumed: outcomes.len(), outcomes, up_to_date: true })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use corsmal_files::npz::Compression;

    #[test]
    fn many_members_are_advised_against_before_the_run() {
        let npz = OutputFormat::Npz(Compression::Stored);
        let frames = Config::preset("logmel").unwrap();
        assert_eq!(advice(25_000, &frames, npz), None);
        let said = advice(25_001, &frames, npz).unwrap();
        assert!(said.contains("50002 members") && said.contains("parquet"), "{said}");
        let summary = Config::preset("mfcc-zcr").unwrap();
        assert_eq!(advice(usize::MAX, &summary, npz), None);
    }
}
