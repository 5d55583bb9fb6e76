//! What a run refuses before it starts.

use std::path::{Path, PathBuf};

use corsmal_files::feature_file::{FeatureFileError, FeatureTable};
use corsmal_files::format::OutputFormat;
use corsmal_files::provenance::Provenance;
use corsmal_files::{draft, identity};

use super::error::RunError;
use super::options::{MAX_JOBS, RunOptions, RunReport};
use crate::config::Config;
use crate::inputs::{Input, is_stored, list_hash};
use crate::ledger::{self, Ledger};

/// What is known of a run before it starts.
pub struct Checked {
    /// The output, behind any link.
    pub(super) out: PathBuf,
    pub(super) format: OutputFormat,
    pub(super) provenance: Provenance,
    /// The report of an output that is there already.
    pub(super) done: Option<RunReport>,
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
            "the output will have {members} members, and archives of more than {MANY_MEMBERS} open \
             slowly: --out x.parquet makes one table; --shard i/n makes several archives"
        )
    })
}

/// Everything that a run refuses before it starts.
///
/// # Errors
/// As [`run`](super::run()), in what concerns the output, the inputs as a whole and the number of jobs.
pub fn check(inputs: &[Input], config: &Config, options: &RunOptions) -> Result<Checked, RunError> {
    let format = check_output(options, config)?;
    let out = &draft::destination(&options.out);
    require_jobs(options.jobs)?;
    let is_out = |i: &&Input| {
        let same = |path: &Path| path.file_name() == out.file_name() && draft::same(path, out);
        i.source.file().is_some_and(same)
    };
    if let Some(input) = inputs.iter().find(is_out) {
        let why = format!("is the input {} itself", input.id);
        return Err(RunError::Format { path: out.clone(), why });
    }
    let (text, hash) = (config.to_value().to_string(), config.hash());
    let provenance = Provenance::new(text, hash, list_hash(inputs), options.shard);
    let mut done = None;
    if !options.overwrite {
        done = finished(options.shard.of(inputs), &provenance, out, format)?;
        if done.is_none() && !options.resume && Ledger::is_pending(out) {
            Ledger::require_idle(out)?;
            return Err(RunError::Pending { path: ledger::ledger_path(out) });
        }
    }
    // A run that is done already has nothing to be advised of.
    let advice = match done {
        Some(_) => None,
        None => advice(options.shard.of(inputs).len(), config, format),
    };
    Ok(Checked { out: out.clone(), format, provenance, done, advice })
}

/// Refuses numbers of threads that cannot be.
pub(super) fn require_jobs(jobs: usize) -> Result<(), RunError> {
    match (1..=MAX_JOBS).contains(&jobs) {
        true => Ok(()),
        false => Err(RunError::Jobs { jobs, why: format!("jobs must be 1 to {MAX_JOBS}") }),
    }
}

/// The format of the output, if it can be written.
fn check_output(options: &RunOptions, config: &Config) -> Result<OutputFormat, RunError> {
    let out = options.out.as_path();
    let refuse = |why: String| Err(RunError::Format { path: out.into(), why });
    if out.to_str().is_some_and(is_stored) {
        let why =
            "is in a store, and outputs are files on a disk: write it here, then copy it there";
        return refuse(why.into());
    }
    let format = OutputFormat::of_name(out, options.compression)?;
    let complex = |config: &Config| {
        let value = config.to_value();
        let features = value["features"].as_object().into_iter().flatten();
        features.into_iter().any(|(_, feature)| feature["output"] == "complex")
    };
    if format == OutputFormat::Parquet && config.summary.is_none() && complex(config) {
        let why = "Parquet holds no complex numbers: choose another output of stft, or write .npz";
        return refuse(why.into());
    }
    if out.is_dir() {
        return refuse("is a folder".into());
    }
    if out.exists() && !out.is_file() {
        return refuse("is not a regular file".into());
    }
    let target = draft::destination(out);
    let folder = draft::folder(&target);
    if !folder.is_dir() {
        return refuse(format!("there is no folder {}", folder.display()));
    }
    draft::check_place(&target).map_err(RunError::Folder)?;
    Ok(format)
}

/// The report of an output that is already complete; an error where it holds something else.
fn finished(
    inputs: &[Input],
    provenance: &Provenance,
    out: &Path,
    format: OutputFormat,
) -> Result<Option<RunReport>, RunError> {
    if !out.exists() {
        return Ok(None);
    }
    let refuse = |why: &str| RunError::Exists { path: out.to_path_buf(), why: why.into() };
    let FeatureTable { table, provenance: theirs, format: found, .. } = FeatureTable::open(out)
        .map_err(|error| match error {
            FeatureFileError::Io { source, .. } => refuse(&format!("cannot be read: {source}")),
            _ => refuse("is not an output of this tool"),
        })?;
    if found != format {
        return Err(refuse(&format!("is {found}, not {format}")));
    }
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
        return Err(refuse("holds features of a stream, which cannot be read again to compare"));
    }
    let same = outcomes.len() == inputs.len()
        && outcomes.iter().zip(inputs).all(|(o, i)| o.identity == i.source.identity());
    if !same {
        return Err(refuse("holds features of files that have changed since"));
    }
    Ok(Some(RunReport { resumed: outcomes.len(), outcomes, up_to_date: true }))
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
