//! Predictions of a trained network.

use std::process::ExitCode;

use corsmal_files::outcome::Status;
use corsmal_models::labels::Labels;
use corsmal_models::predictions::{Record, RecordWriter, Unit};
use corsmal_nets::dataset::Dataset;
use corsmal_nets::fit;
use corsmal_nets::model::NetModel;

use super::args::Args;
use super::records::delivered;
use crate::failure::Failure;
use crate::output::Output;

/// Predicts the items of a file of the network's inputs.
pub fn run(args: &Args, model: &NetModel) -> Result<ExitCode, Failure> {
    let place = args.model.display();
    let header = &model.header;
    let Some(path) = &args.features else {
        return Err(Failure::new(format!(
            "{place}: {} was trained on inputs of another program and cannot make them from \
             recordings; give --features",
            header.network
        )));
    };
    let data = Dataset::read(path, &model.network)?;
    let proba = args.jobs.pool()?.install(|| model.predict_proba(&data.items))?;
    let labels = Labels::new(header.labels.clone())?;
    let names: Vec<String> = data.columns.iter().map(|(name, _)| name.clone()).collect();
    let columns = (names.as_slice(), header.target.as_str());
    let output = Output::open(&args.out)?;
    let form = (args.form(), Unit::Recording);
    let mut records = RecordWriter::new(output, form, &labels, columns, args.reject);
    for (row, (class, proba)) in fit::labels(&proba).into_iter().zip(&proba).enumerate() {
        let record = Record {
            id: &data.ids[row],
            path: "",
            span: None,
            windows: 0,
            status: Status::Ok,
            labels: data.columns.iter().map(|(_, values)| values[row].as_str()).collect(),
            class: Some(class),
            proba: Some(proba.clone()),
        };
        if !delivered(records.write(&record))? {
            return Ok(ExitCode::SUCCESS);
        }
    }
    let (written, rejected) = (records.written, records.rejected);
    records.finish()?.publish()?;
    if !args.quiet {
        let unknown = match rejected {
            0 => String::new(),
            n => format!(", {n} of them unknown (below {})", args.reject),
        };
        eprintln!("{written} predictions of {}{unknown}", header.target);
    }
    Ok(ExitCode::SUCCESS)
}
