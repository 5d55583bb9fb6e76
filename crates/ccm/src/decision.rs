//! From class probabilities to estimates of type and level.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use corsmal_models::fusion;
use ndarray::{Array2, ArrayView1};

use crate::dataset::{Category, Container, Filling, FillingLevel, FillingType};
use crate::error::{CcmError, Result};
use crate::predictions::{RecordingPredictions, RowName, classes};
use crate::submission::{RowKey, SubmissionRow};

/// How type and level are decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Each by itself, as M5 did; the pair may be infeasible.
    Separate,
    /// The feasible pair of the largest product: level empty goes with type none only.
    Joint,
    /// As [`Rule::Joint`], and no water in food boxes, where the container is known.
    JointDryBoxes,
}

/// Estimates from probabilities of the type, of the level, or of both over the same recordings.
///
/// # Errors
/// [`CcmError`] for class names that are no types or levels, lines that are no recording of the data
/// set or occur twice, and recordings that one table has and the other has not.
pub fn decide(
    kind: Option<&RecordingPredictions>,
    level: Option<&RecordingPredictions>,
    rule: Rule,
) -> Result<Vec<SubmissionRow>> {
    let kinds = kind.map(of_kind).transpose()?;
    let levels = level.map(of_level).transpose()?;
    let (mut estimates, other) = match (kinds, levels) {
        (Some(kinds), levels) => (kinds, levels),
        (None, Some(levels)) => (levels, None),
        (None, None) => return Err(CcmError::Request("no type and no level to decide".into())),
    };
    if let (Some(other), Some(kind), Some(level)) = (other, kind, level) {
        let mut by_key: HashMap<_, _> = other.into_iter().map(|p| (p.key, p)).collect();
        let fault = |key: &RowKey, path: &Path, problem| CcmError::Rows {
            path: path.to_path_buf(),
            problem,
            rows: key.to_string(),
            expected: format!("the {} lines of {}", kind.rows.len(), kind.path.display()),
        };
        for estimate in &mut estimates {
            let found = by_key.remove(&estimate.key);
            let found = found.ok_or_else(|| fault(&estimate.key, &level.path, "missing rows"))?;
            estimate.level = found.level;
            estimate.level_probabilities = found.level_probabilities;
        }
        if let Some(extra) = by_key.keys().min() {
            return Err(fault(extra, &level.path, "rows that the types lack"));
        }
        if rule != Rule::Separate {
            estimates.iter_mut().try_for_each(|e| together(e, rule == Rule::JointDryBoxes))?;
        }
    }
    Ok(estimates)
}

/// Estimates from probabilities of the joint class of type and level: its most probable class, and
/// the probabilities that it gives each type and level.
///
/// # Errors
/// As [`decide`].
pub fn decide_joint(table: &RecordingPredictions) -> Result<Vec<SubmissionRow>> {
    let what = "a filling such as 'pasta half', '1-1' or a joint class 0 to 6";
    let fillings = classes(table, Filling::parse, what)?;
    let into = |number: fn(&Filling) -> usize| fillings.iter().map(number).collect::<Vec<_>>();
    let kinds = table.merged(&into(|f| f.kind() as usize), FillingType::ALL.len())?;
    let levels = table.merged(&into(|f| f.level() as usize), FillingLevel::ALL.len())?;
    let mut estimates = blank(table)?;
    for (row, estimate) in estimates.iter_mut().enumerate() {
        let filling = table.rows[row].class.map(|class| fillings[class]);
        estimate.kind = filling.map(Filling::kind);
        estimate.level = filling.map(Filling::level);
        if table.rows[row].proba.is_some() {
            estimate.kind_probabilities = fixed(kinds.row(row));
            estimate.level_probabilities = fixed(levels.row(row));
        }
    }
    Ok(estimates)
}

fn of_kind(table: &RecordingPredictions) -> Result<Vec<SubmissionRow>> {
    let what = "a filling type: none, pasta, rice, water or 0 to 3";
    let classes = classes(table, FillingType::parse, what)?;
    let numbers: Vec<usize> = classes.iter().map(|&c| c as usize).collect();
    let merged = table.merged(&numbers, FillingType::ALL.len())?;
    let mut estimates = blank(table)?;
    for (row, estimate) in estimates.iter_mut().enumerate() {
        estimate.kind = table.rows[row].class.map(|class| classes[class]);
        estimate.kind_probabilities =
            table.rows[row].proba.as_ref().and_then(|_| fixed(merged.row(row)));
    }
    Ok(estimates)
}

fn of_level(table: &RecordingPredictions) -> Result<Vec<SubmissionRow>> {
    let what = "a filling level: empty, half, full, 0 to 2, 50 or 90";
    let classes = classes(table, FillingLevel::parse, what)?;
    let numbers: Vec<usize> = classes.iter().map(|&c| c as usize).collect();
    let merged = table.merged(&numbers, FillingLevel::ALL.len())?;
    let mut estimates = blank(table)?;
    for (row, estimate) in estimates.iter_mut().enumerate() {
        estimate.level = table.rows[row].class.map(|class| classes[class]);
        estimate.level_probabilities =
            table.rows[row].proba.as_ref().and_then(|_| fixed(merged.row(row)));
    }
    Ok(estimates)
}

fn fixed<const N: usize>(row: ArrayView1<'_, f64>) -> Option<[f64; N]> {
    row.to_vec().try_into().ok()
}

/// Nothing estimated, one for each line.
fn blank(table: &RecordingPredictions) -> Result<Vec<SubmissionRow>> {
    let mut seen = HashSet::new();
    let fault = |problem, rows: String| CcmError::Rows {
        path: table.path.clone(),
        problem,
        rows,
        expected: "the recordings".into(),
    };
    let key = |name: &RowName| match name {
        RowName::Other(id) => {
            Err(fault("a row that names no recording of the data set", id.clone()))
        }
        RowName::Recording(RowKey::Sequence(number, _)) if Container::new(*number).is_none() => {
            Err(fault("a row of no container of the data set", number.to_string()))
        }
        RowName::Recording(key) if !seen.insert(*key) => {
            Err(fault("more than one row", key.to_string()))
        }
        RowName::Recording(key) => Ok(SubmissionRow::empty(*key)),
    };
    table.rows.iter().map(|row| &row.key).map(key).collect()
}

/// Replaces type and level by the best feasible pair, where both have probabilities.
fn together(estimate: &mut SubmissionRow, dry_boxes: bool) -> Result<()> {
    let both = estimate.kind_probabilities.zip(estimate.level_probabilities);
    let Some((kinds, levels)) = both else { return Ok(()) };
    let container = match estimate.key {
        RowKey::Sequence(number, _) => Container::new(number),
        RowKey::Id(_) => None,
    };
    let is_box = container.is_some_and(|c| c.category() == Category::Box);
    let feasible: Vec<(usize, usize)> = Filling::all()
        .filter(|f| !(dry_boxes && is_box && f.kind() == FillingType::Water))
        .map(|f| (f.kind() as usize, f.level() as usize))
        .collect();
    let row = |p: &[f64]| Array2::from_shape_fn((1, p.len()), |(_, c)| p[c]);
    let (kinds, levels) = (row(&kinds), row(&levels));
    let pairs = fusion::joint_decision(kinds.view(), levels.view(), &feasible)
        .map_err(|e| CcmError::Request(format!("joint decision: {e}")))?;
    for (kind, level) in pairs {
        estimate.kind = FillingType::from_number(kind as i64);
        estimate.level = FillingLevel::from_number(level as i64);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> RecordingPredictions {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        crate::predictions::read(file.path()).unwrap()
    }

    #[test]
    fn the_joint_decision_is_feasible_and_keeps_boxes_dry() {
        let kind = table("Object,Sequence,p0,p1,p2,p3\n10,0,.5,.4,.1,0\n12,0,0,.3,.2,.5\n");
        let level = table("Object,Sequence,p0,p1,p2\n12,0,0,.4,.6\n10,0,.1,.6,.3\n");
        let pairs = |rule| -> Vec<(usize, usize)> {
            let found = decide(Some(&kind), Some(&level), rule).unwrap();
            found.iter().map(|p| (p.kind.unwrap() as usize, p.level.unwrap() as usize)).collect()
        };
        assert_eq!(pairs(Rule::Separate), [(0, 1), (3, 2)]);
        assert_eq!(pairs(Rule::Joint), [(1, 1), (3, 2)]);
        assert_eq!(pairs(Rule::JointDryBoxes), [(1, 1), (1, 2)]);
        let only = decide(Some(&kind), None, Rule::Joint).unwrap();
        assert!(only.iter().all(|p| p.level.is_none() && p.kind.is_some()));
    }

    #[test]
    fn joint_classes_give_both() {
        let names: Vec<String> = Filling::all().map(|f| format!("p_{}", f.name())).collect();
        let text = format!("id,{}\n10/0003,.1,.1,.2,.25,.2,.1,.05\n", names.join(","));
        let found = decide_joint(&table(&text)).unwrap();
        assert_eq!(found[0].key, RowKey::Sequence(10, 3));
        assert_eq!(
            (found[0].kind, found[0].level),
            (Some(FillingType::Rice), Some(FillingLevel::Half))
        );
        let kinds = found[0].kind_probabilities.unwrap();
        assert!((kinds[2] - 0.45).abs() < 1e-12 && (kinds.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn rows_and_classes_must_be_those_of_the_data_set() {
        let message = |text: &str| decide(Some(&table(text)), None, Rule::Separate).unwrap_err();
        let tea = message("id,p_none,p_tea\n10/0003,1,0\n").to_string();
        assert!(tea.contains("class 'tea' is not a filling type"), "{tea}");
        let odd = message("id,p_none,p_rice\nhello,1,0\n").to_string();
        assert!(odd.contains("names no recording of the data set: hello"), "{odd}");
        let kind = table("Object,Sequence,p0,p1\n10,0,1,0\n");
        let level = table("Object,Sequence,p0,p1\n10,1,1,0\n");
        let other = decide(Some(&kind), Some(&level), Rule::Joint).unwrap_err().to_string();
        assert!(other.contains("missing rows: container 10 sequence 0"), "{other}");
    }
}
