//! Outputs in several files: a folder with a Parquet file for each value of a label, named as Hive and
//! pyarrow have it, `type=rice/part.parquet`.
//!
//! The label is in the name of the subfolder only: a column of it in the file would contradict the type that
//! readers guess from names. Each file is a whole output of its recordings, and says which places they had
//! among the inputs, so that the folder gives back the table of the run.

pub(crate) mod names;

use std::collections::BTreeMap;
use std::path::Path;

use names::files;
pub use names::{FILE, folder, is_partitioned};

use crate::feature_file::{FeatureFileError, FeatureTable};
use crate::format::OutputFormat;
use crate::parquet::{ParquetFile, ParquetTableError};
use crate::provenance::{Part, Provenance};
use crate::table::{Table, TableError};

/// Most values of the label: each is a folder.
pub const MOST: usize = 10_000;

/// A part and its table, which lacks the label.
#[derive(Debug)]
pub struct Partition {
    /// Which part it is.
    pub part: Part,
    /// Its rows and outcomes.
    pub table: Table,
}

/// The parts of a table by a label, sorted by its values; `values` has one for each outcome.
///
/// # Errors
/// [`TableError`], of which a table has none that is whole.
pub fn split(table: &Table, label: &str, values: &[String]) -> Result<Vec<Partition>, TableError> {
    let mut places: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (place, value) in values.iter().enumerate().take(table.outcomes().len()) {
        places.entry(value).or_default().push(place);
    }
    let column = table.labels().position(|(name, _)| name == label).unwrap_or_default();
    let inputs = table.outcomes().len();
    if inputs == 0 {
        // A shard may have none; a folder without parts would not say what it is of.
        places.insert("", Vec::new());
    }
    let part = |(value, places): (&str, Vec<usize>)| {
        let table = table.of_places(&places, label)?;
        let part = Part { label: label.into(), value: value.into(), column, inputs, places };
        Ok(Partition { part, table })
    };
    places.into_iter().map(part).collect()
}

/// Reads the table of a partitioned output, in the order of its run, and the label.
///
/// # Errors
/// [`FeatureFileError`]; parts of several runs, or not all of one.
pub fn open(path: &Path) -> Result<(FeatureTable, String), FeatureFileError> {
    let io = |source| FeatureFileError::Io { path: path.into(), source };
    let foreign = || FeatureFileError::Foreign { path: path.into() };
    let files = files(path).map_err(io)?.ok_or_else(foreign)?;
    let wrong = |file: &Path, expected: &str, actual: String| {
        let (path, expected) = (file.into(), expected.into());
        FeatureFileError::Parquet(ParquetTableError::Layout { path, expected, actual })
    };
    let mut parts: Vec<Partition> = Vec::new();
    let mut first: Option<Provenance> = None;
    for file in &files {
        let (table, mut provenance) = ParquetFile::open(file)?.table()?;
        let part = provenance.part.take().ok_or_else(foreign)?;
        let name = folder(&part.label, &part.value);
        if file.parent().and_then(Path::file_name).is_none_or(|found| *found != *name) {
            return Err(wrong(file, "the folder of its part", name));
        }
        let same = parts.first().is_none_or(|other| {
            let known = |part: &Part| (part.label.clone(), part.column, part.inputs);
            known(&other.part) == known(&part)
        });
        if !same || first.as_ref().is_some_and(|first| *first != provenance) {
            return Err(wrong(file, "parts of one run", "another one".into()));
        }
        first.get_or_insert(provenance);
        parts.push(Partition { part, table });
    }
    let (Some(provenance), Some(label)) = (first, parts.first().map(|p| p.part.label.clone()))
    else {
        return Err(foreign());
    };
    let table = joined(&label, &parts).map_err(|actual| {
        let actual =
            actual.map_or_else(|e| e.to_string(), |place| format!("none for input {place}"));
        wrong(path, "a part for every input", actual)
    })?;
    Ok((
        FeatureTable { path: path.into(), table, provenance, format: OutputFormat::Parquet },
        label,
    ))
}

/// The table of all parts; else the first place that is missing or there twice.
fn joined(label: &str, parts: &[Partition]) -> Result<Table, Result<usize, TableError>> {
    let mut places = Vec::new();
    let mut columns: Vec<String> = Vec::new();
    for (index, Partition { part, table }) in parts.iter().enumerate() {
        columns = table.labels().map(|(name, _)| name.to_owned()).collect();
        if part.places.len() != table.outcomes().len() {
            return Err(Ok(part.places.len()));
        }
        let mut row = 0;
        for (outcome, place) in table.outcomes().iter().zip(&part.places) {
            places.push((*place, index, outcome, row));
            row += usize::from(outcome.status.has_features());
        }
    }
    places.sort_unstable_by_key(|(place, ..)| *place);
    if let Some(missing) = places.iter().enumerate().position(|(i, (place, ..))| i != *place) {
        return Err(Ok(missing));
    }
    // A hole at the end is none between places.
    let first = parts.first().map(|partition| &partition.part);
    let (inputs, at) = first.map_or((0, 0), |part| (part.inputs, part.column));
    if places.len() != inputs {
        return Err(Ok(places.len()));
    }
    let at = at.min(columns.len());
    columns.insert(at, label.into());
    let mut all = Table::new(columns).map_err(Err)?;
    for (_, index, outcome, row) in places {
        let Partition { part, table } = &parts[index];
        let (mut labels, mut values) = (Vec::new(), Vec::new());
        if outcome.status.has_features() {
            all.name_features(table.feature_names()).map_err(Err)?;
            labels.extend(
                table.labels().map(|(name, column)| (name.to_owned(), column[row].clone())),
            );
            labels.insert(at, (label.into(), part.value.clone()));
            values.extend(table.values().row(row));
        } else {
            labels.push((label.into(), part.value.clone()));
        }
        all.push(outcome.clone(), &labels, &values).map_err(Err)?;
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::names::NONE;
    use super::*;
    use crate::outcome::{Outcome, Status};
    use crate::parquet::write;
    use crate::shard::Shard;

    fn table() -> (Table, Vec<String>) {
        let mut table = Table::new(vec!["type".into(), "take".into()]).unwrap();
        table.name_features(&["rms.mean".into()]).unwrap();
        let mut values = Vec::new();
        for (i, value) in ["rice", "a/b", "", "rice", "ü=%", "."].into_iter().enumerate() {
            let labels = [("type".into(), value.into()), ("take".into(), i.to_string())];
            let status = if i == 3 { Status::Corrupt } else { Status::Ok };
            let outcome = Outcome::new(format!("r{i}"), "x.wav", status, "");
            table.push(outcome, &labels, &[i as f32]).unwrap();
            values.push(value.to_owned());
        }
        (table, values)
    }

    /// Writes the parts below a folder.
    fn write_parts(path: &Path, parts: &[Partition]) {
        for Partition { part, table } in parts {
            let mut made = Provenance::new("{}".into(), "c".into(), "i".into(), Shard::default());
            let folder = path.join(folder(&part.label, &part.value));
            made.part = Some(part.clone());
            std::fs::create_dir_all(&folder).unwrap();
            write(&folder.join(FILE), table, &made).unwrap();
        }
    }

    #[test]
    fn a_folder_gives_back_the_table() {
        let (table, values) = table();
        let parts = split(&table, "type", &values).unwrap();
        let names: Vec<String> = parts.iter().map(|p| folder("type", &p.part.value)).collect();
        let none = format!("type={NONE}");
        assert_eq!(names, [&*none, "type=.", "type=a%2Fb", "type=rice", "type=%C3%BC%3D%25"]);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        write_parts(&path, &parts);
        assert!(is_partitioned(&path));
        let refused = crate::feature_file::FeatureFile::open(&path).unwrap_err().to_string();
        assert!(refused.contains("--partition-by"), "{refused}");
        let (found, label) = open(&path).unwrap();
        assert_eq!((found.table, label.as_str()), (table, "type"));
    }

    #[test]
    fn an_input_without_features_keeps_its_labels() {
        let (table, values) = table();
        let labels = |table: &Table, place: usize| {
            let labels = table.outcomes()[place].labels.iter();
            labels.map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>()
        };
        assert_eq!(labels(&table, 3), ["take=3", "type=rice"]);
        assert_eq!(labels(&table, 0), [""; 0], "a row has them");
        let parts = split(&table, "type", &values).unwrap();
        assert_eq!(labels(&parts[3].table, 1), ["take=3"]);
        let mut twice = Table::new(vec!["type".into(), "take".into()]).unwrap();
        twice.extend(&table).unwrap();
        assert_eq!(twice, table);
    }

    #[test]
    fn an_output_without_inputs_has_a_part() {
        let table = Table::new(vec!["type".into(), "take".into()]).unwrap();
        let parts = split(&table, "take", &[]).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        write_parts(&path, &parts);
        let (found, label) = open(&path).unwrap();
        assert_eq!((found.table, label.as_str()), (table, "take"));
    }

    #[test]
    fn folders_of_something_else_are_told() {
        let (table, values) = table();
        let parts = split(&table, "type", &values).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        write_parts(&path, &parts[1..]);
        let error = open(&path).unwrap_err().to_string();
        assert!(error.contains("none for input 2"), "{error}");
        // Of the last input, too: the part of `.`.
        std::fs::remove_dir_all(path.join("type=.")).unwrap();
        let last: Vec<&Partition> = parts.iter().filter(|p| p.part.value != ".").collect();
        assert_eq!(last.len(), 4);
        last.iter().for_each(|part| write_parts(&path, std::slice::from_ref(part)));
        let error = open(&path).unwrap_err().to_string();
        assert!(error.contains("none for input 5"), "{error}");
        write_parts(&path, &parts);
        std::fs::rename(path.join("type=rice"), path.join("type=water")).unwrap();
        assert!(open(&path).unwrap_err().to_string().contains("type=rice"));
        std::fs::rename(path.join("type=water"), path.join("type=rice")).unwrap();
        for beside in [".DS_Store", "_SUCCESS", "type=rice/.DS_Store"] {
            std::fs::write(path.join(beside), "").unwrap();
        }
        assert_eq!(open(&path).unwrap().0.table, table);
        std::fs::write(path.join("type=rice/notes.txt"), "mine").unwrap();
        assert!(!is_partitioned(&path), "files that are not ours");
        assert!(!is_partitioned(folder.path()) && !is_partitioned(&path.join("none")));
        assert!(matches!(open(&path), Err(FeatureFileError::Foreign { .. })));
    }
}
