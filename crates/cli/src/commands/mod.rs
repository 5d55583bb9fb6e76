//! One file per command: its arguments (`Args`) and what it does (`run`).

mod benchmark;
mod capacity;
mod classifiers;
mod classify;
mod compare;
mod compare_predictions;
mod completions;
mod crops;
mod cross_validate;
mod dataset;
mod demo;
mod detect;
mod embed;
mod evaluate;
mod extract;
mod features;
mod fuse;
mod inspect;
mod merge;
mod nets;
mod pca;
mod presets;
mod score;
mod synth;
mod train;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};

use crate::failure::Failure;

/// Features of multi-channel recordings, classifiers, and the CORSMAL benchmark.
#[derive(Parser)]
#[command(name = "corsmal-feat", version, about, propagate_version = true)]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

impl Cli {
    /// Runs the command to its exit code.
    pub fn run(self) -> Result<ExitCode, Failure> {
        self.command.run()
    }
}

/// Runs a command given as words, without the name of the program.
fn run_words(words: &[&str]) -> Result<ExitCode, Failure> {
    let words = std::iter::once("corsmal-feat").chain(words.iter().copied());
    Cli::try_parse_from(words).map_err(|e| Failure::new(e.to_string()))?.run()
}

/// Registration: a command is its file, a variant here and a line in `run`.
#[derive(Subcommand)]
enum Command {
    /// Extract features of recordings into tensors or tables.
    Extract(extract::Args),
    /// Join the outputs of all shards of a run.
    Merge(merge::Args),
    /// List and explain the configurations that come with the tool.
    Presets(presets::Args),
    /// List the features that a configuration can name.
    Features(features::Args),
    /// Show format and health of a recording, with a picture on request, or the content of another file.
    Inspect(inspect::Args),
    /// Show how two feature files differ, and the likely causes.
    Compare(compare::Args),
    /// Show the whole workflow on synthetic recordings.
    Demo(demo::Args),
    /// List and explain the networks.
    Nets(nets::Args),
    /// Fit principal components to training features, for `extract --project`.
    Pca(pca::Args),
    /// List the classifiers and explain their parameters.
    Classifiers(classifiers::Args),
    /// Train a classifier on features with labels and write it to a model file.
    Train(train::Args),
    /// Predict the classes of recordings, or of features, with a trained model.
    Classify(classify::Args),
    /// Score a classifier on rows that it was not trained on.
    CrossValidate(cross_validate::Args),
    /// Score predictions against true classes or numbers.
    Score(score::Args),
    /// Test whether two classifiers differ on the same held-out recordings.
    ComparePredictions(compare_predictions::Args),
    /// Combine predictions of several files, of windows, or of type and level.
    Fuse(fuse::Args),
    /// Compute embeddings of recordings, such as VGGish's 128 numbers per second.
    Embed(embed::Args),
    /// Run the paper's audio baselines and systems on a CCM data set and write the report.
    Benchmark(benchmark::Args),
    /// Estimate capacities of containers from the views of a CORSMAL data set.
    Capacity(capacity::Args),
    /// Crop the containers in the last frames of a CORSMAL data set, as pictures with labels.
    Crops(crops::Args),
    /// Find objects in the frames of a CORSMAL data set with an ONNX model, as tables and masks.
    Detect(detect::Args),
    /// Print shell completions or the man page.
    Completions(completions::Args),
    /// Check a CORSMAL data set on disk.
    Dataset(dataset::Args),
    /// Score CORSMAL submissions with the paper's or the official evaluators' rules.
    Evaluate(evaluate::Args),
    /// Make synthetic recordings in the layout of the CCM data set (demonstration and tests only).
    Synth(synth::Args),
}

impl Command {
    fn run(self) -> Result<ExitCode, Failure> {
        match self {
            Self::Extract(args) => extract::run(args),
            Self::Merge(args) => merge::run(args),
            Self::Presets(args) => presets::run(args),
            Self::Features(args) => features::run(args),
            Self::Inspect(args) => inspect::run(args),
            Self::Compare(args) => compare::run(args),
            Self::Demo(args) => demo::run(args, &run_words),
            Self::Nets(args) => nets::run(args),
            Self::Embed(args) => embed::run(args),
            Self::Pca(args) => pca::run(args),
            Self::Classifiers(args) => classifiers::run(args),
            Self::Score(args) => score::run(args),
            Self::Train(args) => train::run(args),
            Self::Classify(args) => classify::run(args),
            Self::CrossValidate(args) => cross_validate::run(args),
            Self::ComparePredictions(args) => compare_predictions::run(args),
            Self::Fuse(args) => fuse::run(args),
            Self::Benchmark(args) => benchmark::run(args),
            Self::Capacity(args) => capacity::run(args),
            Self::Crops(args) => crops::run(args),
            Self::Detect(args) => detect::run(args),
            Self::Completions(args) => completions::run(args, Cli::command()),
            Self::Dataset(args) => dataset::run(args),
            Self::Evaluate(args) => evaluate::run(args),
            Self::Synth(args) => synth::run(args),
        }
    }
}
