//! Features of recordings with labels.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use corsmal_files::outcome::Outcome;
use corsmal_files::quote::quoted;
use corsmal_files::spelling;
use corsmal_files::table::{ID_NAMES, Table};
use linfa::DatasetBase;
use ndarray::{Array2, ArrayView2};
use serde_json::Value;

use super::error::{DatasetError, Result};
use super::ids::not_an_id;
use super::label_file::{LabelFile, LabelSource};
use crate::formats::TrainedOn;
use crate::labels::{Labels, require_few};
use crate::targets::Classes;

/// What the column `joint` is put together from, where there is no such column.
const JOINT: [&str; 2] = ["type", "level"];

/// A feature file in memory.
#[derive(Clone, Debug)]
pub struct LabelledTable {
    /// the file
    pub path: PathBuf,
    /// `[rows, features]`
    pub x: Array2<f64>,
    /// name of each feature; empty when the file has none
    pub feature_names: Vec<String>,
    /// one per row, all different
    pub ids: Vec<String>,
    /// one per input of the extraction, failed ones included; empty for files of other programs
    pub outcomes: Vec<Outcome>,
    /// feature configuration; null for files of other programs
    pub config: Value,
    /// its hash; empty for files of other programs
    pub config_hash: String,
    pub(super) columns: Vec<(String, Vec<String>)>,
    /// members of files of other programs that cannot be read, and why
    pub(super) unread: Vec<(String, String)>,
    /// whether the ids are only the numbers of the rows
    pub(crate) numbered: bool,
    /// label columns of other files, with these
    pub(super) added: Vec<(String, PathBuf)>,
    /// labels that no recording of the table has, if there are such
    pub unmatched: Option<String>,
}

impl LabelledTable {
    /// A table of label columns alone, for items that are no rows of numbers.
    pub fn of_columns(path: &Path, ids: Vec<String>, columns: Vec<(String, Vec<String>)>) -> Self {
        Self {
            path: path.into(),
            x: Array2::zeros((ids.len(), 0)),
            feature_names: Vec::new(),
            ids,
            outcomes: Vec::new(),
            config: Value::Null,
            config_hash: String::new(),
            columns,
            unread: Vec::new(),
            numbered: false,
            added: Vec::new(),
            unmatched: None,
        }
    }

    /// The table of an extraction; `path` is named in messages about it.
    ///
    /// # Errors
    /// [`DatasetError::Content`] for a table without statistics.
    pub fn of_extraction(
        path: &Path,
        table: &Table,
        config: Value,
        config_hash: String,
    ) -> Result<Self> {
        if table.feature_names().is_empty() && !table.ids().is_empty() {
            return Err(DatasetError::content(
                path,
                "has frame-level features only; extract with a configuration that has a \
                 [summary], such as --preset esc26",
            ));
        }
        Ok(Self {
            path: path.into(),
            x: table.values().mapv(f64::from),
            feature_names: table.feature_names().to_vec(),
            ids: table.ids().to_vec(),
            outcomes: table.outcomes().to_vec(),
            config,
            config_hash,
            columns: table.labels().map(|(name, c)| (name.to_string(), c.to_vec())).collect(),
            unread: Vec::new(),
            numbered: false,
            added: Vec::new(),
            unmatched: None,
        })
    }

    /// Refuses a table without rows or with values that cannot be learned from.
    ///
    /// # Errors
    /// [`DatasetError::Content`] naming the recording and the feature.
    pub fn check(&self) -> Result<()> {
        let fault = |reason: String| Err(DatasetError::content(&self.path, reason));
        if self.ids.is_empty() {
            return fault("has no recordings with features".into());
        }
        if let Some(&(row, feature)) = self.non_finite().first() {
            let (id, name) = (&self.ids[row], self.feature_name(feature));
            let (value, count) = (self.x[[row, feature]], self.non_finite().len());
            let rows = if count == 1 { "1 row is" } else { &format!("{count} rows are") };
            return fault(format!("{id}: feature {name} is {value} ({rows} not finite)"));
        }
        Ok(())
    }

    /// Adds labels from a source. Gives the names of columns that were there and are now hidden.
    ///
    /// # Errors
    /// [`DatasetError::Content`] for recordings without labels.
    pub fn add_labels(&mut self, source: &LabelSource) -> Result<Vec<String>> {
        let columns = match source {
            LabelSource::Folders { column } => vec![(column.clone(), self.folders()?)],
            LabelSource::File { path, key } => {
                if let Some(why) = self.unsure_ids() {
                    return Err(DatasetError::content(
                        &self.path,
                        format!(
                            "its rows are only numbered, so labels could go to the wrong rows: {why}; \
                             --ids names a member with another value in each row"
                        ),
                    ));
                }
                let file = LabelFile::read(path, key.as_deref())?;
                // `39.wav` is not the row 39.
                if let Some(name) = file.other_than_numbers().filter(|_| self.numbered) {
                    return Err(DatasetError::content(
                        &self.path,
                        format!(
                            "its rows are only numbered, and {} names recordings, such as {}: --ids names the ids",
                            path.display(),
                            quoted(name)
                        ),
                    ));
                }
                let pairs = |with_features: bool| -> Vec<(&str, &str)> {
                    let of = |o: &&Outcome| o.status.has_features() == with_features;
                    let wanted = self.outcomes.iter().filter(of);
                    wanted.map(|o| (o.id.as_str(), o.path.as_str())).collect()
                };
                let recordings = if self.outcomes.is_empty() {
                    self.ids.iter().map(|id| (id.as_str(), id.as_str())).collect()
                } else {
                    pairs(true)
                };
                let (columns, unmatched) =
                    file.for_recordings(&recordings, &pairs(false), &self.path)?;
                self.unmatched = unmatched;
                columns
            }
        };
        let there = |name: &&String| self.columns.iter().any(|(column, _)| column == *name);
        let hidden = columns.iter().map(|(name, _)| name).filter(there).cloned().collect();
        if let LabelSource::File { path, .. } = source {
            let added = columns.iter().map(|(name, _)| (name.clone(), path.clone()));
            self.added.splice(0..0, added);
        }
        self.columns.splice(0..0, columns);
        Ok(hidden)
    }

    /// The column of ids that some rows share or lack, where rows are numbered instead.
    pub(crate) fn shared_ids(&self) -> Option<&'static str> {
        let is_there = |name: &&str| self.columns.iter().any(|(column, _)| column == name);
        ID_NAMES.into_iter().filter(|_| self.numbered).find(is_there)
    }

    /// Why what looks like ids is none, where rows are numbered instead.
    fn unsure_ids(&self) -> Option<String> {
        if !self.numbered {
            return None;
        }
        let of = |name: &str| {
            let column = self.columns.iter().find(|(column, _)| column == name);
            let repeated = column.and_then(|(_, values)| not_an_id(values));
            let unread = self.unread.iter().find(|(member, _)| member == name);
            repeated.or_else(|| unread.map(|(_, why)| why.clone()))
        };
        ID_NAMES.into_iter().find_map(|name| Some(format!("member {name:?}: {}", of(name)?)))
    }

    /// The folder in which each recording lies.
    fn folders(&self) -> Result<Vec<String>> {
        let paths = self.outcomes.iter().filter(|o| o.status.has_features());
        let folder = |path: &str| {
            let folder = Path::new(path).parent().and_then(Path::file_name);
            folder.and_then(|name| name.to_str()).map(String::from)
        };
        let found: Option<Vec<String>> = paths.map(|o| folder(&o.path)).collect();
        found.filter(|found| found.len() == self.ids.len()).ok_or_else(|| {
            DatasetError::content(
                &self.path,
                "its recordings are not in folders that could be classes; give --labels a CSV",
            )
        })
    }

    /// Label columns by name, one value per row.
    pub fn columns(&self) -> &[(String, Vec<String>)] {
        &self.columns
    }

    /// Members of files of other programs that are no label columns, and why.
    pub fn unread(&self) -> &[(String, String)] {
        &self.unread
    }

    /// A label column as text, one value per row. `joint` is type and level together where there is
    /// no such column.
    ///
    /// # Errors
    /// [`DatasetError::Content`] listing the columns that there are.
    pub fn column(&self, name: &str) -> Result<Vec<String>> {
        let find = |name: &str| self.columns.iter().find(|(column, _)| column == name);
        if let Some((_, values)) = find(name) {
            return Ok(values.clone());
        }
        if name == "recording"
            && let Some(paths) = self.shared_paths()
        {
            return Ok(paths);
        }
        if let [kind, level] = self.parts_of(name)
            && let (Some((_, kind)), Some((_, level))) = (find(kind), find(level))
        {
            let joint = |(t, l): (&String, &String)| match t.is_empty() || l.is_empty() {
                true => String::new(),
                false => format!("{t}-{l}"),
            };
            return Ok(kind.iter().zip(level).map(joint).collect());
        }
        if let Some((_, why)) = self.unread.iter().find(|(member, _)| member == name) {
            return Err(DatasetError::content(&self.path, format!("member {name:?}: {why}")));
        }
        let known = self.columns.iter().map(|(name, _)| name.as_str());
        let choices = match self.columns.is_empty() {
            true => "there are none; --labels adds them from a CSV or from class folders".into(),
            false => corsmal_names::choices(name, known),
        };
        Err(DatasetError::content(&self.path, format!("no label column {name:?}: {choices}")))
    }

    /// The columns that one is put together from, none where it is a column itself.
    fn parts_of(&self, name: &str) -> &'static [&'static str] {
        let has = |name: &str| self.columns.iter().any(|(column, _)| column == name);
        match name == "joint" && !has(name) && JOINT.into_iter().all(has) {
            true => &JOINT,
            false => &[],
        }
    }

    /// The file that a label column comes from; for one put together, the label file of a part.
    fn file_of(&self, name: &str) -> &Path {
        let of = |name: &str| self.added.iter().find(|(column, _)| column == name);
        let added = of(name).or_else(|| self.parts_of(name).iter().find_map(|part| of(part)));
        added.map_or(&self.path, |(_, path)| path)
    }

    /// The part without a value in a row of a column that is put together, else the column.
    fn empty_part<'n>(&self, name: &'n str, row: usize) -> &'n str {
        let empty = |part: &str| {
            let column = self.columns.iter().find(|(column, _)| column == part);
            column.is_some_and(|(_, values)| values[row].is_empty())
        };
        self.parts_of(name).iter().copied().find(|part| empty(part)).unwrap_or(name)
    }

    /// The classes of a label column. Empty and decimal values are no labels.
    ///
    /// # Errors
    /// [`DatasetError::Content`] naming the recording, or fewer than two classes.
    pub fn classes(&self, name: &str) -> Result<(Labels, Classes)> {
        let values = self.column(name)?;
        for (row, (id, value)) in self.ids.iter().zip(&values).enumerate() {
            let mut name = name;
            let why = if value.is_empty() {
                name = self.empty_part(name, row);
                "is empty: give it a value, or leave the recording out"
            } else if value.parse::<f64>().is_ok() && value.parse::<i128>().is_err() {
                "is a decimal number, and no classifier learns numbers (classes are names or whole numbers): fit a regression on \
                 corsmal_feat.load_features(FILE).summary in Python; score measures its estimates. If it is a name, such as \
                 the code \"1e5\" of a machine, put a letter before it"
            } else {
                continue;
            };
            let reason = format!("{id}: label {name} = {value:?} {why}");
            return Err(DatasetError::content(self.file_of(name), reason));
        }
        let (labels, indices) = Labels::of(&values);
        if labels.len() < 2 {
            let only = labels.names().join(", ");
            let reason = format!("all rows have {name} = {only}; at least 2 classes are needed");
            return Err(DatasetError::content(self.file_of(name), reason));
        }
        require_few(labels.len()).map_err(|e| {
            DatasetError::content(self.file_of(name), format!("label column {name}: {e}"))
        })?;
        let classes = Classes::new(indices, labels.len())?;
        Ok((labels, classes))
    }

    /// linfa's data set of these rows with some targets.
    pub fn dataset(&self, classes: Classes) -> DatasetBase<ArrayView2<'_, f64>, Classes> {
        DatasetBase::new(self.x.view(), classes).with_feature_names(self.feature_names.clone())
    }

    /// What the rows were made from, for a model to know; `None` for files of other programs.
    pub fn trained_on(&self) -> Option<TrainedOn> {
        TrainedOn::of_outcomes(&self.outcomes)
    }

    /// The path of each row where some rows are stretches of one file.
    fn shared_paths(&self) -> Option<Vec<String>> {
        let path_of: HashMap<&str, &str> =
            self.outcomes.iter().map(|o| (o.id.as_str(), o.path.as_str())).collect();
        let plain = |id: &String| path_of.get(id.as_str()).map(|path| spelling::plain(path));
        let paths: Vec<String> = self.ids.iter().map(plain).collect::<Option<_>>()?;
        let different: HashSet<&str> = paths.iter().map(String::as_str).collect();
        (different.len() < paths.len()).then_some(paths)
    }

    /// Name of a feature, or its number.
    pub fn feature_name(&self, feature: usize) -> String {
        self.feature_names.get(feature).cloned().unwrap_or_else(|| feature.to_string())
    }

    /// Rows with a value that is not finite, each with the first such feature.
    pub fn non_finite(&self) -> Vec<(usize, usize)> {
        let rows = self.x.outer_iter().enumerate();
        rows.filter_map(|(i, row)| row.iter().position(|v| !v.is_finite()).map(|f| (i, f)))
            .collect()
    }
}
