//! One table of predictions from several files, or from the windows of one.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use corsmal_models::predictions::PredictionTable;
use corsmal_models::voting::VotingRule;

use crate::error::{CcmError, Result};
use crate::folders::{Depth, are_alike};
use crate::predictions::{RecordingPredictions, RowName, named};
use crate::submission::RowKey;

/// What files give together.
#[derive(Debug)]
pub struct Fused {
    /// One row for each recording.
    pub table: RecordingPredictions,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// Votes on the windows of each recording where there is a `rule` for the classes of a file, then averages
/// the files, if there are several or `weights`.
///
/// # Errors
/// [`CcmError`] for what [`named`], [`PredictionTable::vote`] and [`PredictionTable::average`] refuse, for
/// what `rule` says, and for files whose ids only look like the same recordings.
pub fn fuse(
    paths: &[PathBuf],
    rule: impl Fn(&[String]) -> std::result::Result<Option<VotingRule>, String>,
    weights: Option<&[f64]>,
) -> Result<Fused> {
    let mut warnings = Vec::new();
    let mut tables = Vec::with_capacity(paths.len());
    for path in paths {
        let mut table = PredictionTable::read(path)?;
        let rule = rule(&table.labels).map_err(CcmError::Request)?;
        if rule.is_some() {
            let first = table.rows.first().map(|row| row.key.clone());
            table = table.windows_by_recording()?;
            let recording = table.rows.first().map(|row| &row.key);
            if let (Some(id), Some(recording)) = (first, recording)
                && table.column("recording").is_none()
                && *recording != id
            {
                warnings
                    .push(format!("{}: {id} is taken for a window of {recording}", path.display()));
            }
            if table.check_once_each().is_ok() {
                let path = path.display();
                warnings
                    .push(format!("{path}: each id has one line, so there is nothing to vote on"));
            }
        }
        let table = named(table)?;
        tables.push(match rule {
            Some(rule) => table.vote(rule)?,
            None => table,
        });
    }
    let (with, without): (Vec<_>, Vec<_>) =
        tables.iter().partition(|table| table.held_out_folds().is_some());
    if let ([with, ..], [without, ..]) = (with.as_slice(), without.as_slice()) {
        warnings.push(format!(
            "{} has folds and {} has {}: their fusion looks too good if a classifier was trained on the rows that it \
             predicts",
            with.path.display(),
            without.path.display(),
            without.no_folds()
        ));
    }
    check_alike(&tables)?;
    warnings.extend(doubt(&tables.iter().collect::<Vec<_>>()));
    let table = match (tables.len(), weights) {
        // Votes stand as they are: their shares may have another maximum.
        (1, None) => {
            let table = tables.remove(0);
            table.check_once_each()?;
            table.of_recordings()
        }
        _ => RecordingPredictions::average(&tables, weights)?,
    };
    Ok(Fused { table, warnings })
}

/// Refuses files that are of one recording by a number alone, where they have it in other folders:
/// `a/1` and `b/1` are two recordings, `audio/000001.wav` and `1` are one.
fn check_alike(tables: &[RecordingPredictions]) -> Result<()> {
    let ids = |_: &RecordingPredictions| vec![0];
    match unlike(&tables.iter().collect::<Vec<_>>(), ids, Depth::All) {
        None => Ok(()),
        Some([(before, file), (id, other)]) => Err(CcmError::Request(format!(
            "{} has the id {before}, {} has {id}: these may be two recordings; give a recording one id in all files",
            file.display(),
            other.display()
        ))),
    }
}

/// That tables which have recordings in common by a number alone have them in different folders, such as those
/// of two test parts.
pub fn doubt(tables: &[&RecordingPredictions]) -> Option<String> {
    let names = |table: &RecordingPredictions| {
        std::iter::once(0).chain(table.columns.iter().position(|column| column == "path")).collect()
    };
    let [(before, file), (path, other)] = unlike(tables, names, Depth::Nearest)?;
    Some(format!(
        "{} has {before}, {} has {path} for the same recording: are both of the same part of the data set?",
        file.display(),
        other.display()
    ))
}

/// A name in a table.
type NameIn<'t> = (&'t str, &'t Path);

/// Two names of one number, in these columns of two tables, that are not [alike](are_alike).
fn unlike<'t>(
    tables: &[&'t RecordingPredictions],
    columns: impl Fn(&RecordingPredictions) -> Vec<usize>,
    depth: Depth,
) -> Option<[NameIn<'t>; 2]> {
    // The first table that has a name is enough.
    let mut known: HashMap<RowKey, Vec<(usize, &str)>> = HashMap::new();
    for (number, &table) in tables.iter().enumerate() {
        let columns = columns(table);
        for row in &table.rows {
            let RowName::Recording(key @ RowKey::Id(_)) = &row.key else { continue };
            let known = known.entry(*key).or_default();
            for name in columns.iter().map(|&at| row.cells[at].as_str()) {
                if name.is_empty() || known.iter().any(|(_, before)| *before == name) {
                    continue;
                }
                let mut others = known.iter().filter(|(of, _)| *of != number);
                if let Some((of, before)) =
                    others.find(|(_, before)| !are_alike(before, name, depth))
                {
                    return Some([(*before, &tables[*of].path), (name, &table.path)]);
                }
                known.push((number, name));
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A fusion of files whose single line has one of these ids and paths.
    fn fused_of(names: &[(&str, &str)]) -> Result<Fused> {
        let folder = tempfile::tempdir().unwrap();
        let paths: Vec<PathBuf> = names
            .iter()
            .zip('a'..)
            .map(|((id, of), file)| {
                let path = folder.path().join(format!("{file}.csv"));
                std::fs::write(&path, format!("id,path,p_x,p_y\n{id},{of},0.9,0.1\n")).unwrap();
                path
            })
            .collect();
        fuse(&paths, |_| Ok(None), None)
    }

    /// Recordings of different people were averaged where their files had the same number.
    #[test]
    fn numbers_in_other_folders_are_other_recordings() {
        let ids = |ids: &[&str]| {
            fused_of(&ids.iter().map(|&id| (id, "")).collect::<Vec<_>>())
                .map(|f| f.table.rows.len())
        };
        let refused = ids(&["anna/1", "ben/1"]).unwrap_err().to_string();
        assert!(
            refused.contains("a.csv has the id anna/1") && refused.contains("ben/1"),
            "{refused}"
        );
        // In any order: a number alone is like all others.
        for three in [["1", "anna/1", "ben/1"], ["anna/1", "1", "ben/1"]] {
            let refused = ids(&three).unwrap_err().to_string();
            assert!(refused.contains("the id anna/1") && refused.contains("ben/1"), "{refused}");
        }
        for same in [["anna/1", "anna/1"], ["7", "000007"], ["audio/000007", "7"], ["x", "x"]] {
            assert_eq!(ids(&same).unwrap(), 1, "{same:?}");
        }
        assert_eq!(ids(&["train/audio/000001", "train/view1/rgb/000001"]).unwrap(), 1);
    }

    /// Two test parts of the flat release have the same numbers.
    #[test]
    fn numbers_in_the_folders_of_two_parts_are_doubted() {
        let warnings = |paths: &[&str]| {
            let of = paths.iter().map(|&path| ("000001", path)).collect::<Vec<_>>();
            fused_of(&of).unwrap().warnings
        };
        let (public, private) = ("d/test_pub/audio/000001.wav", "d/test_priv/audio/000001.wav");
        assert!(warnings(&[public, private])[0].contains("same part"));
        assert!(warnings(&[public, "", private])[0].contains("same part"));
        assert!(warnings(&["", public, private])[0].contains("same part"));
        assert!(warnings(&[public, "/copy/test_pub/audio/000001.wav"]).is_empty());
        assert!(warnings(&[public, "d/test_pub/view1/rgb/000001.mp4"]).is_empty());
    }

    #[test]
    fn single_lines_leave_nothing_to_vote_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, "id,predicted,p_x,p_y\nr,x,0.9,0.1\n").unwrap();
        let fused = fuse(&[path], |_| Ok(Some(VotingRule::Mean)), None).unwrap();
        assert!(fused.warnings[0].contains("nothing to vote on"), "{:?}", fused.warnings);
    }

    #[test]
    fn ids_that_are_taken_for_windows_are_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, "id,p_x,p_y\ntake@1,0.9,0.1\ntake@2,0.8,0.2\n").unwrap();
        let fused = fuse(&[path], |_| Ok(Some(VotingRule::Mean)), None).unwrap();
        assert_eq!(fused.table.rows.len(), 1);
        let expected = "id take@1 is taken for a window of id take";
        assert!(fused.warnings[0].contains(expected), "{:?}", fused.warnings);
    }

    /// Beside `status`, a column `fold` is a label.
    #[test]
    fn folds_of_labels_contradict_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let fused = |texts: [&str; 2]| {
            let paths = [("a.csv", texts[0]), ("b.csv", texts[1])].map(|(name, text)| {
                let path = folder.path().join(name);
                std::fs::write(&path, text).unwrap();
                path
            });
            fuse(&paths, |_| Ok(None), None)
        };
        let held_out = "id,fold,p_x,p_y\nr,1,0.9,0.1\n";
        let label = |fold: &str| format!("id,status,fold,p_x,p_y\nr,ok,{fold},0.9,0.1\n");
        assert_eq!(fused([&label("1"), &label("2")]).unwrap().warnings, [""; 0]);
        let said = fused([held_out, &label("2")]).unwrap().warnings;
        assert!(said[0].contains("none (beside status, its column fold is a label)"), "{said:?}");
        let other = held_out.replace("r,1", "r,2");
        let refused = fused([held_out, &other]).unwrap_err().to_string();
        assert!(refused.contains("fold is 2 here and 1 in"), "{refused}");
    }
}
