//! `corsmal-feat classify`: recordings or features in, predictions out.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::inputs::{self, Shard};
use corsmal_extract::npz::Compression;
use corsmal_extract::outcome::Status;
use corsmal_extract::run::{self, Options, RunError};
use corsmal_models::ModelError;
use corsmal_models::model_file::{Model, ModelFileError};
use ndarray::Axis;

use crate::dataset_table::{DatasetTable, ForeignArgs};
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::progress::{LogFormat, Meter};
use crate::publish;

/// Arguments of `classify`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat classify --model type.model --in audio/ --out predictions.csv
  corsmal-feat classify --model type.model --features feats.npz --out -

One line per recording: id, path, status, predicted, and p_<label> for each class. Recordings
that could not be read have a status other than ok and no prediction.

Exit codes: 0 all fine, 1 finished with failed files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// Model file of `corsmal-feat train`.
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Recordings: files, folders, globs, manifests, or - for one WAV stream on standard input.
    #[arg(long = "in", value_name = "PATH", num_args = 1.., required_unless_present = "features")]
    inputs: Vec<String>,
    /// Features instead of recordings.
    #[arg(long, value_name = "FILE", conflicts_with = "inputs")]
    features: Option<PathBuf>,
    #[command(flatten)]
    foreign: ForeignArgs,
    /// Predictions, CSV; - for standard output.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
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

/// Predicts and writes the table.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let to_stdout = args.out == Path::new("-");
    if !to_stdout {
        publish::check(&args.out, args.overwrite)?;
    }
    let place = args.model.display();
    let model = Model::load(&args.model).map_err(|e| match e {
        e @ ModelFileError::Io { .. } => Failure::from(e),
        e => Failure::new(format!("{place}: {e}")),
    })?;
    let table = match &args.features {
        Some(path) => DatasetTable::read(path, &args.foreign)?,
        None => match extract(&args, &model, to_stdout)? {
            Some(table) => table,
            None => return Ok(ExitCode::from(INTERRUPTED)),
        },
    };
    check_features(&model, &table)?;
    let (csv, failed) = predictions(&model, &table)?;
    if to_stdout {
        match std::io::stdout().write_all(&csv) {
            // Whoever reads has seen enough.
            Err(e) if e.kind() == ErrorKind::BrokenPipe => {}
            written => written?,
        }
    } else {
        publish::write(&args.out, &csv)?;
    }
    if !args.quiet {
        eprintln!("{} predictions of {}, {failed} failed", table.ids.len(), model.header().target);
    }
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}

/// Features of the recordings by the model's own configuration; `None` when the user stopped it.
fn extract(args: &Args, model: &Model, to_stdout: bool) -> Result<Option<DatasetTable>, Failure> {
    let header = model.header();
    if header.feature_config.is_null() {
        return Err(Failure::new(format!(
            "{}: was trained on features of another program and cannot make them from recordings; \
             give --features",
            args.model.display()
        )));
    }
    let is_table = |name: &&String| {
        let extension = Path::new(name.as_str()).extension();
        extension
            .is_some_and(|e| e.eq_ignore_ascii_case("npz") || e.eq_ignore_ascii_case("parquet"))
    };
    if let Some(name) = args.inputs.iter().find(is_table) {
        return Err(Failure::new(format!("--in {name} is a feature file: give it as --features")));
    }
    let config = Arc::new(Config::from_value(header.feature_config.clone())?);
    // A configuration of another version of the tool may mean something else.
    if config.hash() != header.feature_config_hash {
        return Err(Failure::new(format!(
            "{}: its feature configuration was written by version {} and reads differently in this \
             version: extract and train again",
            args.model.display(),
            header.tool_version
        )));
    }
    let found = inputs::collect(&args.inputs)?;
    if found.is_empty() {
        let names = args.inputs.join(" ");
        return Err(Failure::new(format!("--in {names}: no recordings found")));
    }
    let folder = if to_stdout {
        tempfile::tempdir()
    } else {
        tempfile::tempdir_in(publish::folder(&args.out))
    };
    let folder = folder.map_err(|e| Failure::new(format!("temporary folder: {e}")))?;
    let cores = || std::thread::available_parallelism().map_or(1, usize::from);
    let options = Options {
        out: folder.path().join("features.npz"),
        compression: Compression::Stored,
        jobs: args.jobs.map_or_else(cores, usize::from),
        shard: Shard::default(),
        resume: false,
        overwrite: false,
        max_errors: None,
    };
    let stop = crate::interrupt::flag();
    let meter = Meter::new(LogFormat::Text);
    let result = if args.quiet {
        run::run(&found, &config, &options, &run::Quiet, stop)
    } else {
        run::run(&found, &config, &options, &meter, stop)
    };
    match result {
        Ok(_) => DatasetTable::read(&options.out, &args.foreign).map(Some),
        Err(RunError::Interrupted) => {
            eprintln!("interrupted; nothing was written");
            Ok(None)
        }
        Err(error) => Err(error.into()),
    }
}

/// Refuses features that are not those the model knows.
fn check_features(model: &Model, table: &DatasetTable) -> Result<(), Failure> {
    let place = table.path.display();
    model
        .check_configuration(&table.config_hash)
        .map_err(|e| Failure::new(format!("{place}: {e}")))?;
    if table.ids.is_empty() {
        return Ok(());
    }
    let (known, given) = (model.n_features(), table.x.ncols());
    if known != given {
        return Err(Failure::new(format!(
            "{place}: {given} features, the model was trained on {known}: another number of \
             channels?"
        )));
    }
    let names = model.header().feature_names.iter().zip(&table.feature_names);
    match names.enumerate().find(|(_, (known, given))| known != given) {
        None => Ok(()),
        Some((at, (known, given))) => Err(Failure::new(format!(
            "{place}: feature {at} is {given}, the model was trained on {known} there"
        ))),
    }
}

/// The CSV, and how many recordings have no prediction.
fn predictions(model: &Model, table: &DatasetTable) -> Result<(Vec<u8>, usize), Failure> {
    let refused: Vec<usize> = table.non_finite().iter().map(|(row, _)| *row).collect();
    let usable: Vec<usize> = (0..table.ids.len()).filter(|r| !refused.contains(r)).collect();
    let x = table.x.select(Axis(0), &usable);
    let classes = if usable.is_empty() { Vec::new() } else { model.predict(x.view())? };
    let proba = match model.predict_proba(x.view()) {
        _ if usable.is_empty() => None,
        Ok(proba) => Some(proba),
        Err(ModelError::NoProbability { .. }) => None,
        Err(e) => return Err(e.into()),
    };
    let labels = model.header().labels.names();
    let mut writer = csv::Writer::from_writer(Vec::new());
    let columns = labels.iter().map(|label| format!("p_{label}"));
    writer.write_record(
        ["id", "path", "status", "predicted"].into_iter().map(String::from).chain(columns),
    )?;
    let mut by_row = vec![None; table.ids.len()];
    usable.iter().enumerate().for_each(|(at, &row)| by_row[row] = Some(at));
    let mut failed = 0;
    let mut record = |id: &str, path: &str, status: &str, at: Option<usize>| {
        let mut fields = vec![id.to_string(), path.to_string(), status.to_string()];
        fields.push(at.map_or(String::new(), |at| labels[classes[at]].clone()));
        fields.extend((0..labels.len()).map(|class| match (at, &proba) {
            (Some(at), Some(proba)) => proba[[at, class]].to_string(),
            _ => String::new(),
        }));
        failed += usize::from(at.is_none());
        writer.write_record(&fields)
    };
    if table.outcomes.is_empty() {
        for (row, id) in table.ids.iter().enumerate() {
            let status = if by_row[row].is_some() { Status::Ok } else { Status::NonFinite };
            record(id, "", status.name(), by_row[row])?;
        }
    }
    let mut row = 0;
    for outcome in &table.outcomes {
        let mut at = None;
        let mut status = outcome.status;
        if status.has_features() {
            at = by_row[row];
            row += 1;
            if at.is_none() {
                status = Status::NonFinite;
            }
        }
        record(&outcome.id, &outcome.path, status.name(), at)?;
    }
    let csv = writer.into_inner().map_err(|e| Failure::new(e.to_string()))?;
    Ok((csv, failed))
}
