//! What the command line says.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::engine::Windowing;
use corsmal_extract::inputs::Input;
use corsmal_files::format::Content;
use corsmal_models::labels::Labels;
use corsmal_models::model_file::{FormatRule, Model};
use corsmal_models::predictions::{Form, UNKNOWN, Unit};
use corsmal_models::voting::VotingRule;

use super::records::Records;
use crate::args::{Jobs, MemberArgs, VoteArgs};
use crate::failure::Failure;
use crate::output::Output;

/// Arguments of `classify`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat classify -m type.model audio/ -o predictions.csv
  corsmal-feat classify --model type.model --features feats.npz --out -
  corsmal-feat classify -m type.model audio/ --reject 0.6 -o predictions.csv
  arecord -f S16_LE -r 44100 -c 1 -t wav | corsmal-feat classify -m type.model - --window 2 --hop 0.5
  corsmal-feat classify --model type.model --in audio/ --window 1 --vote majority --out votes.csv

One line per recording: id, path, status, label columns of a manifest (the one that the model
predicts is called true), predicted, and p_<label> for each class. Recordings that could not be
read, or differ in sample rate or channels from those that the model was trained on (where its
features depend on that), have a status other than ok and no prediction. With --window there is one line per window, with its start
and end in seconds, written as soon as the window is complete; memory does not grow with the stream.

A network of `train --net` that takes windows, such as m4-type, gives one line per window, or one
decision with --vote; a network trained on whole recordings works best without --window.

Exit codes: 0 all fine, 1 finished with failed files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// Model file from `corsmal-feat train` or `corsmal-feat benchmark`.
    #[arg(long, short, value_name = "FILE")]
    pub(super) model: PathBuf,
    /// Recordings: files, folders, globs, manifests, or - for one on standard input. For a
    /// network that takes pictures, a folder of them.
    #[arg(value_name = "PATH", required_unless_present_any = ["features", "inputs"])]
    pub(super) paths: Vec<String>,
    /// The same as the positional argument.
    #[arg(long = "in", short = 'i', value_name = "PATH", num_args = 1.., conflicts_with = "paths")]
    pub(super) inputs: Vec<String>,
    /// Features instead of recordings.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["paths", "inputs", "window"])]
    pub(super) features: Option<PathBuf>,
    #[command(flatten)]
    pub(super) members: MemberArgs,
    /// Bring recordings to the format that the model was trained on: signal.sample_rate=44100
    /// resamples them, signal.channels=mean mixes their channels.
    #[arg(long = "set", value_name = "KEY=VALUE", conflicts_with = "features")]
    pub(super) overrides: Vec<String>,
    /// Take recordings of any sample rate as they are, whatever the model was trained on; another
    /// number of channels only where the number of features stays the same.
    #[arg(long)]
    pub(super) any_rate: bool,
    /// Call predictions unknown if their highest probability is below P.
    #[arg(long, value_name = "P", default_value_t = 0.0, value_parser = crate::args::share)]
    pub(super) reject: f64,
    /// Predict windows of this many seconds instead of whole recordings.
    #[arg(long, value_name = "SECONDS")]
    pub(super) window: Option<f64>,
    /// Seconds from the start of one window to the start of the next; half a window by default.
    #[arg(long, value_name = "SECONDS", requires = "window", conflicts_with = "features")]
    pub(super) hop: Option<f64>,
    #[command(flatten)]
    pub(super) vote: VoteArgs,
    /// Prediction file to write; - is standard output.
    #[arg(long, short, value_name = "FILE", default_value = "-")]
    pub(super) out: PathBuf,
    /// Format of the predictions.
    #[arg(long, value_enum, default_value = "csv")]
    pub(super) format: Format,
    /// The same as --format jsonl: one JSON object per line.
    #[arg(long, conflicts_with = "format")]
    pub(super) json: bool,
    /// Replace an existing output.
    #[arg(long)]
    pub(super) overwrite: bool,
    #[command(flatten)]
    pub(super) jobs: Jobs,
    /// Print only warnings and errors.
    #[arg(long, short)]
    pub(super) quiet: bool,
}

/// How lines are written.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Format {
    /// A header, then one line per prediction.
    Csv,
    /// One JSON object per line.
    #[value(alias = "json")]
    Jsonl,
}

impl Args {
    pub(super) fn form(&self) -> Form {
        if self.json || self.format == Format::Jsonl { Form::JsonLines } else { Form::Csv }
    }

    /// Recordings or pictures, however they were named.
    pub(super) fn names(&self) -> &[String] {
        if self.paths.is_empty() { &self.inputs } else { &self.paths }
    }

    /// Whether the only recording is a stream, which may never end by itself.
    pub(super) fn is_stream(&self) -> bool {
        let is_open = |path: &Path| path.metadata().is_ok_and(|m| !m.is_file() && !m.is_dir());
        matches!(self.names(), [only] if only == "-" || is_open(Path::new(only)))
    }

    /// A writer for records about `unit`s with these label columns.
    pub(super) fn records(
        &self,
        labels: &Labels,
        target: &str,
        unit: Unit,
        columns: &[String],
    ) -> Result<Records, Failure> {
        if self.reject > 0.0 && labels.names().iter().any(|name| name == UNKNOWN) {
            return Err(Failure::new(format!(
                "--reject calls predictions {UNKNOWN:?}, but the model has a class of that name"
            )));
        }
        let output = Output::open(&self.out)?;
        Ok(Records::new(output, (self.form(), unit), labels, (columns, target), self.reject))
    }

    /// Length and distance of windows, where they are wanted.
    pub(super) fn windowing(&self) -> Result<Option<Windowing>, Failure> {
        let Some(window) = self.window else { return Ok(None) };
        let hop = self.hop.unwrap_or(window / 2.0);
        let windowing = Windowing::new(window, hop).ok_or_else(|| {
            Failure::new(format!(
                "--window and --hop must be 0.01 to 600 seconds, not {window} and {hop}"
            ))
        })?;
        Ok(Some(windowing))
    }

    /// What a line of a classifier's predictions is about.
    pub(super) fn unit(&self, vote: Option<VotingRule>) -> Unit {
        match (self.window, vote) {
            (None, _) => Unit::Recording,
            (Some(_), None) => Unit::Window,
            (Some(_), Some(_)) => Unit::Vote,
        }
    }

    /// Which recordings the model may be applied to.
    pub(super) fn rule(
        &self,
        model: &Model,
        config: &serde_json::Value,
    ) -> Result<FormatRule, Failure> {
        if self.any_rate {
            return Ok(model.format_rule_of_any_rate(config));
        }
        let place = self.model.display();
        model.format_rule(config).map_err(|e| Failure::new(format!("{place}: {e}")))
    }
}

/// The model's own feature configuration.
pub(super) fn configuration(args: &Args, model: &Model) -> Result<Arc<Config>, Failure> {
    let header = model.header();
    let place = args.model.display();
    if header.feature_config.is_null() {
        return Err(Failure::new(format!(
            "{place}: does not say how its features are made (it was trained on a table of another \
             program, or saved in Python without features=): give --features with a table like \
             that one"
        )));
    }
    let config = Config::from_value(header.feature_config.clone())?;
    // A configuration of another version of the tool may mean something else.
    if config.hash() != header.feature_config_hash {
        return Err(Failure::new(format!(
            "{place}: its feature configuration was written by version {}; this version computes other \
             features from it: extract and train again",
            header.tool_version
        )));
    }
    check_changes(args)?;
    Ok(Arc::new(Config::from_tree(header.feature_config.clone(), &args.overrides)?))
}

/// Refuses --set of anything but the recordings' format.
pub(super) fn check_changes(args: &Args) -> Result<(), Failure> {
    const FORMAT: [&str; 2] = ["signal.sample_rate", "signal.channels"];
    let key = |text: &String| text.split('=').next().unwrap_or_default().trim().to_string();
    if let Some(other) = args.overrides.iter().find(|text| !FORMAT.contains(&key(text).as_str())) {
        return Err(Failure::new(format!(
            "--set {other}: the model's features are fixed; only signal.sample_rate and \
             signal.channels may bring recordings to the format that it was trained on"
        )));
    }
    Ok(())
}

/// The recordings named.
pub(super) fn recordings(args: &Args) -> Result<Vec<Input>, Failure> {
    let is_table = |name: &&String| {
        let path = Path::new(name.as_str());
        let holds = |content| matches!(content, Content::Npz | Content::Parquet);
        path.is_file() && Content::of(path).is_ok_and(holds)
    };
    if let Some(name) = args.names().iter().find(is_table) {
        return Err(Failure::new(format!("{name} is a feature file: give it as --features")));
    }
    crate::recordings::named(args.names(), crate::recordings::warn)
}
