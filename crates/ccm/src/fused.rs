//! One table of predictions from several files, or from the windows of one.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use corsmal_models::predictions::PredictionTable;
use corsmal_models::voting::VotingRule;

use crate::error::{CcmError, Result};
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
            table = table.windows_by_recording()?;
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
            "{} has folds and {} has none: their fusion looks too good if a classifier was trained on the rows that it \
             predicts",
            with.path.display(),
            without.path.display()
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
    let mut known: HashMap<RowKey, (&str, &Path)> = HashMap::new();
    for table in tables {
        for row in &table.rows {
            let (RowName::Recording(key @ RowKey::Id(_)), Some(id)) = (&row.key, row.cells.first())
            else {
                continue;
            };
            let (before, file) = *known.entry(*key).or_insert((id, &table.path));
            if !ends_alike(before, id, usize::MAX) {
                return Err(CcmError::Request(format!(
                    "{} has the id {before}, {} has {id}: these may be two recordings; give a recording one id in all \
                     files",
                    file.display(),
                    table.path.display()
                )));
            }
        }
    }
    Ok(())
}

/// That tables which have recordings in common by a number alone have them in different folders, such as those
/// of two test parts.
pub fn doubt(tables: &[&RecordingPredictions]) -> Option<String> {
    let mut known: HashMap<RowKey, (&str, &Path)> = HashMap::new();
    for table in tables {
        let Some(at) = table.columns.iter().position(|column| column == "path") else { continue };
        for row in &table.rows {
            let RowName::Recording(key @ RowKey::Id(_)) = &row.key else { continue };
            let path = row.cells[at].as_str();
            let (before, file) = *known.entry(*key).or_insert((path, &table.path));
            let is_alike = ends_alike(before, path, NEAREST);
            if !is_alike && !before.is_empty() && !path.is_empty() {
                return Some(format!(
                    "{} has {before}, {} has {path} for the same recording: are both of the same part of the data set?",
                    file.display(),
                    table.path.display()
                ));
            }
        }
    }
    None
}

/// Folders of a path that tell parts of a data set apart; those above differ between copies of it.
const NEAREST: usize = 2;

/// Whether one of two ids is the end of the other, but for its number and extension, as far as so many folders.
fn ends_alike(one: &str, other: &str, most: usize) -> bool {
    let folders = |id: &str| -> Vec<String> {
        Path::new(id)
            .iter()
            .rev()
            .skip(1)
            .take(most)
            .map(|part| part.to_string_lossy().into())
            .collect()
    };
    folders(one).iter().zip(&folders(other)).all(|(one, other)| one == other)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Recordings of different people were averaged where their files had the same number.
    #[test]
    fn numbers_in_other_folders_are_other_recordings() {
        let folder = tempfile::tempdir().unwrap();
        let fused = |one: &str, other: &str| {
            let paths = [("a.csv", one), ("b.csv", other)].map(|(name, id)| {
                let path = folder.path().join(name);
                std::fs::write(&path, format!("id,p_x,p_y\n{id},0.9,0.1\n")).unwrap();
                path
            });
            fuse(&paths, |_| Ok(None), None).map(|fused| fused.table.rows.len())
        };
        let refused = fused("anna/1", "ben/1").unwrap_err().to_string();
        assert!(
            refused.contains("a.csv has the id anna/1") && refused.contains("ben/1"),
            "{refused}"
        );
        for (one, other) in
            [("anna/1", "anna/1"), ("7", "000007"), ("audio/000007", "7"), ("x", "x")]
        {
            assert_eq!(fused(one, other).unwrap(), 1, "{one} {other}");
        }
    }

    /// Two test parts of the flat release have the same numbers.
    #[test]
    fn numbers_in_the_folders_of_two_parts_are_doubted() {
        let folder = tempfile::tempdir().unwrap();
        let warnings = |other: &str| {
            let paths =
                [("a.csv", "d/test_pub/audio/000001.wav"), ("b.csv", other)].map(|(name, of)| {
                    let path = folder.path().join(name);
                    std::fs::write(&path, format!("id,path,p_x,p_y\n000001,{of},0.9,0.1\n"))
                        .unwrap();
                    path
                });
            fuse(&paths, |_| Ok(None), None).unwrap().warnings
        };
        assert!(warnings("d/test_priv/audio/000001.wav")[0].contains("same part"));
        assert!(warnings("/copy/test_pub/audio/000001.wav").is_empty());
    }

    #[test]
    fn single_lines_leave_nothing_to_vote_on() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        std::fs::write(&path, "id,predicted,p_x,p_y\nr,x,0.9,0.1\n").unwrap();
        let fused = fuse(&[path], |_| Ok(Some(VotingRule::Mean)), None).unwrap();
        assert!(fused.warnings[0].contains("nothing to vote on"), "{:?}", fused.warnings);
    }
}
