//! What a network learns from: its items with their labels, from a file or from recordings.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_ccm::crop::LABEL_FILE;
use corsmal_ccm::dataset::SequenceName;
use corsmal_extract::config::Config;
use corsmal_extract::inputs::Input;
use corsmal_extract::run::Recordings;
use corsmal_files::identity;
use corsmal_files::outcome::{Outcome, Status};
use corsmal_models::dataset::{LabelSource, LabelledTable, MemberNames};
use corsmal_models::model_file::TrainedOn;
use corsmal_models::targets::Classes;
use corsmal_nets::dataset::Dataset;
use corsmal_nets::items::{Column, Items};
use corsmal_nets::networks::Definition;

use crate::error::{Result, SystemError};
use crate::pictures::{Picture, Pictures};
use crate::recordings;

/// Items of a network and the table that labels them.
pub struct Examples {
    /// the network
    pub definition: &'static Definition,
    /// a row for each recording, or each item of a file
    pub table: LabelledTable,
    pub(crate) items: Items,
    /// the row of each item: a recording may be several windows
    row_of: Vec<usize>,
    pub(crate) heard: Option<Heard>,
    /// identity of the pictures, where items were made of them
    seen: Option<String>,
}

/// How recordings became items.
pub(crate) struct Heard {
    pub config: Config,
    pub trained_on: Option<TrainedOn>,
}

impl Examples {
    /// The items of an `.npz` of the network's inputs. Where a column holds names of CCM sequences,
    /// there are the columns `type` and `level` as well.
    ///
    /// # Errors
    /// A file that the network does not take.
    pub fn of_file(
        definition: &'static Definition,
        path: &Path,
        names: &MemberNames,
    ) -> Result<Self> {
        let network = definition.build(None, 0)?;
        let read = Dataset::read_members(path, &network, &names.x, names.ids.as_deref());
        let Dataset { ids, mut columns, items } = read?;
        columns.extend(named_labels(&columns));
        let row_of = (0..ids.len()).collect();
        let table = LabelledTable::of_columns(path, ids, columns);
        Ok(Self { definition, table, items, row_of, heard: None, seen: None })
    }

    /// Recordings through the network's front end, with `jobs` threads. `path` is named in messages
    /// about them; `left_out` is told each that has no items, and why.
    ///
    /// # Errors
    /// A network that takes no recordings, or none that it takes; [`SystemError::Interrupted`] once
    /// `stop` is set.
    pub fn of_recordings(
        definition: &'static Definition,
        (path, inputs): (&Path, &[Input]),
        jobs: usize,
        stop: &Arc<AtomicBool>,
        mut left_out: impl FnMut(&Input, &str),
    ) -> Result<Self> {
        let front_end = recordings::front_end(definition)?;
        let network = definition.build(None, 0)?;
        let engine = Recordings::new(Arc::new(recordings::configuration(&front_end)?));
        let (mut heard, mut outcomes) = (Vec::new(), Vec::new());
        let (mut items, mut row_of) = (Vec::new(), Vec::new());
        for recorded in engine.in_order(inputs, jobs, stop)? {
            let recorded = recorded?;
            let (input, outcome) = (recorded.input, recorded.outcome);
            let found = match recorded.features {
                None => Err(format!("{}: {}", outcome.status, outcome.reason)),
                Some(features) => recordings::tensor(features).and_then(|tensor| {
                    front_end.items(&network, tensor).map_err(|e| e.to_string())
                }),
            };
            match found {
                Err(reason) => left_out(input, &reason),
                Ok(found) => {
                    row_of.extend(std::iter::repeat_n(heard.len(), found.len()));
                    items.extend(found);
                    heard.push(input);
                    outcomes.push(outcome);
                }
            }
        }
        if heard.is_empty() {
            return Err(SystemError::NoExamples { path: path.into() });
        }
        let ids = heard.iter().map(|input| input.id.clone()).collect();
        let trained_on = TrainedOn::of_outcomes(&outcomes);
        let mut table = LabelledTable::of_columns(path, ids, recordings::labels(&heard));
        table.outcomes = outcomes;
        let column = Column::of(items.iter().map(|item| item.values.as_slice()));
        let items = Items { columns: vec![column] };
        let heard = Some(Heard { config: engine.config().clone(), trained_on });
        Ok(Self { definition, table, items, row_of, heard, seen: None })
    }

    /// Pictures in a folder; `left_out` is told the id and the file of each that cannot be read, and why. With
    /// `own_labels` a file [`LABEL_FILE`] among them gives their label columns.
    ///
    /// # Errors
    /// As [`Pictures::find`]; more pictures than memory holds; labels of other pictures;
    /// [`SystemError::Interrupted`] once `stop` is set.
    pub fn of_pictures(
        definition: &'static Definition,
        (folder, own_labels): (&Path, bool),
        stop: &AtomicBool,
        mut left_out: impl FnMut(&str, &str, &str),
    ) -> Result<Self> {
        let pictures = Pictures::find(definition, folder)?;
        pictures.require_memory(corsmal_files::memory::available())?;
        // At once: what grows by doubling is there twice.
        let mut column = Column::with_capacity(pictures.len(), pictures.numbers());
        let (mut ids, mut outcomes) = (Vec::new(), Vec::new());
        for part in pictures.parts() {
            for Picture { id, path, identity, item } in pictures.read(part, stop)? {
                let place = path.display().to_string();
                let (status, reason) = match &item {
                    Ok(_) => (Status::Ok, String::new()),
                    Err(reason) => (Status::Corrupt, reason.clone()),
                };
                let outcome = Outcome::new(&id, &place, status, &reason);
                outcomes.push(Outcome { identity, ..outcome });
                match item {
                    Ok(item) => {
                        column.push(&item);
                        ids.push(id);
                    }
                    Err(_) => left_out(&id, &place, &reason),
                }
            }
        }
        if ids.is_empty() {
            return Err(SystemError::NoExamples { path: folder.into() });
        }
        let row_of = (0..ids.len()).collect();
        let mut table = LabelledTable::of_columns(folder, ids, Vec::new());
        table.outcomes = outcomes;
        let labels = folder.join(LABEL_FILE);
        if own_labels && labels.is_file() {
            table.add_labels(&LabelSource::File { path: labels, key: None })?;
        }
        let items = Items { columns: vec![column] };
        let all: Vec<&str> = table.outcomes.iter().map(|o| o.identity.as_str()).collect();
        let seen = Some(identity::of_bytes(all.join("\n").as_bytes()));
        Ok(Self { definition, table, items, row_of, heard: None, seen })
    }

    /// Drops the items of a file that have no value of a label column, such as recordings of test parts; how
    /// many they were.
    ///
    /// # Errors
    /// A column that is not there; [`SystemError::NoExamples`] where no item has one.
    pub fn keep_labelled(&mut self, target: &str) -> Result<usize> {
        let values = self.table.column(target)?;
        let kept: Vec<usize> = (0..values.len()).filter(|&row| !values[row].is_empty()).collect();
        let dropped = values.len() - kept.len();
        if dropped == 0 || !self.table.outcomes.is_empty() {
            return Ok(0);
        }
        if kept.is_empty() {
            return Err(SystemError::NoExamples { path: self.table.path.clone() });
        }
        let pick = |values: &[String]| kept.iter().map(|&row| values[row].clone()).collect();
        let columns =
            self.table.columns().iter().map(|(name, values)| (name.clone(), pick(values)));
        let columns = columns.collect();
        self.table = LabelledTable::of_columns(&self.table.path, pick(&self.table.ids), columns);
        self.items = self.items.pick(&kept);
        self.row_of = (0..kept.len()).collect();
        Ok(dropped)
    }

    /// Its items, one for each row unless recordings are several windows.
    pub fn items(&self) -> &Items {
        &self.items
    }

    /// What makes the items doubtful, in words: recordings of several sample rates whose features keep them.
    pub fn doubt(&self) -> Option<String> {
        let Heard { config, trained_on } = self.heard.as_ref()?;
        let mixed = trained_on.as_ref()?.mixed_rates(&config.to_value())?;
        Some(format!("{mixed}; resample them to one rate first"))
    }

    /// Whether the items were made of recordings.
    pub fn is_of_recordings(&self) -> bool {
        self.heard.is_some()
    }

    /// A fingerprint of the pictures that the items were made of.
    pub fn pictures(&self) -> Option<&str> {
        self.seen.as_deref()
    }

    /// The class of each item.
    pub(crate) fn classes(&self, classes: &Classes) -> Vec<usize> {
        self.row_of.iter().map(|&row| classes.indices()[row]).collect()
    }

    /// The value of each item's row.
    pub(crate) fn of_items(&self, values: &[String]) -> Vec<String> {
        self.row_of.iter().map(|&row| values[row].clone()).collect()
    }

    /// The items of each row.
    pub(crate) fn items_of(&self) -> Vec<Vec<usize>> {
        let mut items_of = vec![Vec::new(); self.table.ids.len()];
        self.row_of.iter().enumerate().for_each(|(item, &row)| items_of[row].push(item));
        items_of
    }
}

/// Type and level as numbers, where a column has names of CCM sequences; empty where it is empty.
fn named_labels(columns: &[(String, Vec<String>)]) -> Vec<(String, Vec<String>)> {
    let has = |name: &str| columns.iter().any(|(column, _)| column == name);
    let named = |value: &String| match value.is_empty() {
        true => Some(None),
        false => SequenceName::parse(value).map(Some),
    };
    let names = columns.iter().find(|(column, _)| column == "sequence");
    let names = names.and_then(|(_, values)| values.iter().map(named).collect::<Option<Vec<_>>>());
    let Some(names) = names.filter(|names| names.iter().any(Option::is_some)) else {
        return Vec::new();
    };
    let numbers = |of: fn(&SequenceName) -> u8| -> Vec<String> {
        names.iter().map(|n| n.as_ref().map_or(String::new(), |n| of(n).to_string())).collect()
    };
    let mut labels = Vec::new();
    if !has("type") {
        labels.push(("type".to_owned(), numbers(|name| name.filling.kind() as u8)));
    }
    if !has("level") {
        labels.push(("level".to_owned(), numbers(|name| name.filling.level() as u8)));
    }
    labels
}
