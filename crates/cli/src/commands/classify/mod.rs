//! `corsmal-feat classify`: recordings, a live stream or features in, predictions out.

mod args;
#[cfg(feature = "nets")]
mod network;
mod records;
mod whole;
mod windows;

use std::path::Path;
use std::process::ExitCode;

use corsmal_models::dataset::LabelledTable;
use corsmal_models::model_file::{Model, ModelFileError};

pub use args::Args;

use super::nets::is_model;
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};
use crate::output::{is_delivered, is_stdout};
use crate::publish;
use records::{End, Records};

/// Predicts and writes the table.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    if !is_stdout(&args.out) {
        publish::check_table(&args.out, args.overwrite)?;
        let recordings = args.names().iter().map(Path::new);
        let read = [args.model.as_path()].into_iter().chain(args.features.as_deref());
        publish::spare(&args.out, read.chain(recordings))?;
    }
    let place = args.model.display();
    if is_model(&args.model) {
        return with_network(&args);
    }
    let model = Model::load(&args.model).map_err(|e| match e {
        e @ ModelFileError::Io { .. } => Failure::from(e),
        e => Failure::new(format!("{place}: {e}")),
    })?;
    let vote = args.vote.rule(&model.header().labels)?;
    if vote.is_some() && args.window.is_none() {
        return Err(Failure::new(match args.features.is_some() {
            true => {
                "--vote needs --window, which takes recordings: a feature file gives one prediction a row"
            }
            false => "--vote needs --window",
        }));
    }
    if args.reject > 0.0 {
        model
            .require_probabilities()
            .map_err(|e| Failure::new(format!("{place}: --reject: {e}")))?;
    }
    if args.features.is_none() {
        args.members.refuse()?;
    }
    let (end, records) = match (&args.features, args.windowing()?) {
        (Some(path), _) => {
            let table = LabelledTable::read(path, &args.members.names())?;
            whole::of_features(&args, &model, &table)?
        }
        (None, None) => whole::run(&args, &model)?,
        (None, Some(windowing)) => windows::run(&args, &model, windowing, vote)?,
    };
    finish(&args, &model.header().target, end, records)
}

/// Publishes what was written and says how it went.
fn finish(
    args: &Args,
    target: &str,
    end: End,
    records: Option<Records>,
) -> Result<ExitCode, Failure> {
    let Some(records) = records else {
        eprintln!("interrupted; nothing was written");
        return Ok(ExitCode::from(INTERRUPTED));
    };
    let rejected = records.rejected;
    let (written, failed) = (records.written, records.failed);
    match end {
        End::Unread if failed > 0 => return Ok(ExitCode::from(FAILED_FILES)),
        End::Unread => return Ok(ExitCode::SUCCESS),
        // A table of a part of the recordings would look like a whole one.
        End::Interrupted if written == 0 || !(is_delivered(&args.out) || args.is_stream()) => {
            eprintln!("interrupted; nothing was written");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        End::Done | End::Interrupted => records.finish()?.publish()?,
    }
    if !args.quiet {
        let predictions = match written - failed {
            1 => "1 prediction".into(),
            n => format!("{n} predictions"),
        };
        let unknown = match rejected {
            0 => String::new(),
            n => format!(", {n} of them unknown (below {})", args.reject),
        };
        eprintln!("{predictions} of {target}{unknown}, {failed} failed");
    }
    Ok(match (end, failed) {
        (End::Interrupted, _) => ExitCode::from(INTERRUPTED),
        (_, 0) => ExitCode::SUCCESS,
        _ => ExitCode::from(FAILED_FILES),
    })
}

#[cfg(feature = "nets")]
fn with_network(args: &Args) -> Result<ExitCode, Failure> {
    let model = corsmal_nets::model::NetModel::load(&args.model)?;
    let (end, records) = network::run(args, &model)?;
    finish(args, &model.header.target, end, records)
}

#[cfg(not(feature = "nets"))]
fn with_network(args: &Args) -> Result<ExitCode, Failure> {
    let absent = super::nets::absent();
    Err(Failure::new(format!("{}: a trained network; {absent}", args.model.display())))
}
