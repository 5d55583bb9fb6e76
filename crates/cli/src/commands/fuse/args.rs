//! What the command line says.

use std::path::{Path, PathBuf};

use clap::ValueEnum;
use corsmal_ccm::fused;
use corsmal_ccm::predictions::RecordingPredictions;
use corsmal_models::labels::Labels;
use serde_json::json;

use crate::args::{Told, VoteArgs};
use crate::failure::Failure;
use crate::plural::plural;

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
Object,Sequence,p0,p1,… True classes, folds and labels are carried along; a label that differs
between the windows or files of one recording is left empty. Files are averaged;
--weights has one weight for each, in their order. --type, --level and --joint are for
recordings of the CORSMAL data set and write an official submission, -1 where something is not
estimated.

Exit codes: 0 all fine, 1 some recordings have no prediction, 2 could not run.")]
pub struct Args {
    /// Prediction files of the same recordings and classes.
    #[arg(value_name = "CSV", conflicts_with_all = ["kind", "level", "joint"])]
    pub(super) files: Vec<PathBuf>,
    /// The same as the positional argument.
    #[arg(long, value_name = "CSV", num_args = 1.., conflicts_with = "files")]
    pub(super) predictions: Vec<PathBuf>,
    /// Prediction files of the filling type.
    #[arg(long = "type", value_name = "CSV", num_args = 1.., conflicts_with_all = ["predictions", "joint"])]
    pub(super) kind: Vec<PathBuf>,
    /// Prediction files of the filling level.
    #[arg(long, value_name = "CSV", num_args = 1.., conflicts_with_all = ["predictions", "joint"])]
    pub(super) level: Vec<PathBuf>,
    /// Prediction files of type and level together (target joint).
    #[arg(long, value_name = "CSV", num_args = 1.., conflicts_with = "predictions")]
    pub(super) joint: Vec<PathBuf>,
    /// Weight of each file of --predictions or --joint; equal by default.
    #[arg(long, value_name = "W,…", value_delimiter = ',', allow_hyphen_values = true, conflicts_with_all = ["kind", "level"])]
    pub(super) weights: Option<Vec<f64>>,
    /// Weight of each file of --type.
    #[arg(
        long,
        value_name = "W,…",
        value_delimiter = ',',
        allow_hyphen_values = true,
        requires = "kind",
        conflicts_with_all = ["files", "predictions", "joint"]
    )]
    pub(super) type_weights: Option<Vec<f64>>,
    /// Weight of each file of --level.
    #[arg(
        long,
        value_name = "W,…",
        value_delimiter = ',',
        allow_hyphen_values = true,
        requires = "level",
        conflicts_with_all = ["files", "predictions", "joint"]
    )]
    pub(super) level_weights: Option<Vec<f64>>,
    #[command(flatten)]
    pub(super) vote: VoteArgs,
    #[command(flatten)]
    pub(super) submission: SubmissionArgs,
    /// File to write; - is standard output (not for submissions).
    #[arg(long, short, value_name = "FILE")]
    pub(super) out: PathBuf,
    /// Replace an existing output.
    #[arg(long)]
    pub(super) overwrite: bool,
    #[command(flatten)]
    pub(super) told: Told,
}

/// Form of a submission.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// Container ID, Sequence, type, level, capacity.
    #[value(name = "2020")]
    Y2020,
    /// Configuration ID and 19 more columns, with class probabilities.
    #[value(name = "2022")]
    Y2022,
}

impl Args {
    /// All tables that are read.
    pub(super) fn tables(&self) -> impl Iterator<Item = &Path> {
        let all = [&self.predictions, &self.files, &self.kind, &self.level, &self.joint];
        all.into_iter().flatten().map(PathBuf::as_path)
    }

    /// Says what was written; on standard error, since predictions may be on standard output.
    /// `lacking` is how many recordings have nothing of each kind.
    pub(super) fn tell(
        &self,
        recordings: usize,
        failed: usize,
        lacking: &[(&str, usize)],
    ) -> Result<(), Failure> {
        let out = &self.out;
        if self.told.json {
            let mut value = json!({ "out": out.display().to_string(), "recordings": recordings, "failed": failed });
            if let [_, _, ..] = lacking {
                value["without"] = lacking.iter().map(|&(what, n)| (what, n)).collect();
            }
            println!("{}", serde_json::to_string_pretty(&value)?);
        } else if !self.told.quiet {
            let each = lacking.iter().map(|(what, n)| format!("{n} without a {what}"));
            let each = each.collect::<Vec<_>>().join(", ");
            eprintln!("{}: {}, {each}", out.display(), plural(recordings, "recording"));
        }
        Ok(())
    }

    /// One table from several: windows are voted on, then files averaged.
    pub(super) fn fused(
        &self,
        paths: &[PathBuf],
        weights: Option<&[f64]>,
    ) -> Result<RecordingPredictions, Failure> {
        if paths.len() > 1 || weights.is_some() {
            self.vote.refuse_background("an average of files")?;
        }
        let rule = |labels: &[String]| {
            let rule = Labels::new(labels.to_vec()).map_err(Failure::from);
            rule.and_then(|labels| self.vote.rule(&labels)).map_err(|failure| failure.to_string())
        };
        let fused = fused::fuse(paths, rule, weights)?;
        fused.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
        Ok(fused.table)
    }
}

/// Arguments about submissions.
#[derive(clap::Args)]
pub(super) struct SubmissionArgs {
    /// Official format of the submission: 2020 by default; 2022 has class probabilities.
    #[arg(long, value_enum)]
    pub(super) format: Option<Format>,
    /// Decide type and level together: the level is empty if and only if the type is none.
    #[arg(long)]
    pub(super) feasible: bool,
    /// With --feasible: food boxes are never filled with water.
    #[arg(long, requires = "feasible")]
    pub(super) dry_boxes: bool,
    /// Capacity estimates: a table of `capacity`, whose sizes and times go into the format of 2022, or
    /// any table with fileName (id10_0000.png) and `capacity[mL]`.
    #[arg(long, value_name = "CSV")]
    pub(super) capacity: Option<PathBuf>,
    /// Write the median mass of the training containers, 15 g, for every container (2022 only).
    #[arg(long)]
    pub(super) mass_prior: bool,
    /// Official annotations of the same part: with them, recordings may be named by number or by
    /// container and sequence in every file, whatever the format; --dry-boxes needs them for numbers.
    #[arg(long, value_name = "CSV")]
    pub(super) annotations: Option<PathBuf>,
    /// Refuse a submission unless it has exactly the recordings of this part, and write them in the
    /// official order.
    #[arg(long, value_enum)]
    pub(super) part: Option<Part>,
}

/// A part of the data set.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Part {
    /// Containers 1 to 9, 684 recordings.
    Training,
    /// Containers 10 to 12, 228 recordings.
    Public,
    /// Containers 13 to 15, 228 recordings.
    Private,
}

impl SubmissionArgs {
    /// These go with --type, --level and --joint.
    pub(super) fn refuse_without_submission(&self) -> Result<(), Failure> {
        let given = [
            ("--format", self.format.is_some()),
            ("--feasible", self.feasible),
            ("--capacity", self.capacity.is_some()),
            ("--mass-prior", self.mass_prior),
            ("--annotations", self.annotations.is_some()),
            ("--part", self.part.is_some()),
        ];
        match given.iter().find(|(_, given)| *given) {
            Some((name, _)) => Err(Failure::new(format!(
                "{name} is for submissions: give --type, --level or --joint"
            ))),
            None => Ok(()),
        }
    }
}
