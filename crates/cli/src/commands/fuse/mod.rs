//! `corsmal-feat fuse`: one decision from several prediction files.

mod submission;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use corsmal_ccm::predictions::{self, RecordingPredictions};
use corsmal_models::labels::Labels;

use crate::args::VoteArgs;
use crate::failure::{FAILED_FILES, Failure};
use crate::publish;
use corsmal_files::draft;

/// Arguments of `fuse`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat fuse rf.csv svm.csv --weights 2,1 -o mean.csv
  corsmal-feat fuse windows.csv --vote majority --background none --least 6 -o recordings.csv
  corsmal-feat fuse --type type_rf.csv type_gru.csv --level level_rf.csv level_gru.csv \\
    --capacity capacities.csv --format 2020 --part public --out submission.csv
  corsmal-feat fuse --joint joint.csv --format 2022 --annotations ccm_train_annotation.csv \\
    --out submission.csv

Prediction files are those of `classify` and `cross-validate --predictions`, or have columns
Object,Sequence,p0,p1,… True classes, folds and labels are carried along. Files are averaged (--weights: one for each, in their order). --type, --level
and --joint are for recordings of the CORSMAL data set and write an official submission, -1 where
something is not estimated.

Exit codes: 0 all fine, 1 some recordings have no prediction, 2 could not run.")]
pub struct Args {
    /// Prediction files of the same recordings and classes.
    #[arg(value_name = "CSV", conflicts_with_all = ["kind", "level", "joint"])]
    files: Vec<PathBuf>,
    /// The same by name.
    #[arg(long, value_name = "CSV", num_args = 1.., conflicts_with = "files")]
    predictions: Vec<PathBuf>,
    /// Prediction files of the filling type.
    #[arg(long = "type", value_name = "CSV", num_args = 1.., conflicts_with_all = ["predictions", "joint"])]
    kind: Vec<PathBuf>,
    /// Prediction files of the filling level.
    #[arg(long, value_name = "CSV", num_args = 1.., conflicts_with_all = ["predictions", "joint"])]
    level: Vec<PathBuf>,
    /// Prediction files of type and level together (target joint).
    #[arg(long, value_name = "CSV", num_args = 1.., conflicts_with = "predictions")]
    joint: Vec<PathBuf>,
    /// Weight of each file of --predictions or --joint; equal by default.
    #[arg(long, value_name = "W,…", value_delimiter = ',', conflicts_with_all = ["kind", "level"])]
    weights: Option<Vec<f64>>,
    /// Weight of each file of --type.
    #[arg(long, value_name = "W,…", value_delimiter = ',', requires = "kind")]
    type_weights: Option<Vec<f64>>,
    /// Weight of each file of --level.
    #[arg(long, value_name = "W,…", value_delimiter = ',', requires = "level")]
    level_weights: Option<Vec<f64>>,
    #[command(flatten)]
    vote: VoteArgs,
    #[command(flatten)]
    submission: submission::SubmissionArgs,
    /// File to write; - is standard output (not for submissions).
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
    /// Print nothing.
    #[arg(long, short)]
    quiet: bool,
}

/// Form of a submission.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Container ID, Sequence, type, level, capacity.
    #[value(name = "2020")]
    Y2020,
    /// Configuration ID and 19 more columns, with class probabilities.
    #[value(name = "2022")]
    Y2022,
}

/// Fuses and writes.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let to_stdout = args.out.as_os_str() == "-";
    if !to_stdout {
        publish::check(&args.out, args.overwrite)?;
    }
    let paths = if args.predictions.is_empty() { &args.files } else { &args.predictions };
    if paths.is_empty() {
        return submission::run(&args);
    }
    args.submission.refuse_without_submission()?;
    let fused = args.fused(paths, args.weights.as_deref())?;
    let bytes = fused.to_csv()?;
    if to_stdout {
        print!("{}", String::from_utf8_lossy(&bytes));
    } else {
        draft::write(&args.out, &bytes)?;
    }
    let failed = fused.without_prediction();
    if !args.quiet {
        eprintln!("{} recordings, {failed} without a prediction", fused.rows.len());
    }
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}

impl Args {
    /// One table from several: windows are voted on, then files averaged.
    fn fused(
        &self,
        paths: &[PathBuf],
        weights: Option<&[f64]>,
    ) -> Result<RecordingPredictions, Failure> {
        if paths.len() > 1 || weights.is_some() {
            self.vote.refuse_background("an average of files")?;
        }
        let mut tables = Vec::with_capacity(paths.len());
        for path in paths {
            let mut table = predictions::read(path)?;
            if let Some(rule) = self.vote.rule(&Labels::new(table.labels.clone())?)? {
                table = table.vote(rule)?;
            }
            tables.push(table);
        }
        match (tables.len(), weights) {
            // Votes stand as they are: their shares may have another maximum.
            (1, None) => {
                let table = tables.remove(0);
                table.check_once_each()?;
                Ok(table.of_recordings())
            }
            _ => Ok(RecordingPredictions::average(&tables, weights)?),
        }
    }
}
