//! Label files: CSV with a column `id` or `path` and label columns.

use std::collections::HashMap;
use std::path::Path;

use crate::failure::Failure;

/// The columns of a label file by recording.
pub struct LabelFile {
    path: String,
    key: Key,
    columns: Vec<String>,
    /// line in the file and values, by the key's text
    rows: HashMap<String, (u64, Vec<String>)>,
}

#[derive(Clone, Copy, PartialEq)]
enum Key {
    Id,
    Path,
}

impl LabelFile {
    /// Reads a file; where it has both columns, `id` counts.
    pub fn read(path: &Path) -> Result<Self, Failure> {
        let name = path.display().to_string();
        let fault = |e: csv::Error| Failure::new(format!("{name}: {e}"));
        let mut reader =
            csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(fault)?;
        let header = reader.headers().map_err(fault)?.clone();
        let find = |wanted: &str| header.iter().position(|h| h == wanted);
        let (key, at) = match (find("id"), find("path")) {
            (Some(at), _) => (Key::Id, at),
            (None, Some(at)) => (Key::Path, at),
            (None, None) => {
                let found = header.iter().collect::<Vec<_>>().join(", ");
                let text = format!("{name}: needs a column id or path, has {found}");
                return Err(Failure::new(text));
            }
        };
        for (i, column) in header.iter().enumerate() {
            if header.iter().take(i).any(|other| other == column) {
                return Err(Failure::new(format!("{name}: two columns are named {column:?}")));
            }
        }
        let is_label = |i: usize| i != at && !matches!(&header[i], "id" | "path");
        let label_at: Vec<usize> = (0..header.len()).filter(|&i| is_label(i)).collect();
        let mut rows: HashMap<String, (u64, Vec<String>)> = HashMap::new();
        for record in reader.records() {
            let record = record.map_err(fault)?;
            let line = record.position().map_or(0, csv::Position::line);
            let values = label_at.iter().map(|&i| record[i].to_string()).collect();
            if let Some((before, _)) = rows.insert(record[at].to_string(), (line, values)) {
                let text =
                    format!("{name}: line {line} repeats {:?} of line {before}", &record[at]);
                return Err(Failure::new(text));
            }
        }
        let columns = label_at.iter().map(|&i| header[i].to_string()).collect();
        Ok(Self { path: name, key, columns, rows })
    }

    /// Label columns in the order of these recordings, given as (id, path). Lines of recordings
    /// that `failed` extraction are allowed; any other line must have its recording, and every
    /// recording its line.
    pub fn for_recordings(
        &self,
        recordings: &[(&str, &str)],
        failed: &[(&str, &str)],
        features: &str,
    ) -> Result<Vec<(String, Vec<String>)>, Failure> {
        let mut unused: HashMap<&str, u64> =
            self.rows.iter().map(|(key, (line, _))| (key.as_str(), *line)).collect();
        let mut columns: Vec<(String, Vec<String>)> =
            self.columns.iter().map(|c| (c.clone(), Vec::new())).collect();
        let mut missing = Vec::new();
        for recording in recordings {
            let Some((key, (_, values))) = self.find(*recording) else {
                missing.push(recording.0);
                continue;
            };
            unused.remove(key.as_str());
            columns.iter_mut().zip(values).for_each(|((_, column), v)| column.push(v.clone()));
        }
        for recording in failed {
            if let Some((key, _)) = self.find(*recording) {
                unused.remove(key.as_str());
            }
        }
        if let Some((key, line)) = unused.iter().min_by_key(|(_, line)| **line) {
            return Err(Failure::new(format!(
                "{}: line {line}: {key:?} matches no recording of {features} ({} such lines)",
                self.path,
                unused.len()
            )));
        }
        if let Some(first) = missing.first() {
            return Err(Failure::new(format!(
                "{}: no line for recording {first:?} of {features} ({} without labels)",
                self.path,
                missing.len()
            )));
        }
        Ok(columns)
    }

    /// By id; by path as extracted or, failing that, the path without extension as id.
    fn find(&self, (id, path): (&str, &str)) -> Option<(&String, &(u64, Vec<String>))> {
        if self.key == Key::Id {
            return self.rows.get_key_value(id);
        }
        self.rows.get_key_value(path).or_else(|| {
            let extension = Path::new(path).extension().and_then(|e| e.to_str())?;
            self.rows.get_key_value(&format!("{id}.{extension}"))
        })
    }
}
