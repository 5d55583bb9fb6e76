//! `corsmal-feat classify`: recordings, a live stream or features in, predictions out.

mod whole;
mod windows;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::inputs::{self, Input};
use corsmal_models::model_file::{Model, ModelFileError};

use crate::dataset_table::{DatasetTable, ForeignArgs};
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::prediction_lines::{Form, PredictionLines, Target, Unit};
use crate::publish;
use crate::voting::VoteArgs;

/// Arguments of `classify`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat classify --model type.model --in audio/ --out predictions.csv
  corsmal-feat classify --model type.model --features feats.npz --out -
  arecord -f cd -t wav | corsmal-feat classify --model type.model --in - --window 2 --hop 0.5
  corsmal-feat classify --model type.model --in audio/ --window 1 --vote majority --out votes.csv

One line per recording: id, path, status, predicted, and p_<label> for each class. Recordings
that could not be read have a status other than ok and no prediction. With --window one line per
window, with its start and end in seconds, written as soon as the window is complete; memory does
not grow with the stream.

Exit codes: 0 all fine, 1 finished with failed files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// Model file of `corsmal-feat train`, or one of `corsmal-feat benchmark`.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Recordings: files, folders, globs, manifests, or - for one WAV stream on standard input.
    #[arg(long = "in", value_name = "PATH", num_args = 1.., required_unless_present = "features")]
    inputs: Vec<String>,
    /// Features instead of recordings.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["inputs", "window"])]
    features: Option<PathBuf>,
    #[command(flatten)]
    foreign: ForeignArgs,
    /// Predict windows of so many seconds instead of whole recordings.
    #[arg(long, value_name = "SECONDS")]
    window: Option<f64>,
    /// Seconds from one window to the next; default half a window.
    #[arg(long, value_name = "SECONDS", requires = "window")]
    hop: Option<f64>,
    #[command(flatten)]
    vote: VoteArgs,
    /// File of predictions; - is standard output.
    #[arg(long, value_name = "FILE", default_value = "-")]
    out: PathBuf,
    /// Form of the predictions.
    #[arg(long, value_enum, default_value = "csv")]
    format: Form,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
    /// Worker threads; by default one for each core.
    #[arg(long, value_name = "N", env = "CORSMAL_FEAT_JOBS", value_parser = clap::value_parser!(u16).range(1..))]
    jobs: Option<u16>,
    /// Only errors on standard error.
    #[arg(long, short)]
    quiet: bool,
}

impl Args {
    fn jobs(&self) -> usize {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        self.jobs.map_or_else(cores, usize::from)
    }
}

/// How the work ended.
enum End {
    Done,
    Interrupted,
    /// Whoever reads standard output has seen enough.
    Unread,
}

/// Predicts and writes the table.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    if args.out != Path::new("-") {
        publish::check(&args.out, args.overwrite)?;
    }
    let place = args.model.display();
    let model = Model::load(&args.model).map_err(|e| match e {
        e @ ModelFileError::Io { .. } => Failure::from(e),
        e => Failure::new(format!("{place}: {e}")),
    })?;
    let labels = &model.header().labels;
    let vote = args.vote.rule(labels)?;
    let unit = match (args.window, vote) {
        (None, None) => Unit::Recording,
        (None, Some(_)) => return Err(Failure::new("--vote decides over windows: give --window")),
        (Some(_), None) => Unit::Window,
        (Some(_), Some(_)) => Unit::Vote,
    };
    let mut lines = PredictionLines::new(Target::open(&args.out)?, args.format, unit, labels);
    let end = match (&args.features, args.window) {
        (Some(path), _) => {
            let table = DatasetTable::read(path, &args.foreign)?;
            whole::predict(&model, &table, &mut lines)?
        }
        (None, None) => whole::run(&args, &model, &mut lines)?,
        (None, Some(window)) => windows::run(&args, &model, window, vote, &mut lines)?,
    };
    let (written, failed) = (lines.written, lines.failed);
    match end {
        End::Unread => return Ok(ExitCode::SUCCESS),
        End::Interrupted if written == 0 => {
            eprintln!("interrupted; nothing was written");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        End::Done | End::Interrupted => lines.finish()?,
    }
    if !args.quiet {
        let predicted = written - failed;
        eprintln!("{predicted} predictions of {}, {failed} failed", model.header().target);
    }
    Ok(match (end, failed) {
        (End::Interrupted, _) => ExitCode::from(INTERRUPTED),
        (_, 0) => ExitCode::SUCCESS,
        _ => ExitCode::from(FAILED_FILES),
    })
}

/// The model's own feature configuration.
fn configuration(args: &Args, model: &Model) -> Result<Arc<Config>, Failure> {
    let header = model.header();
    let place = args.model.display();
    if header.feature_config.is_null() {
        return Err(Failure::new(format!(
            "{place}: was trained on features of another program and cannot make them from \
             recordings; give --features"
        )));
    }
    let config = Config::from_value(header.feature_config.clone())?;
    // A configuration of another version of the tool may mean something else.
    if config.hash() != header.feature_config_hash {
        return Err(Failure::new(format!(
            "{place}: its feature configuration was written by version {} and reads differently in \
             this version: extract and train again",
            header.tool_version
        )));
    }
    Ok(Arc::new(config))
}

/// The recordings named.
fn recordings(args: &Args) -> Result<Vec<Input>, Failure> {
    let is_table = |name: &&String| {
        let extension = Path::new(name.as_str()).extension();
        extension
            .is_some_and(|e| e.eq_ignore_ascii_case("npz") || e.eq_ignore_ascii_case("parquet"))
    };
    if let Some(name) = args.inputs.iter().find(is_table) {
        return Err(Failure::new(format!("--in {name} is a feature file: give it as --features")));
    }
    let collected = inputs::collect(&args.inputs)?;
    if let Some(skipped) = collected.warning() {
        eprintln!("warning: {skipped}");
    }
    let found = collected.inputs;
    if found.is_empty() {
        let names = args.inputs.join(" ");
        return Err(Failure::new(format!("--in {names}: no recordings found")));
    }
    Ok(found)
}

/// Whether a write went through; `false` where nobody reads any more.
fn delivered(written: std::io::Result<()>) -> Result<bool, Failure> {
    match written {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(e.into()),
    }
}
