//! Predictions of a trained network: from recordings through its front end, from pictures, or from its inputs.

use std::path::Path;

use corsmal_extract::inputs::Input;
use corsmal_files::outcome::Status;
use corsmal_models::argmax;
use corsmal_models::labels::Labels;
use corsmal_models::predictions::{Record, Unit};
use corsmal_nets::dataset::Dataset;
use corsmal_nets::items::{Column, Items};
use corsmal_nets::model::NetModel;
use corsmal_nets::networks::{self, Definition};
use corsmal_systems::SystemError;
use corsmal_systems::listening::{Answer, Formats, Listener};
use corsmal_systems::pictures::Pictures;

use super::args::{Args, check_changes, recordings};
use super::records::{End, Records, delivered, path_of};
use crate::failure::Failure;
use crate::networks::is_inputs;
use crate::progress::repaired;
use crate::recordings::warn;

/// Predicts.
pub fn run(args: &Args, model: &NetModel) -> Result<(End, Option<Records>), Failure> {
    let labels = Labels::new(model.header.labels.clone())?;
    let vote = args.vote.rule(&labels)?;
    let is_of_pictures = networks::named(&model.header.network)
        .is_ok_and(|definition| definition.picture().is_some());
    if args.any_rate && (args.features.is_some() || is_of_pictures) {
        return Err(Failure::new("--any-rate is for recordings"));
    }
    if let Some(path) = &args.features {
        if vote.is_some() {
            return Err(Failure::new("--vote works on windows of recordings, not on --features"));
        }
        is_inputs(path)?;
        let names = args.members.names();
        let ids = names.ids.as_deref();
        let data = Dataset::read_members(path, &model.network, &names.x, ids)?;
        return of_inputs(args, model, &labels, &data);
    }
    args.members.refuse()?;
    if let Ok(definition) = networks::named(&model.header.network)
        && definition.picture().is_some()
    {
        return of_pictures(args, model, &labels, definition);
    }
    check_changes(args)?;
    let formats = if args.any_rate { Formats::Any } else { Formats::AsTrained };
    let listener = Listener::new(model, &args.overrides, formats, args.jobs.count());
    let listener = listener.map_err(|e| match e {
        e @ SystemError::TrainedOnInputs { .. } => {
            Failure::new(format!("{}: {e}", args.model.display()))
        }
        e => e.into(),
    })?;
    let windowed = args.window.is_some() || listener.takes_windows();
    let unit = match (windowed, vote) {
        (false, Some(_)) => {
            return Err(Failure::new("--vote needs --window"));
        }
        (false, None) => Unit::Recording,
        (true, None) => Unit::Window,
        (true, Some(_)) => Unit::Vote,
    };
    let windowing = args.windowing()?;
    if let Some(window) = args.window.filter(|_| !listener.takes_windows()) {
        eprintln!(
            "warning: {} was trained on whole recordings: it may do worse on windows of {window} s",
            model.header.network
        );
    }
    let found = recordings(args)?;
    let columns: Vec<String> =
        found.iter().take(1).flat_map(|f| &f.labels).map(|(column, _)| column.clone()).collect();
    let mut records = args.records(&labels, &model.header.target, unit, &columns)?;
    let stop = crate::interrupt::flag();
    let (mut unread, mut unlike, mut repairs) = (false, Vec::new(), Vec::new());
    let mut each = |input: &Input, answer: Answer| -> Result<bool, Failure> {
        repairs.push(answer.repairs.clone());
        let name = match windowing {
            None => input.id.clone(),
            Some(_) => format!("a window of {}", input.id),
        };
        unlike.extend(answer.unlike.map(|seconds| (name, seconds)));
        unread = !write(&mut records, input, answer)?;
        Ok(!unread)
    };
    let heard = match windowing {
        None => listener.recordings(&found, vote, stop, &mut each),
        Some(windowing) => listener.windows(&found, (windowing, vote), stop, &mut each),
    };
    let heard = heard?;
    if let Some(repaired) = repaired(repairs.iter()) {
        warn(&format!("recordings: {repaired}"));
    }
    for (id, loss) in listener.losses() {
        warn(&format!("{id}: truncated: {loss}"));
    }
    listener.length_warning(&unlike).iter().for_each(|warning| warn(warning));
    let end = match (heard, unread) {
        (false, _) => End::Interrupted,
        (true, true) => End::Unread,
        (true, false) => End::Done,
    };
    let nothing = matches!(end, End::Interrupted) && records.written == 0;
    Ok((end, (!nothing).then_some(records)))
}

/// Predicts the items of a file of the network's inputs.
fn of_inputs(
    args: &Args,
    model: &NetModel,
    labels: &Labels,
    data: &Dataset,
) -> Result<(End, Option<Records>), Failure> {
    let proba = args.jobs.pool()?.install(|| model.predict_proba(&data.items))?;
    let columns: Vec<String> = data.columns.iter().map(|(name, _)| name.clone()).collect();
    let mut records = args.records(labels, &model.header.target, Unit::Recording, &columns)?;
    for (row, proba) in proba.into_iter().enumerate() {
        let record = Record {
            id: &data.ids[row],
            path: "",
            span: None,
            windows: 0,
            status: Status::Ok,
            labels: data.columns.iter().map(|(_, values)| values[row].as_str()).collect(),
            class: Some(argmax(&proba)),
            proba: Some(proba),
        };
        if !delivered(records.write(&record))? {
            return Ok((End::Unread, Some(records)));
        }
    }
    Ok((End::Done, Some(records)))
}

/// Predicts pictures.
fn of_pictures(
    args: &Args,
    model: &NetModel,
    labels: &Labels,
    definition: &Definition,
) -> Result<(End, Option<Records>), Failure> {
    let [folder] = args.names() else {
        return Err(Failure::new("name one picture, or one folder of pictures"));
    };
    if args.window.is_some() || args.vote.rule(labels)?.is_some() || !args.overrides.is_empty() {
        return Err(Failure::new("--window, --vote and --set are for recordings, not pictures"));
    }
    let pool = args.jobs.pool()?;
    let stop = crate::interrupt::flag();
    let pictures = Pictures::find(definition, Path::new(folder))?;
    let mut records = args.records(labels, &model.header.target, Unit::Recording, &[])?;
    for part in pictures.parts() {
        let read = match pool.install(|| pictures.read(part, stop)) {
            Err(SystemError::Interrupted) => {
                let nothing = records.written == 0;
                return Ok((End::Interrupted, (!nothing).then_some(records)));
            }
            read => read?,
        };
        let items: Vec<&[f32]> = read.iter().filter_map(|p| p.item.as_deref().ok()).collect();
        let items = Items { columns: vec![Column::of(items)] };
        let mut proba = match items.is_empty() {
            true => Vec::new(),
            false => pool.install(|| model.predict_proba(&items))?,
        }
        .into_iter();
        for picture in &read {
            let (status, proba) = match &picture.item {
                Ok(_) => (Status::Ok, proba.next()),
                Err(reason) => {
                    eprintln!("{}: {}: {reason}", picture.id, Status::Corrupt.name());
                    (Status::Corrupt, None)
                }
            };
            let record = Record {
                id: &picture.id,
                path: &picture.path.display().to_string(),
                span: None,
                windows: 0,
                status,
                labels: Vec::new(),
                class: proba.as_deref().map(argmax),
                proba,
            };
            if !delivered(records.write(&record))? {
                return Ok((End::Unread, Some(records)));
            }
        }
    }
    Ok((End::Done, Some(records)))
}

/// Writes a line; `false` where nobody reads any more.
fn write(records: &mut Records, input: &Input, answer: Answer) -> Result<bool, Failure> {
    let Answer { span, windows, status, decision, reason, .. } = answer;
    if let Some(reason) = reason {
        eprintln!("{}: {}: {reason}", input.id, status.name());
    }
    let (class, proba) = decision.map_or((None, None), |(class, proba)| (Some(class), proba));
    let labels = input.labels.iter().map(|(_, value)| value.as_str()).collect();
    let (id, path) = (&input.id, path_of(input));
    delivered(records.write(&Record { id, path, span, windows, status, labels, class, proba }))
}
