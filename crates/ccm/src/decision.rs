//! From class probabilities to estimates of type and level.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use corsmal_models::fusion;
use corsmal_models::predictions::PredictionRow;
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
    /// As [`Rule::Joint`], and no water in food boxes.
    JointDryBoxes,
}

/// Containers of recordings that are named by a number.
pub type Containers = HashMap<RowKey, Container>;

/// Estimates from probabilities of the type, of the level, or of both over the same recordings.
/// `containers` are needed for dry boxes where names do not say of which container a recording is.
///
/// # Errors
/// [`CcmError`] for class names that are no types or levels, lines that are no recording of the data
/// set or occur twice, recordings that one table has and the other has not, and, unless the rule is
/// [`Rule::Separate`], classes without probabilities.
pub fn decide(
    kind: Option<&RecordingPredictions>,
    level: Option<&RecordingPredictions>,
    rule: Rule,
    containers: &Containers,
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
            for table in [kind, level] {
                if let Some(row) =
                    table.rows.iter().find(|r| r.class.is_some() && r.proba.is_none())
                {
                    return Err(CcmError::Request(format!(
                        "{}: {} has no probabilities, which feasible pairs need",
                        table.path.display(),
                        row.key
                    )));
                }
            }
            for estimate in &mut estimates {
                let both = estimate.kind_probabilities.zip(estimate.level_probabilities);
                let Some(both) = both else { continue };
                let is_box = rule == Rule::JointDryBoxes && is_box(estimate.key, containers)?;
                together(estimate, both, is_box)?;
            }
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
        if is_predicted(&table.rows[row]) {
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
        if is_predicted(&table.rows[row]) {
            estimate.kind_probabilities = fixed(merged.row(row));
        }
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
        if is_predicted(&table.rows[row]) {
            estimate.level_probabilities = fixed(merged.row(row));
        }
    }
    Ok(estimates)
}

/// Whether a prediction with probabilities was not rejected: those of a rejected one are withheld.
fn is_predicted<K>(row: &PredictionRow<K>) -> bool {
    row.class.is_some() && row.proba.is_some()
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

fn is_box(key: RowKey, containers: &Containers) -> Result<bool> {
    let container = match key {
        RowKey::Sequence(number, _) => Container::new(number),
        RowKey::Id(_) => containers.get(&key).copied(),
    };
    container.map(|c| c.category() == Category::Box).ok_or_else(|| {
        CcmError::Request(format!(
            "whether the container of {key} is a box is not known: give --annotations, or name \
             recordings by container and sequence"
        ))
    })
}

/// Replaces type and level by the best feasible pair by the probabilities of both.
fn together(
    estimate: &mut SubmissionRow,
    (kinds, levels): ([f64; 4], [f64; 3]),
    dry: bool,
) -> Result<()> {
    let feasible: Vec<(usize, usize)> = Filling::all()
        .filter(|f| !(dry && f.kind() == FillingType::Water))
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
            let found = decide(Some(&kind), Some(&level), rule, &Containers::new()).unwrap();
            found.iter().map(|p| (p.kind.unwrap() as usize, p.level.unwrap() as usize)).collect()
        };
        assert_eq!(pairs(Rule::Separate), [(0, 1), (3, 2)]);
        assert_eq!(pairs(Rule::Joint), [(1, 1), (3, 2)]);
        assert_eq!(pairs(Rule::JointDryBoxes), [(1, 1), (1, 2)]);
        let only = decide(Some(&kind), None, Rule::Joint, &Containers::new()).unwrap();
        assert!(only.iter().all(|p| p.level.is_none() && p.kind.is_some()));
    }

    /// A feasible pair was made of the probabilities of a rejected prediction.
    #[test]
    fn rejected_predictions_are_in_no_pair() {
        let kind =
            table("id,predicted,p_none,p_rice,p_water\n0,unknown,.4,.3,.3\n1,rice,.1,.8,.1\n");
        let level =
            table("id,predicted,p_empty,p_half,p_full\n0,empty,.8,.1,.1\n1,half,.1,.8,.1\n");
        for rule in [Rule::Separate, Rule::Joint] {
            let found = decide(Some(&kind), Some(&level), rule, &Containers::new()).unwrap();
            assert_eq!((found[0].kind, found[0].kind_probabilities), (None, None));
            assert!(found[0].level.is_some() && found[1].kind.is_some());
        }
        let joint = table("id,predicted,p_0,p_1\n0,unknown,.5,.5\n1,1,.2,.8\n");
        let found = decide_joint(&joint).unwrap();
        assert_eq!((found[0].kind, found[0].level_probabilities), (None, None));
    }

    #[test]
    fn numbers_need_the_containers_of_the_annotations() {
        let kind = table("id,p_none,p_rice,p_water\n42,.2,.3,.5\n");
        let level = table("id,p_empty,p_half,p_full\n42,0,.4,.6\n");
        let with = |containers: &Containers| {
            decide(Some(&kind), Some(&level), Rule::JointDryBoxes, containers)
        };
        let refused = with(&Containers::new()).unwrap_err().to_string();
        assert!(refused.contains("id 42") && refused.contains("--annotations"), "{refused}");
        for (number, expected) in [(7, FillingType::Rice), (1, FillingType::Water)] {
            let containers = [(RowKey::Id(42), Container::new(number).unwrap())].into();
            assert_eq!(with(&containers).unwrap()[0].kind, Some(expected), "container {number}");
        }
    }

    #[test]
    fn a_class_without_probabilities_has_no_feasible_pair() {
        let none = Containers::new();
        let sure = table("id,predicted,p_none,p_rice\n4,rice,.4,.6\n5,,,\n");
        for (kind, level) in [
            ("id,predicted\n4,none\n5,\n", "id,predicted,p_empty,p_full\n4,full,.4,.6\n5,,,\n"),
            ("id,predicted,p_none,p_rice\n4,none,.6,.4\n5,,,\n", "id,predicted\n4,full\n5,\n"),
        ] {
            let (kind, level) = (table(kind), table(level));
            let refused = decide(Some(&kind), Some(&level), Rule::Joint, &none).unwrap_err();
            assert!(refused.to_string().contains("id 4 has no probabilities"), "{refused}");
            assert!(decide(Some(&kind), Some(&level), Rule::Separate, &none).is_ok());
        }
        let level = table("id,predicted,p_empty,p_full\n4,full,.4,.6\n5,,,\n");
        let found = decide(Some(&sure), Some(&level), Rule::Joint, &none).unwrap();
        assert_eq!((found[1].kind, found[1].level), (None, None), "failed in both");
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
        let none = Containers::new();
        let message =
            |text: &str| decide(Some(&table(text)), None, Rule::Separate, &none).unwrap_err();
        let tea = message("id,p_none,p_tea\n10/0003,1,0\n").to_string();
        assert!(tea.contains("class 'tea' is not a filling type"), "{tea}");
        let odd = message("id,p_none,p_rice\nhello,1,0\n").to_string();
        assert!(odd.contains("names no recording of the data set: hello"), "{odd}");
        let kind = table("Object,Sequence,p0,p1\n10,0,1,0\n");
        let level = table("Object,Sequence,p0,p1\n10,1,1,0\n");
        let other = decide(Some(&kind), Some(&level), Rule::Joint, &none).unwrap_err().to_string();
        assert!(other.contains("missing rows: container 10 sequence 0"), "{other}");
    }
}
