//! One prediction for each recording, from all of it.

use std::path::Path;

use corsmal_extract::inputs;
use corsmal_extract::run::{self, RunError};
use corsmal_files::draft;
use corsmal_files::outcome::Status;
use corsmal_files::provenance::Provenance;
use corsmal_files::shard::Shard;
use corsmal_models::ModelError;
use corsmal_models::model_file::Model;
use ndarray::Axis;

use super::{Args, End, configuration, delivered, recordings};
use crate::dataset_table::DatasetTable;
use crate::failure::Failure;
use crate::prediction_lines::{Line, PredictionLines};
use crate::progress::{LogFormat, Meter};

/// Extracts into memory, then predicts.
pub fn run(args: &Args, model: &Model, lines: &mut PredictionLines<'_>) -> Result<End, Failure> {
    let config = configuration(args, model)?;
    let found = recordings(args)?;
    let folder = if args.out == Path::new("-") {
        std::env::temp_dir()
    } else {
        draft::folder(&args.out).to_path_buf()
    };
    let stop = crate::interrupt::flag();
    let meter = Meter::new(LogFormat::Text, args.quiet);
    let table = match run::table(&found, &config, (args.jobs(), &folder), &meter, stop) {
        Ok(table) => table,
        Err(RunError::Interrupted) => return Ok(End::Interrupted),
        Err(error) => return Err(error.into()),
    };
    let (text, hash) = (config.to_value().to_string(), config.hash());
    let provenance = Provenance::new(text, hash, inputs::list_hash(&found), Shard::default());
    // What the recordings are called where their table is at fault.
    let place = Path::new("the recordings");
    predict(model, &DatasetTable::of_extraction(place, &table, provenance)?, lines)
}

/// Predicts the rows of a table.
pub fn predict(
    model: &Model,
    table: &DatasetTable,
    lines: &mut PredictionLines<'_>,
) -> Result<End, Failure> {
    check_features(model, table)?;
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
    let mut by_row = vec![None; table.ids.len()];
    usable.iter().enumerate().for_each(|(at, &row)| by_row[row] = Some(at));
    let mut record = |id: &str, path: &str, status: Status, at: Option<usize>| {
        delivered(lines.write(&Line {
            id,
            path,
            span: None,
            windows: 0,
            status,
            class: at.map(|at| classes[at]),
            proba: at.zip(proba.as_ref()).map(|(at, proba)| proba.row(at).to_vec()),
        }))
    };
    if table.outcomes.is_empty() {
        for (row, id) in table.ids.iter().enumerate() {
            let status = if by_row[row].is_some() { Status::Ok } else { Status::NonFinite };
            if !record(id, "", status, by_row[row])? {
                return Ok(End::Unread);
            }
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
        if !record(&outcome.id, &outcome.path, status, at)? {
            return Ok(End::Unread);
        }
    }
    Ok(End::Done)
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
