//! True classes and other labels of predictions, from elsewhere.

use std::path::Path;

use super::{Id, PredictionRow, PredictionTable, Result, content};
use crate::dataset::{DatasetError, LabelFile, LabelSource};

/// Label columns that are groups rather than something to predict.
pub const NO_TARGETS: [&str; 5] = ["fold", "group", "container", "recording", "view"];

impl PredictionTable {
    /// Adds columns of labels; they hide columns of the same name. Gives the column of true classes:
    /// `target` if there is one, else that of the folders, or the only label column of the file that
    /// is no group; `None` stands for the column `true`.
    ///
    /// # Errors
    /// [`PredictionError::Content`](super::PredictionError::Content) for recordings without labels
    /// and several columns that may have the true classes.
    pub fn add_labels(
        &mut self,
        source: &LabelSource,
        target: Option<&str>,
        groups: Option<&str>,
    ) -> Result<Option<String>> {
        let own_truth = self.column("true").is_some();
        let added = self.found(source)?;
        let names: Vec<String> = added.iter().map(|(name, _)| name.clone()).collect();
        for (name, values) in added {
            match self.columns.iter().position(|column| *column == name) {
                Some(at) => {
                    self.rows.iter_mut().zip(values).for_each(|(row, v)| row.cells[at] = v);
                }
                None => {
                    self.columns.push(name);
                    self.rows.iter_mut().zip(values).for_each(|(row, v)| row.cells.push(v));
                }
            }
        }
        if let Some(target) = target {
            return Ok(Some(target.into()));
        }
        if names.iter().any(|name| name == "true") {
            return Ok(None);
        }
        let is_target =
            |name: &&String| !NO_TARGETS.contains(&name.as_str()) && groups != Some(name.as_str());
        let targets: Vec<&String> = names.iter().filter(is_target).collect();
        match targets.as_slice() {
            [only] if names.len() == 1 || !own_truth => Ok(Some((*only).clone())),
            [] => Ok(None),
            // Whether they are the true classes is a guess.
            _ if own_truth => Err(self.content(format!(
                "has a column true, and the labels have {}: --target names the column with the \
                 true classes",
                names.join(", ")
            ))),
            _ => Ok(None),
        }
    }

    /// The columns of a source for the lines.
    fn found(&mut self, source: &LabelSource) -> Result<Vec<(String, Vec<String>)>> {
        let at = self.columns.iter().position(|c| c == "path");
        let path = |row: &PredictionRow<Id>| at.map_or(&row.key.0, |at| &row.cells[at]).clone();
        match source {
            LabelSource::Folders { column } => {
                let folder = |row: &PredictionRow<Id>| {
                    let path = path(row);
                    let folder = Path::new(&path).parent().and_then(Path::file_name);
                    folder.and_then(|name| name.to_str()).map(String::from)
                };
                let folders: Option<Vec<String>> = self.rows.iter().map(folder).collect();
                let remedy = "its paths have no class folders; give --labels a CSV";
                Ok(vec![(column.clone(), folders.ok_or_else(|| self.content(remedy))?)])
            }
            LabelSource::File { path: file, key } => {
                let refuse = |e: DatasetError| content(&self.path, e.to_string());
                let labels = LabelFile::read(file, key.as_deref()).map_err(refuse)?;
                let names = |row: &PredictionRow<Id>| (row.key.0.clone(), path(row));
                let names: Vec<(String, String)> = self.rows.iter().map(names).collect();
                let pairs: Vec<(&str, &str)> =
                    names.iter().map(|(id, path)| (id.as_str(), path.as_str())).collect();
                let (columns, unmatched) =
                    labels.for_recordings(&pairs, &[], &self.path).map_err(refuse)?;
                self.unmatched = unmatched;
                Ok(columns)
            }
        }
    }
}
