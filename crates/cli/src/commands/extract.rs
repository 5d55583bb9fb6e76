//! `corsmal-feat extract`: recordings in, feature tensors or tables out.

use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::cut::{WINDOW_SECONDS, WindowSpan, into_windows, name_recordings};
use corsmal_extract::inputs::InputError;
use corsmal_extract::run::{self, Progress, RunError, RunOptions};
use corsmal_extract::survey::Survey;
use corsmal_files::npz::Compression;
use corsmal_files::quote::printable_line;
use corsmal_files::shard::Shard;
use serde_json::json;

use crate::args::{Jobs, Told};
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::progress::{LogFormat, Meter};
use crate::recordings;

/// Arguments of `extract`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat extract audio/ -o feats.npz
  corsmal-feat extract audio/ -o feats.parquet --preset mfcc-zcr -j 8
  corsmal-feat extract list.csv -o table.npz --preset esc26 --window 1 --hop 0.5
  corsmal-feat extract --in list.csv --out feats.npz --config my.toml --set mfcc.n_mels=64
  corsmal-feat extract --in audio/ --out feats.npz --add mfcc --set mfcc.n_mfcc=13
  corsmal-feat extract --in test/ --out test.npz --preset spec9216-code --project pca.npz
  sox in.flac -t wav - | corsmal-feat extract --in - --out feats.npz --preset esc26

Exit codes: 0 all fine, 1 finished with failed files, 2 could not run or stopped by --strict or
--max-errors, 130 interrupted.")]
pub struct Args {
    /// Recordings: files, folders (including subfolders), globs, manifests (.csv, .jsonl), or - for a
    /// recording on standard input.
    #[arg(value_name = "PATH", required_unless_present = "named")]
    inputs: Vec<OsString>,
    /// The same as the positional arguments, and added after them.
    #[arg(long = "in", short = 'i', value_name = "PATH", num_args = 1..)]
    named: Vec<OsString>,
    /// Output: .npz or .parquet, a file or an object in a store (s3://bucket/feats.npz).
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Folder in which an output for a store is made, so that --resume can continue it; the current
    /// folder by default.
    #[arg(long, value_name = "FOLDER")]
    work: Option<PathBuf>,
    /// Write a folder of Parquet files, one per value of a label: OUT/LABEL=VALUE/part.parquet.
    #[arg(long, value_name = "LABEL")]
    partition_by: Option<String>,
    #[command(flatten)]
    config: ConfigArgs,
    #[command(flatten)]
    jobs: Jobs,
    /// Cut recordings into windows of this many seconds: each gets a row or arrays, with the id
    /// RECORDING@START, the labels of its recording, and the label `recording`. Stretches of one file
    /// in a manifest get that label, too.
    #[arg(long, value_name = "SECONDS", value_parser = window_seconds)]
    window: Option<f64>,
    /// Seconds from the start of one window to the start of the next; half a window by default.
    #[arg(long, value_name = "SECONDS", value_parser = window_seconds, requires = "window")]
    hop: Option<f64>,
    /// Process only the i-th of n parts of the inputs, counted from 0; `merge` joins the outputs.
    #[arg(long, value_name = "I/N", default_value = "0/1")]
    shard: Shard,
    /// Continue an interrupted run; with --overwrite, also one that was to replace an existing output.
    #[arg(long)]
    resume: bool,
    /// Replace an existing output and, without --resume, discard an interrupted run.
    #[arg(long)]
    overwrite: bool,
    /// Deflate the arrays of an .npz (smaller, much slower).
    #[arg(long)]
    compress: bool,
    /// Stop at the first bad file.
    #[arg(long, conflicts_with = "max_errors")]
    strict: bool,
    /// Stop after more than N bad files.
    #[arg(long, value_name = "N")]
    max_errors: Option<usize>,
    /// Check everything and list the inputs, but read and write nothing.
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    told: Told,
    /// Format of messages on standard error.
    #[arg(long, value_enum, default_value = "text")]
    log_format: LogFormat,
}

/// Where a configuration comes from.
#[derive(clap::Args)]
pub struct ConfigArgs {
    /// A configuration that comes with the tool (see `corsmal-feat presets`); without --config, the
    /// default is logmel.
    #[arg(long, value_name = "NAME", conflicts_with = "config")]
    pub preset: Option<String>,
    /// A configuration file (TOML).
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Change one key, such as melspectrogram.n_mels=64 or signal.sample_rate=16000; librosa=0.8
    /// sets everything that is needed for the numbers of librosa 0.8.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// Add a feature with its defaults (see `corsmal-feat features`), under another name if one
    /// is given.
    #[arg(long = "add", value_name = "[NAME=]FEATURE")]
    pub added: Vec<String>,
    /// Project the statistics of each recording with a file from `corsmal-feat pca`.
    #[arg(long, value_name = "FILE")]
    pub project: Option<PathBuf>,
}

impl ConfigArgs {
    /// The effective configuration; `logmel` by default.
    pub fn load(&self) -> Result<Config, Failure> {
        // Added first, so that keys of what is added can be set.
        let added = self.added.iter().map(|feature| format!("+{feature}"));
        let mut overrides: Vec<String> = added.chain(self.overrides.iter().cloned()).collect();
        if let Some(path) = &self.project {
            let path = serde_json::json!(path.display().to_string());
            overrides.push(format!("projection.file={path}"));
        }
        match &self.config {
            Some(path) => Ok(Config::load(path, &overrides)?),
            None => {
                let name = self.preset.as_deref().unwrap_or("logmel");
                let preset = corsmal_extract::config::Preset::find(name)?;
                Ok(Config::with_overrides(preset.toml, name, &overrides)?)
            }
        }
    }
}

/// Runs the extraction.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let format = args.log_format;
    match (extract(args), format) {
        (Err(failure), LogFormat::Json) => {
            let event = if failure.code() == INTERRUPTED { "interrupted" } else { "error" };
            Meter::stopped(format, event, &failure.to_string());
            Ok(ExitCode::from(failure.code()))
        }
        (result, _) => result,
    }
}

fn extract(args: Args) -> Result<ExitCode, Failure> {
    let config = Arc::new(args.config.load()?);
    let is_parquet = args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet"));
    if args.compress && (is_parquet || args.partition_by.is_some()) {
        return Err(Failure::new("--compress deflates the arrays of an .npz, not Parquet"));
    }
    let names: Vec<OsString> = args.inputs.into_iter().chain(args.named).collect();
    let meter = Meter::new(args.log_format, args.told.quiet);
    let stop = crate::interrupt::flag();
    let mut found = recordings::named(&names, |warning| meter.warning(warning))?;
    found = match args.window {
        None => name_recordings(found),
        Some(window) => {
            let span = WindowSpan { window, hop: args.hop.unwrap_or(window / 2.0) };
            config.check_for_windows()?;
            match into_windows(found, span, stop) {
                Err(error @ InputError::Stopped) => {
                    return Err(Failure::interrupted(error.to_string()));
                }
                windows => {
                    let windows = windows?;
                    windows.warnings().iter().for_each(|warning| meter.warning(warning));
                    windows.inputs
                }
            }
        }
    };
    let options = RunOptions {
        out: args.out,
        work: args.work,
        partition_by: args.partition_by,
        compression: if args.compress { Compression::Deflated } else { Compression::Stored },
        jobs: args.jobs.count(),
        shard: args.shard,
        resume: args.resume,
        overwrite: args.overwrite,
        max_errors: if args.strict { Some(0) } else { args.max_errors },
    };
    if args.dry_run {
        let checked = match run::check(&found, &config, &options, stop) {
            Err(error @ RunError::Interrupted) => {
                return Err(Failure::interrupted(error.to_string()));
            }
            checked => checked?,
        };
        if let Some(advice) = checked.advice() {
            meter.warning(advice);
        }
        let inputs = options.shard.of(&found);
        if args.told.json {
            let list: Vec<_> = inputs
                .iter()
                .map(|input| json!({ "id": input.id, "path": input.source.to_string() }))
                .collect();
            println!("{}", serde_json::to_string_pretty(&list)?);
        }
        for input in inputs.iter().filter(|_| !args.told.json) {
            let source = printable_line(&input.source.to_string());
            println!("{}\t{source}", printable_line(&input.id));
        }
        Survey::of(&found, &config, stop)
            .warnings()
            .iter()
            .for_each(|warning| meter.warning(warning));
        meter.checked(inputs.len(), &config.hash());
        return Ok(ExitCode::SUCCESS);
    }
    let again = if options.overwrite { "--overwrite --resume" } else { "--resume" };
    match run::run(&found, &config, &options, &meter, stop) {
        Ok(report) => {
            meter.finish(&report, &options.out);
            if args.told.json {
                let summary = meter.summary(&report, &options.out);
                println!("{}", serde_json::to_string_pretty(&summary)?);
            }
            Ok(if report.failed() > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
        }
        Err(RunError::Interrupted) => {
            let message = format!("interrupted; {again} continues the run");
            Meter::stopped(args.log_format, "interrupted", &message);
            Ok(ExitCode::from(INTERRUPTED))
        }
        Err(error @ RunError::TooManyErrors { .. }) => {
            let message =
                format!("{error}; repair them or allow more, then {again} continues the run");
            Err(Failure::new(message))
        }
        Err(error) => Err(error.into()),
    }
}

/// Seconds of a window or from one to the next.
fn window_seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if WINDOW_SECONDS.contains(&seconds) => Ok(seconds),
        _ => Err("expected seconds, 0.001 to 1000000".into()),
    }
}
