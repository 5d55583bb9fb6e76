//! Label files: CSV with a column that names the recording, and label columns.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use corsmal_files::content;
use corsmal_files::csv_text::{self, Fault};
use corsmal_files::quote::quoted;

use super::error::{DatasetError, Result};
use crate::words::count;

/// Largest file that is read.
const MAX_BYTES: u64 = 256 << 20;

/// Names of label columns, each with a value for every recording.
pub(crate) type LabelColumns = Vec<(String, Vec<String>)>;

/// Where labels come from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LabelSource {
    /// A CSV file.
    File {
        /// the file
        path: PathBuf,
        /// the column that names recordings; else `id`, or `path`
        key: Option<String>,
    },
    /// The folder in which each recording lies is its class.
    Folders {
        /// the name that this column gets
        column: String,
    },
}

/// The columns of a label file by recording.
#[derive(Clone, Debug)]
pub struct LabelFile {
    path: PathBuf,
    key: Key,
    columns: Vec<String>,
    /// by the key's text
    rows: HashMap<String, Line>,
    /// keys by their path without extension, as ids are made, where that is unique
    stems: HashMap<String, String>,
}

/// A line of the file.
#[derive(Clone, Debug)]
struct Line {
    number: u64,
    values: Vec<String>,
    /// what a column `path` says beside the ids; empty without one
    path: String,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Key {
    Id,
    Path,
    /// a column of another name, which may hold ids, paths or file names
    Other,
}

impl LabelFile {
    /// Reads a file. `key` is the column that names recordings: by id, by path, by file name, or by
    /// file name without extension. Without it a column `id` counts, else `path`.
    ///
    /// # Errors
    /// [`DatasetError::Content`] for a file that is not a table, has no such column, names a column
    /// twice, or names a recording twice.
    pub fn read(path: &Path, key: Option<&str>) -> Result<Self> {
        let fault = |fault: Fault| DatasetError::content(path, fault.to_string());
        let other = |e: std::io::Error| DatasetError::content(path, e.to_string());
        let text = content::read(path, MAX_BYTES).map_err(other)?;
        let mut reader = csv_text::reader(text.as_slice()).map_err(other)?;
        let header = csv_text::header(&mut reader).map_err(fault)?;
        let find = |wanted: &str| header.iter().position(|h| h == wanted);
        let (key, at) = match (key, find("id"), find("path")) {
            (Some(name), ..) => match find(name) {
                Some(at) if name == "id" => (Key::Id, at),
                Some(at) => (Key::Other, at),
                None => {
                    let choices = corsmal_names::choices(name, header.iter());
                    let reason = format!("no column {name:?} (--id-column): {choices}");
                    return Err(DatasetError::content(path, reason));
                }
            },
            (None, Some(at), _) => (Key::Id, at),
            (None, None, Some(at)) => (Key::Path, at),
            (None, None, None) => {
                let found = header.iter().collect::<Vec<_>>().join(", ");
                let likely = header.iter().find(|name| corsmal_names::names_files(name));
                let remedy = match likely {
                    Some(name) => format!("does {name} name the recordings? --id-column {name}"),
                    None => "--id-column NAME says which column names the recordings".into(),
                };
                let reason = format!("needs a column id or path, has {found}; {remedy}");
                return Err(DatasetError::content(path, reason));
            }
        };
        let unnamed = header.iter().filter(|name| name.is_empty()).count();
        let repeated = csv_text::repeated(header.iter());
        if let Some(column) = repeated.or_else(|| (unnamed > 1).then(String::new)) {
            let reason = format!("two columns are named {column:?}");
            return Err(DatasetError::content(path, reason));
        }
        let is_label = |i: usize| i != at && !matches!(&header[i], "id" | "path");
        let label_at: Vec<usize> = (0..header.len()).filter(|&i| is_label(i)).collect();
        let mut rows: HashMap<String, Line> = HashMap::new();
        let beside = find("path").filter(|_| key == Key::Id);
        for found in csv_text::records(&mut reader) {
            let (number, record) = found.map_err(fault)?;
            let line = Line {
                number,
                values: label_at.iter().map(|&i| record[i].to_string()).collect(),
                path: beside.map_or("", |i| &record[i]).to_string(),
            };
            if let Some(Line { number: before, .. }) = rows.insert(record[at].to_string(), line) {
                let reason = format!("line {number} repeats {:?} of line {before}", &record[at]);
                return Err(DatasetError::content(path, reason));
            }
        }
        let columns = label_at.iter().map(|&i| header[i].to_string()).collect();
        let mut stems: HashMap<String, Option<String>> = HashMap::new();
        for key in rows.keys() {
            let stem = Path::new(key).with_extension("").to_string_lossy().into_owned();
            stems.entry(stem).and_modify(|key| *key = None).or_insert_with(|| Some(key.clone()));
        }
        let stems = stems.into_iter().filter_map(|(stem, key)| Some((stem, key?))).collect();
        Ok(Self { path: path.into(), key, columns, rows, stems })
    }

    /// A recording that is not named by a whole number, if there is one: the first by its name.
    pub(super) fn other_than_numbers(&self) -> Option<&str> {
        let names = self.rows.keys().map(String::as_str);
        // pandas writes whole numbers beside empty cells as 7.0.
        let is_number = |name: &str| name.parse::<f64>().is_ok_and(|number| number.fract() == 0.0);
        names.filter(|name| !is_number(name)).min()
    }

    /// Label columns in the order of these recordings, given as (id, path), of which each must have
    /// its line. Says, too, if lines have no recording, but for those that `failed` extraction: the
    /// labels may be those of a whole data set, or recordings may be missing.
    ///
    /// # Errors
    /// [`DatasetError::Content`] with the first recording that has no line.
    pub fn for_recordings(
        &self,
        recordings: &[(&str, &str)],
        failed: &[(&str, &str)],
        features: &Path,
    ) -> Result<(LabelColumns, Option<String>)> {
        let mut unused: HashMap<&str, u64> =
            self.rows.iter().map(|(key, line)| (key.as_str(), line.number)).collect();
        let mut columns: LabelColumns =
            self.columns.iter().map(|c| (c.clone(), Vec::new())).collect();
        let mut missing = Vec::new();
        let mut of_name: HashMap<&str, (&str, &str)> = HashMap::new();
        let paths: HashSet<&str> = recordings.iter().map(|(_, path)| *path).collect();
        let names: HashSet<&str> = paths.iter().filter_map(|path| file_name(path)).collect();
        for &recording in recordings {
            let Some((key, Line { number: line, values, path: beside })) = self.find(recording)
            else {
                missing.push(recording.0);
                continue;
            };
            // A file name may stand for several recordings in different folders; an id and a path
            // (of several stretches of one recording) may not.
            let (id, path) = recording;
            let path = if path == id { recording_of(recording).unwrap_or(id) } else { path };
            let recording = (id, path);
            let other = of_name.insert(key, recording).filter(|(_, other)| *other != path);
            if let Some((other, _)) = other {
                return Err(DatasetError::content(
                    &self.path,
                    format!(
                        "line {line}: {key:?} matches the recordings {other:?} and {id:?}: name \
                         them by id or path"
                    ),
                ));
            }
            if is_of_another(beside, path, &paths, &names) {
                let reason = format!(
                    "line {line}: id {key:?} is the recording {path}, but path names another one, \
                     {beside}: correct the line, or leave out the column that is wrong"
                );
                return Err(DatasetError::content(&self.path, reason));
            }
            unused.remove(key.as_str());
            columns.iter_mut().zip(values).for_each(|((_, column), v)| column.push(v.clone()));
        }
        for recording in failed {
            if let Some((key, _)) = self.find(*recording) {
                unused.remove(key.as_str());
            }
        }
        let features = features.display();
        let first = unused.iter().min_by_key(|(_, line)| **line);
        let place = self.path.display();
        let unmatched = first.map(|(key, line)| match unused.len() {
            1 => format!("line {line} of {place}, {}, has no recording here", quoted(key)),
            n => {
                let which = format!("such as line {line}, {}", quoted(key));
                format!("{n} lines of {place} have no recording here, {which}")
            }
        });
        if let Some(first) = missing.first() {
            let count = count(missing.len(), "recording");
            let unmatched = unmatched.map_or(String::new(), |unmatched| format!("; {unmatched}"));
            return Err(DatasetError::content(
                &self.path,
                format!(
                    "no line for recording {first:?} of {features} ({count} without \
                     labels){unmatched}"
                ),
            ));
        }
        Ok((columns, unmatched))
    }

    /// By id (for windows, also that of their recording); by path as extracted or, failing that, the path
    /// without extension as id; by any of these or the file name where the column has another name.
    fn find(&self, (id, path): (&str, &str)) -> Option<(&String, &Line)> {
        let get = |key: &str| self.rows.get_key_value(key);
        let of_window = || recording_of((id, path)).and_then(get);
        if self.key == Key::Id {
            return get(id).or_else(of_window);
        }
        let file = Path::new(path);
        let with_extension = || {
            let extension = file.extension().and_then(|e| e.to_str())?;
            get(&format!("{id}.{extension}"))
        };
        // Predictions may lack paths.
        let by_stem = || {
            self.stems.get(id).filter(|_| path.is_empty() || path == id).and_then(|key| get(key))
        };
        let by_path = get(path).or_else(with_extension).or_else(by_stem);
        if self.key == Key::Path {
            return by_path;
        }
        let last = file.file_name().and_then(|n| n.to_str());
        let name = || last.and_then(get);
        let stem = || file.file_stem().and_then(|n| n.to_str()).and_then(get);
        // Predictions may lack paths: an id is one without its extension.
        let named = || {
            let stem = self.stems.get(last.filter(|_| path.is_empty() || path == id)?)?;
            get(stem)
        };
        by_path.or_else(|| get(id)).or_else(of_window).or_else(name).or_else(stem).or_else(named)
    }
}

/// Of a window's id that of its recording: windows have `@` and where they begin after it. A file may be
/// called so, too.
fn recording_of<'a>((id, path): (&'a str, &str)) -> Option<&'a str> {
    let (recording, start) = id.rsplit_once('@')?;
    let stem = Path::new(path).file_stem().and_then(|stem| stem.to_str());
    let is_file = path != id && stem.is_some_and(|stem| stem.contains('@') && id.ends_with(stem));
    start.parse::<f64>().ok().filter(|start| start.is_finite() && !is_file).map(|_| recording)
}

fn file_name(path: &str) -> Option<&str> {
    Path::new(path).file_name()?.to_str()
}

/// Whether what a label file calls the path is that of another recording. Folders may differ where the
/// file name is that of no other.
fn is_of_another(written: &str, path: &str, paths: &HashSet<&str>, names: &HashSet<&str>) -> bool {
    let (name, own) = (file_name(written), file_name(path));
    (written != path && !written.is_empty() && paths.contains(written))
        || (name != own && name.is_some_and(|name| names.contains(name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str, key: Option<&str>) -> Result<LabelFile> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        LabelFile::read(file.path(), key)
    }

    #[test]
    fn any_column_can_name_the_recordings() {
        let recordings = [("a/x", "data/a/x.wav"), ("b/y", "data/b/y.flac")];
        let classes = |text: &str, key| {
            let columns = file(text, key)?.for_recordings(&recordings, &[], Path::new("f.npz"))?;
            Ok::<_, DatasetError>(columns.0[0].1.clone())
        };
        for (text, key) in [
            ("id,class\nb/y,dog\na/x,cat\n", None),
            ("path,class\ndata/b/y.flac,dog\na/x.wav,cat\n", None),
            ("file,class\ny.flac,dog\nx.wav,cat\n", Some("file")),
            ("name,class\ny,dog\ndata/a/x.wav,cat\n", Some("name")),
        ] {
            assert_eq!(classes(text, key).unwrap(), ["cat", "dog"], "{text}");
        }
        // As `cross-validate -o` has them, without paths.
        let bare = [("a/x", "a/x"), ("b/y", "b/y")];
        let by_name = file("file,class\ny.flac,dog\nx.wav,cat\n", Some("file")).unwrap();
        let found = by_name.for_recordings(&bare, &[], Path::new("f.npz")).unwrap();
        assert_eq!(found.0[0].1, ["cat", "dog"]);
        let doubled = [("a/x", "a/x"), ("b/x", "b/x"), ("b/y", "b/y")];
        assert!(by_name.for_recordings(&doubled, &[], Path::new("f.npz")).is_err());
        let refused = classes("file,class\nx,cat\n", None).unwrap_err().to_string();
        assert!(refused.contains("--id-column file"), "{refused}");
        let refused = classes("x,class\nx,cat\n", None).unwrap_err().to_string();
        assert!(refused.contains("--id-column NAME"), "{refused}");
        let unknown = classes("file,class\nx,cat\n", Some("fil")).unwrap_err().to_string();
        assert!(unknown.contains("did you mean \"file\""), "{unknown}");
        let missing = classes("file,class\nx.wav,cat\n", Some("file")).unwrap_err().to_string();
        assert!(
            missing.contains("\"b/y\"") && missing.contains("1 recording without"),
            "{missing}"
        );
    }

    /// They had labels by path only.
    #[test]
    fn windows_have_the_labels_of_their_recording() {
        let windows = [("x@0", "d/x.wav"), ("x@0.5", "d/x.wav"), ("y@2", "d/y@2.wav")];
        // Names that times end in.
        let numbers = [("5@0.5", "d/5.wav"), ("0@0", "d/0.wav")];
        let found = file("id,class\n5,cat\n0,dog\n", None).unwrap();
        let found = found.for_recordings(&numbers, &[], Path::new("f.npz")).unwrap();
        assert_eq!(found.0[0].1, ["cat", "dog"]);
        let classes = |text: &str, key| {
            let columns = file(text, key)?.for_recordings(&windows, &[], Path::new("f.npz"))?;
            Ok::<_, DatasetError>(columns.0[0].1.clone())
        };
        for key in [None, Some("id")] {
            let found = classes("id,class\nx,cat\ny@2,dog\n", key).unwrap();
            assert_eq!(found, ["cat", "cat", "dog"]);
        }
        let bare = [("x@0", "x@0"), ("x@0.5", "x@0.5")];
        let found = file("id,class\nx,cat\n", None).unwrap();
        let found = found.for_recordings(&bare, &[], Path::new("f.npz")).unwrap();
        assert_eq!(found.0[0].1, ["cat", "cat"]);
        // A window of its own label; and a name that is no window.
        let text = "id,class\nx,cat\nx@0.5,bird\ny@2,dog\n";
        assert_eq!(classes(text, None).unwrap(), ["cat", "bird", "dog"]);
        let other = file("id,class\nx,cat\n", None).unwrap();
        assert!(other.for_recordings(&[("x@home", "d/x@home.wav")], &[], Path::new("f")).is_err());
        // Files that are called like windows.
        for files in [&[("x", "d/x.wav"), ("x@2", "d/x@2.wav")][..], &[("x@2", "d/x@2.wav")]] {
            assert!(other.for_recordings(files, &[], Path::new("f")).is_err());
        }
    }

    #[test]
    fn a_file_name_that_two_recordings_have_is_refused() {
        let recordings = [("a/x", "a/x.wav"), ("b/x", "b/x.wav")];
        let file = file("file,class\nx.wav,cat\n", Some("file")).unwrap();
        let refused = file.for_recordings(&recordings, &[], Path::new("f.npz")).unwrap_err();
        assert!(refused.to_string().contains("matches the recordings \"a/x\" and \"b/x\""));
    }

    #[test]
    fn ids_and_paths_that_contradict_each_other_are_refused() {
        let recordings = [("a/x", "data/a/x.wav"), ("b/y", "data/b/y.flac")];
        let labels = |text: &str| {
            file(text, None).unwrap().for_recordings(&recordings, &[], Path::new("f.npz"))
        };
        for text in [
            "id,path,class\na/x,data/a/x.wav,cat\nb/y,data/b/y.flac,dog\n",
            "id,path,class\na/x,/elsewhere/x.wav,cat\nb/y,,dog\n",
            "id,path,class\na/x,x.wav,cat\nb/y,y.flac,dog\n",
        ] {
            assert_eq!(labels(text).unwrap().0[0].1, ["cat", "dog"], "{text}");
        }
        for text in [
            "id,path,class\na/x,data/b/y.flac,cat\nb/y,data/a/x.wav,dog\n",
            "id,path,class\na/x,y.flac,cat\nb/y,x.wav,dog\n",
        ] {
            let refused = labels(text).unwrap_err().to_string();
            assert!(
                refused.contains("line 2: id \"a/x\" is the recording data/a/x.wav"),
                "{refused}"
            );
        }
    }
}
