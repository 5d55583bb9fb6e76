//! One prediction for each recording, from all of it.

use std::collections::HashMap;
use std::path::Path;

use corsmal_extract::inputs::Input;
use corsmal_extract::run::{self, RunError};
use corsmal_files::draft;
use corsmal_files::outcome::{Outcome, Status};
use corsmal_models::classifiers::Predicted;
use corsmal_models::dataset::LabelledTable;
use corsmal_models::model_file::{FormatRule, Model};
use corsmal_models::predictions::{Record, Unit};
use linfa::traits::Predict;
use ndarray::Axis;

use super::args::{Args, configuration, recordings};
use super::records::{End, Records, delivered};
use crate::configuration::difference;
use crate::failure::Failure;
use crate::output::is_stdout;
use crate::plural::plural;
use crate::progress::{LogFormat, Meter, repaired};
use crate::recordings::warn;

/// Extracts into memory, then predicts.
pub fn run(args: &Args, model: &Model) -> Result<(End, Option<Records>), Failure> {
    let config = configuration(args, model)?;
    let formats = args.rule(model, &config.to_value())?;
    let found = recordings(args)?;
    let columns: Vec<String> =
        found.iter().take(1).flat_map(|f| &f.labels).map(|(column, _)| column.clone()).collect();
    let meter = Meter::new(LogFormat::Text, args.quiet);
    let accepted = by_format(&found, &formats, &meter);
    let folder = if is_stdout(&args.out) || draft::is_device(&args.out) {
        std::env::temp_dir()
    } else {
        draft::folder(&args.out).to_path_buf()
    };
    let stop = crate::interrupt::flag();
    let (mut predictions, mut damage) = (HashMap::new(), None);
    if !accepted.is_empty() {
        let extracted = run::table(&accepted, &config, (args.jobs.count(), &folder), &meter, stop);
        let table = match extracted {
            Ok(table) => table,
            Err(RunError::Interrupted) => return Ok((End::Interrupted, None)),
            Err(error) => return Err(error.into()),
        };
        // What the recordings are called where their table is at fault.
        let place = Path::new("the recordings");
        let table = LabelledTable::of_extraction(place, &table, config.to_value(), config.hash())?;
        predictions = self::predictions(model, &table, &formats, (args, &meter))?;
        damage = repaired(table.outcomes.iter().map(|outcome| &outcome.repairs));
    }
    meter.rest();
    if let Some(repaired) = damage {
        warn(&format!("recordings: {repaired}"));
    }
    let header = model.header();
    let mut records = args.records(&header.labels, &header.target, Unit::Recording, &columns)?;
    for input in &found {
        let labels = input.labels.iter().map(|(_, value)| value.as_str()).collect();
        let path = path(input);
        // What was refused by its header is in no table.
        let refused = Answer { status: Status::Mismatch, class: None, proba: None };
        let Answer { status, class, proba } =
            predictions.remove(input.id.as_str()).unwrap_or(refused);
        let id = input.id.as_str();
        let record =
            Record { id, path: &path, span: None, windows: 0, status, labels, class, proba };
        if !delivered(records.write(&record))? {
            return Ok((End::Unread, Some(records)));
        }
    }
    Ok((End::Done, Some(records)))
}

/// Predicts the rows of a feature file.
pub fn of_features(
    args: &Args,
    model: &Model,
    table: &LabelledTable,
) -> Result<(End, Option<Records>), Failure> {
    let place = table.path.display();
    if model.check_configuration(&table.config_hash).is_err() {
        let wanted = &model.header().feature_config;
        let why = match (wanted.is_null(), table.config.is_null()) {
            (true, _) => {
                "the model does not say how its features are made (it was trained on a table of \
                 another program, or saved in Python without features=): give a table like that \
                 one, train on an output of extract, or save it with save(path, features=...)"
                    .into()
            }
            (_, true) => {
                "no configuration says how they were computed, which programs that write a \
                          table again leave out: give the output of extract, or train on a table \
                          like this one"
                    .into()
            }
            _ => difference(wanted, &table.config),
        };
        return Err(Failure::new(format!("{place}: not the features of this model: {why}")));
    }
    // Files of other programs say nothing of recordings.
    let formats = match table.outcomes.is_empty() {
        true => FormatRule::default(),
        false => args.rule(model, &table.config)?,
    };
    let meter = Meter::new(LogFormat::Text, args.quiet);
    let predictions = predictions(model, table, &formats, (args, &meter))?;
    meter.rest();
    if let Some(repaired) = repaired(table.outcomes.iter().map(|outcome| &outcome.repairs)) {
        warn(&format!("recordings: {repaired}"));
    }
    let columns: Vec<String> = table.columns().iter().map(|(name, _)| name.clone()).collect();
    let header = model.header();
    let mut records = args.records(&header.labels, &header.target, Unit::Recording, &columns)?;
    let rows: HashMap<&str, usize> =
        table.ids.iter().enumerate().map(|(row, id)| (id.as_str(), row)).collect();
    let inputs: Vec<(&str, &str, Option<&Outcome>)> = match table.outcomes.is_empty() {
        true => table.ids.iter().map(|id| (id.as_str(), "", None)).collect(),
        false => {
            let outcomes = table.outcomes.iter();
            outcomes.map(|o| (o.id.as_str(), o.path.as_str(), Some(o))).collect()
        }
    };
    for (id, path, outcome) in inputs {
        let kept = outcome.filter(|o| !o.labels.is_empty());
        let labels = match (rows.get(id), kept) {
            (Some(&row), _) => {
                table.columns().iter().map(|(_, values)| values[row].as_str()).collect()
            }
            (None, Some(outcome)) => {
                let label = |name: &String| outcome.labels.get(name).map_or("", String::as_str);
                table.columns().iter().map(|(name, _)| label(name)).collect()
            }
            (None, None) => Vec::new(),
        };
        let Answer { status, class, proba } = predictions[id].clone();
        let record = Record { id, path, span: None, windows: 0, status, labels, class, proba };
        if !delivered(records.write(&record))? {
            return Ok((End::Unread, Some(records)));
        }
    }
    Ok((End::Done, Some(records)))
}

/// What the line of a recording says.
#[derive(Clone)]
struct Answer {
    status: Status,
    class: Option<usize>,
    proba: Option<Vec<f64>>,
}

/// The recordings whose headers say that the model may be applied to them, before anything is
/// computed: one of another format must not decide how wide the table is. What cannot be opened is left
/// to the extraction.
fn by_format(found: &[Input], formats: &FormatRule, meter: &Meter) -> Vec<Input> {
    let mut accepted = Vec::new();
    for input in found {
        let header = (!input.source.comes_once())
            .then(|| input.source.open_header(crate::interrupt::flag()).ok())
            .flatten();
        let spec = header.as_ref().map(|source| source.spec());
        let channels = spec.map(|spec| u32::from(spec.channels));
        match formats.check(spec.map(|spec| spec.sample_rate), channels) {
            Ok(()) => accepted.push(input.clone()),
            Err(reason) => refuse(meter, &path(input), &reason),
        }
    }
    accepted
}

/// The prediction of each recording of a table by its id.
fn predictions(
    model: &Model,
    table: &LabelledTable,
    formats: &FormatRule,
    (args, meter): (&Args, &Meter),
) -> Result<HashMap<String, Answer>, Failure> {
    let mut found = HashMap::new();
    let none = |status| Answer { status, class: None, proba: None };
    let by_id: HashMap<&str, &Outcome> =
        table.outcomes.iter().map(|o| (o.id.as_str(), o)).collect();
    let not_finite: HashMap<usize, usize> = table.non_finite().into_iter().collect();
    let fits = table.ids.is_empty() || check_features(model, table, meter)?;
    let mut usable = Vec::new();
    for (row, id) in table.ids.iter().enumerate() {
        let outcome = by_id.get(id.as_str());
        let format = outcome.map_or(Ok(()), |o| formats.check(o.sample_rate, o.channels));
        if let Err(reason) = format {
            refuse(meter, outcome.map_or(id, |o| &o.path), &reason);
            found.insert(id.clone(), none(Status::Mismatch));
        } else if !fits {
            found.insert(id.clone(), none(Status::Mismatch));
        } else if let Some(&feature) = not_finite.get(&row) {
            let (name, value) = (table.feature_name(feature), table.x[[row, feature]]);
            meter.refused(id, &format!("non_finite: feature {name} is {value}"));
            found.insert(id.clone(), none(Status::NonFinite));
        } else {
            usable.push(row);
        }
    }
    if let Some(lengths) = model.lengths(&table.config) {
        let given = usable.iter().filter_map(|&row| {
            let outcome = by_id.get(table.ids[row].as_str())?;
            Some((outcome.id.as_str(), outcome.seconds()?))
        });
        if let Some(warning) = lengths.warning(given) {
            warn(&warning);
        }
    }
    if !usable.is_empty() {
        let x = table.x.select(Axis(0), &usable);
        let predicted: corsmal_models::Result<Predicted> =
            args.jobs.pool()?.install(|| Predict::predict(model, &x));
        let Predicted { classes, proba } = predicted?;
        for (at, &row) in usable.iter().enumerate() {
            let id = &table.ids[row];
            let status = by_id.get(id.as_str()).map_or(Status::Ok, |o| o.status);
            let proba = proba.as_ref().map(|proba| proba.row(at).to_vec());
            let prediction = Answer { status, class: Some(classes[at]), proba };
            found.insert(id.clone(), prediction);
        }
    }
    for outcome in table.outcomes.iter().filter(|o| !o.status.has_features()) {
        found.insert(outcome.id.clone(), none(outcome.status));
    }
    Ok(found)
}

/// Whether the features are those that the model knows. Rows of another width become outcome rows;
/// other names are another kind of table altogether.
fn check_features(model: &Model, table: &LabelledTable, meter: &Meter) -> Result<bool, Failure> {
    let (known, given) = (model.n_features(), table.x.ncols());
    if known != given {
        let channels = table.outcomes.iter().find_map(|o| o.channels).filter(|n| *n > 1);
        let from = channels.map_or(String::new(), |n| format!(", of {}", plural(n, "channel")));
        let is_mono = model.header().feature_names.iter().all(|name| !name.contains('/'));
        let remedy = match channels.is_some() && is_mono {
            true => "; --set signal.channels=mean mixes the channels",
            false => "",
        };
        let names = (&model.header().feature_names, &table.feature_names);
        let reason = format!(
            "gives {given} features{from}; the model was trained on {known}{}{remedy}",
            apart(names.0, names.1)
        );
        table.ids.iter().for_each(|id| refuse(meter, id, &reason));
        return Ok(false);
    }
    let wanted = &model.header().feature_names;
    if !wanted.is_empty() && table.feature_names.is_empty() {
        warn(&format!(
            "{}: it does not name its features; they must be those of the training, in the same order, \
             from {} to {}",
            table.path.display(),
            wanted[0],
            wanted[wanted.len() - 1]
        ));
    }
    let names = wanted.iter().zip(&table.feature_names);
    match names.enumerate().find(|(_, (known, given))| known != given) {
        None => Ok(true),
        Some((at, (known, given))) => Err(Failure::new(format!(
            "{}: feature {at} must be {known}, as in training, not {given}",
            table.path.display()
        ))),
    }
}

/// The first names that only one of the lists has.
fn apart(known: &[String], given: &[String]) -> String {
    let only =
        |of: &[String], other: &[String]| of.iter().find(|name| !other.contains(name)).cloned();
    match (only(known, given), only(given, known)) {
        (None, None) => String::new(),
        (Some(lacks), None) => format!("; {lacks} is missing"),
        (None, Some(has)) => format!("; {has} was not there"),
        (Some(lacks), Some(has)) => format!("; {lacks} is missing, {has} was not there"),
    }
}

/// Says why a recording has no prediction.
fn refuse(meter: &Meter, name: &str, reason: &str) {
    meter.refused(name, &format!("mismatch: {reason}"));
}

fn path(input: &Input) -> String {
    input.source.to_string()
}
