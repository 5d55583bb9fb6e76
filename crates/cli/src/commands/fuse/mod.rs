//! `corsmal-feat fuse`: one decision from several prediction files.

mod submission;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::ValueEnum;
use corsmal_ccm::predictions::ProbabilityTable;
use corsmal_models::labels::Labels;

use crate::failure::{FAILED_FILES, Failure};
use crate::prediction_lines::csv_line;
use crate::publish;
use crate::voting::VoteArgs;
use corsmal_files::draft;

/// Arguments of `fuse`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat fuse --predictions rf.csv svm.csv --weights 2,1 --out mean.csv
  corsmal-feat fuse --predictions windows.csv --vote majority --background none --least 6 \\
    --out recordings.csv
  corsmal-feat fuse --type type_rf.csv type_gru.csv --level level_rf.csv level_gru.csv \\
    --capacity capacities.csv --format 2020 --part public --out submission.csv
  corsmal-feat fuse --joint joint.csv --format 2022 --annotations ccm_train_annotation.csv \\
    --out submission.csv

Prediction files are those of `classify` and `cross-validate --predictions`, or have columns
Object,Sequence,p0,p1,… Files are averaged (--weights: one for each, in their order). --type, --level
and --joint are for recordings of the CORSMAL data set and write an official submission, -1 where
something is not estimated.

Exit codes: 0 all fine, 1 some recordings have no prediction, 2 could not run.")]
pub struct Args {
    /// Prediction files of the same recordings and classes.
    #[arg(long, value_name = "CSV", num_args = 1..)]
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
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    overwrite: bool,
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
    if args.predictions.is_empty() {
        return submission::run(&args);
    }
    args.submission.refuse_without_submission()?;
    let fused = args.fused(&args.predictions, args.weights.as_deref())?;
    let bytes = table(&fused)?;
    if to_stdout {
        print!("{}", String::from_utf8_lossy(&bytes));
    } else {
        draft::write(&args.out, &bytes)?;
    }
    let failed = fused.rows.iter().filter(|row| row.class.is_none()).count();
    eprintln!("{} recordings, {failed} without a prediction", fused.rows.len());
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}

impl Args {
    /// One table from several: windows are voted on, then files averaged.
    fn fused(
        &self,
        paths: &[PathBuf],
        weights: Option<&[f64]>,
    ) -> Result<ProbabilityTable, Failure> {
        if paths.len() > 1 || weights.is_some() {
            self.vote.refuse_background("an average of files")?;
        }
        let mut tables = Vec::with_capacity(paths.len());
        for path in paths {
            let mut table = ProbabilityTable::read(path)?;
            if let Some(rule) = self.vote.rule(&Labels::new(table.labels.clone())?)? {
                table = table.vote(|votes| rule.decide(votes))?;
            }
            tables.push(table);
        }
        match (tables.len(), weights) {
            // Votes stand as they are: their shares may have another maximum.
            (1, None) => {
                let table = tables.remove(0);
                table.check_once_each()?;
                Ok(table)
            }
            _ => Ok(ProbabilityTable::average(&tables, weights)?),
        }
    }
}

/// The fused table in the form of a prediction file.
fn table(fused: &ProbabilityTable) -> Result<Vec<u8>, Failure> {
    let columns = fused.labels.iter().map(|label| format!("p_{label}"));
    let header = fused.naming.iter().cloned().chain(["predicted".into()]).chain(columns);
    let mut bytes = csv_line(&header.collect::<Vec<_>>())?;
    for row in &fused.rows {
        let class = row.class.map_or(String::new(), |class| fused.labels[class].clone());
        let proba = (0..fused.labels.len()).map(|class| match &row.proba {
            Some(proba) => proba[class].to_string(),
            None => String::new(),
        });
        let line = row.text.iter().cloned().chain([class]).chain(proba);
        bytes.extend(csv_line(&line.collect::<Vec<_>>())?);
    }
    Ok(bytes)
}
