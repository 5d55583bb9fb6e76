//! What stands in for tasks that a submission does not address.

use std::collections::HashSet;
use std::path::Path;

use super::{Format, RowKey, Submission, pseudo_random};
use crate::dataset::{Annotations, Container, Subset};
use crate::error::Result;
use crate::scores::RuleSet;
use crate::table::Table;

const RANDOM1_TRAINING: &[u8] = include_bytes!("../../data/stand_ins/random1-training.csv");
const RANDOM1_PUBLIC: &[u8] = include_bytes!("../../data/stand_ins/random1-public-test.csv");
const RANDOM1_PRIVATE: &[u8] = include_bytes!("../../data/stand_ins/random1-private-test.csv");
const RANDOM123: &[u8] = include_bytes!("../../data/stand_ins/random123-training.csv");

/// The stand-in that the official evaluator of these rules uses for the recordings of
/// `annotations`: random1.csv of their part, or random123.csv of 2020; `None` where there is none for
/// every one of them.
///
/// # Errors
/// None for the files that come with this crate; [`crate::CcmError`] if one could not be read.
pub fn official_stand_in(annotations: &Annotations, rules: RuleSet) -> Result<Option<Submission>> {
    let subset = |number: u8| Container::new(number).map(Container::subset);
    let mut parts = annotations.rows.iter().map(|row| subset(row.container));
    let Some(Some(part)) = parts.next() else { return Ok(None) };
    if parts.any(|other| other != Some(part)) {
        return Ok(None);
    }
    let (name, bytes) = match (rules, part) {
        (RuleSet::Toolkit | RuleSet::Toolkit202111, Subset::Training) => {
            ("the official random1.csv", RANDOM1_TRAINING)
        }
        (RuleSet::Toolkit | RuleSet::Toolkit202111, Subset::Public) => {
            ("the official random1.csv", RANDOM1_PUBLIC)
        }
        (RuleSet::Toolkit | RuleSet::Toolkit202111, Subset::Private) => {
            ("the official random1.csv", RANDOM1_PRIVATE)
        }
        (RuleSet::Paper | RuleSet::Toolkit202010, Subset::Training) => {
            ("the official random123.csv", RANDOM123)
        }
        (RuleSet::Paper | RuleSet::Toolkit202010, _) => return Ok(None),
    };
    let whole = Submission::from_table(&Table::parse(bytes, Path::new(name))?)?;
    let key = |row: &crate::dataset::Annotation| match whole.format {
        Format::Y2022 => row.id.map(RowKey::Id),
        Format::Y2020 => row.sequence.map(|s| RowKey::Sequence(row.container, s)),
    };
    let Some(wanted) = annotations.rows.iter().map(key).collect::<Option<HashSet<_>>>() else {
        return Ok(None);
    };
    let rows: Vec<usize> =
        (0..whole.keys.len()).filter(|row| wanted.contains(&whole.keys[*row])).collect();
    Ok((rows.len() == wanted.len()).then(|| whole.select(&rows)))
}

/// What stands in for tasks that `submission` does not address: the official file, or
/// pseudo-random estimates where a seed is asked for or no official file fits (then of seed 1).
///
/// # Errors
/// As [`official_stand_in`].
pub fn stand_in(
    submission: &Submission,
    annotations: &Annotations,
    rules: RuleSet,
    seed: Option<u64>,
) -> Result<Submission> {
    if seed.is_none()
        && let Some(official) = official_stand_in(annotations, rules)?
    {
        return Ok(official);
    }
    let seed = seed.unwrap_or(1);
    let estimates = pseudo_random(&submission.keys, seed);
    let name = format!("pseudo-random estimates, seed {seed}");
    Ok(Submission::from_predictions(&name, submission.format, &estimates))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Annotation;

    fn annotated(container: u8, id: u32, sequence: Option<u16>) -> Annotation {
        Annotation {
            id: Some(id),
            container,
            sequence,
            scenario: None,
            background: None,
            illumination: None,
            dimensions: None,
            capacity_ml: -1.0,
            container_mass_g: -1.0,
            filling: None,
            density: 0.0,
            filling_mass_g: -1.0,
        }
    }

    fn of(rows: Vec<Annotation>) -> Annotations {
        Annotations { path: "a.csv".into(), rows, levels_in_percent: false }
    }

    #[test]
    fn each_part_has_its_own() {
        for (container, rows) in [(1, 684), (10, 228), (13, 228)] {
            let all = of((0..rows).map(|id| annotated(container, id, None)).collect());
            let found = official_stand_in(&all, RuleSet::Toolkit).unwrap().unwrap();
            assert_eq!(found.keys.len(), rows as usize);
            assert!(found.level.addressed() && found.capacity.addressed());
            let more = of((0..=rows).map(|id| annotated(container, id, None)).collect());
            assert!(official_stand_in(&more, RuleSet::Toolkit).unwrap().is_none());
        }
        // The file of 2020 names recordings by container and sequence.
        let one = |sequence| of(vec![annotated(3, 0, sequence)]);
        let found = official_stand_in(&one(Some(7)), RuleSet::Toolkit202010).unwrap().unwrap();
        assert_eq!(found.keys, [RowKey::Sequence(3, 7)]);
        assert!(official_stand_in(&one(None), RuleSet::Paper).unwrap().is_none());
        let mixed = of(vec![annotated(1, 0, None), annotated(10, 1, None)]);
        assert!(official_stand_in(&mixed, RuleSet::Toolkit).unwrap().is_none());
    }

    #[test]
    fn a_seed_asks_for_pseudo_random_estimates() {
        let annotations = of(vec![annotated(1, 0, None)]);
        let keys = [RowKey::Id(0)];
        let estimates = pseudo_random(&keys, 5);
        let submission = Submission::from_predictions("s", Format::Y2022, &estimates);
        let name = |seed| {
            let found = stand_in(&submission, &annotations, RuleSet::Toolkit, seed).unwrap();
            found.path.display().to_string()
        };
        assert_eq!(name(None), "the official random1.csv");
        assert_eq!(name(Some(5)), "pseudo-random estimates, seed 5");
    }
}
