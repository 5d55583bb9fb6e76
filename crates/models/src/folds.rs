//! Which rows are held out together.

use std::collections::{HashMap, HashSet};
use std::fmt;

use crate::copies;
use crate::cv_plan::CvPlan;
use crate::dataset::{LabelledTable, Result};
use crate::error::ModelError;
use crate::groups::{self, RECORDING};
use crate::labels::{Labels, alike, is_missing, measured};
use crate::splits::{self, Fold};
use crate::targets::Classes;
use crate::words::count;

/// Inner folds of a choice, and folds without groups, unless there are fewer groups.
const FOLDS: usize = 5;

/// What to do with rows without a group, besides.
const ELSE: &str = "; --cv 5 without --groups needs none";

/// Said where there is nothing else to hold out.
const ONE_RECORDING: &str = "all rows are parts of one recording, so training and test rows are \
    neighbours: the scores are better than they would be on other recordings";

/// Outer folds and what inner folds are made of.
#[derive(Clone, Debug)]
pub struct Folds {
    /// in words
    pub description: String,
    /// the folds scored
    pub outer: Vec<Fold>,
    /// never split, one name per row
    groups: Option<Vec<String>>,
    /// what is odd about them, in words
    odd: Vec<String>,
    /// whether these groups are no more than the folds of a column
    are_folds: bool,
    /// of the classes
    names: Vec<String>,
    seed: u32,
}

impl Folds {
    /// Carries out a plan; without one, each group once where there are groups (`groups`, or a
    /// column called container or group, but for the target), else stratified folds.
    ///
    /// # Errors
    /// Columns that are not there, groups that the folds would split, classes with too few rows.
    pub fn new(
        plan: Option<&CvPlan>,
        table: &LabelledTable,
        groups: Option<&str>,
        (labels, classes): (&Labels, &Classes),
        seed: u32,
    ) -> Result<Self> {
        let y = &classes.indices().to_vec();
        let target = (labels, classes);
        let is_default = plan.is_none();
        let default = match groups.or_else(|| groups::usual(table, target)) {
            Some(column) => CvPlan::Group(column.into()),
            None => CvPlan::K(FOLDS),
        };
        let plan = plan.unwrap_or(&default);
        let named = groups;
        let recordings =
            groups::recordings(table, target).filter(|_| !matches!(plan, CvPlan::Lists(_)));
        let groups = named.or(match plan {
            CvPlan::Group(column) => Some(column),
            CvPlan::Fold(folds) => groups::kept(table, target, folds).or(recordings),
            _ => recordings,
        });
        let column = match plan {
            CvPlan::Group(column) | CvPlan::Fold(column) => Some(column.as_str()),
            CvPlan::K(_) | CvPlan::Lists(_) => groups,
        };
        let parts = column.map(|c| groups::values(table, c, ELSE)).transpose()?;
        let outer = match (plan, &parts) {
            (CvPlan::Group(_) | CvPlan::Fold(_), Some(g)) => splits::leave_one_group_out(g)?,
            (CvPlan::K(k), Some(g)) => splits::group_k_fold(g, *k)?,
            (CvPlan::Lists(lists), Some(g)) => splits::group_lists(g, lists)?,
            (CvPlan::K(k), None) => stratified(labels, y, *k, seed)?,
            _ => {
                let reason = "which column are the values in the lists from? Name it with \
                              --groups"
                    .into();
                return Err(ModelError::Folds { reason }.into());
            }
        };
        let description = match (plan, column) {
            (CvPlan::K(_), None) => format!("{plan}, stratified, seed {seed}"),
            (CvPlan::K(_) | CvPlan::Lists(_), Some(column)) => format!("{plan} ({column})"),
            _ => plan.to_string(),
        };
        let kept = match groups {
            Some(groups) if column != Some(groups) => {
                let values = groups::values(table, groups, ELSE)?;
                refuse_split(&outer, &values, (plan, groups), named.is_some())?;
                Some(values)
            }
            _ => parts,
        };
        let is_finer = named.is_none() && matches!(plan, CvPlan::Group(_) | CvPlan::Fold(_));
        if let Some(recordings) = recordings.filter(|_| is_finer) {
            let values = groups::values(table, recordings, ELSE)?;
            refuse_split(&outer, &values, (plan, recordings), false)?;
        }
        let one = kept.is_none()
            && table.ids.len() > 1
            && table.column(RECORDING).is_ok_and(|values| Labels::of(&values).0.len() == 1);
        let mut odd = alike(labels);
        odd.extend(measured(labels, classes.len()));
        if one {
            odd.push(ONE_RECORDING.into());
        }
        if named.is_none() {
            let is_split = |column: &&str| {
                let values = table.column(column);
                !groups::is_target(table, column, target)
                    && values.is_ok_and(|values| splits_any(&outer, &values))
            };
            let keeps = is_default || matches!(plan, CvPlan::K(_));
            odd.extend(groups::USUAL.into_iter().filter(is_split).map(|groups| {
                let so = match keeps {
                    true => format!("--groups {groups} keeps them together"),
                    false => format!("the scores are not those of a new {groups}"),
                };
                format!("rows of one {groups} are in both training and test: {so}")
            }));
        }
        odd.extend(copies::warning(table, &outer));
        let are_folds = matches!(plan, CvPlan::Fold(_)) && groups.is_none();
        let names = labels.names().to_vec();
        Ok(Self { description, outer, groups: kept, odd, are_folds, names, seed })
    }

    /// Inner folds alone, for choosing parameters on all rows.
    ///
    /// # Errors
    /// Columns that are not there, rows without a group.
    pub fn for_choice(
        table: &LabelledTable,
        groups: Option<&str>,
        (labels, classes): (&Labels, &Classes),
        seed: u32,
    ) -> Result<Self> {
        let target = (labels, classes);
        let column = groups
            .or_else(|| groups::usual(table, target))
            .or_else(|| groups::recordings(table, target));
        let otherwise = "; without --tune, no groups are needed";
        let values = column.map(|column| groups::values(table, column, otherwise)).transpose()?;
        let recordings = groups::recordings(table, target);
        if let (None, Some(values), Some(recordings)) = (groups, &values, recordings) {
            let recordings = groups::values(table, recordings, otherwise)?;
            let held_out = splits::leave_one_group_out(values)?;
            refuse_split(&held_out, &recordings, (&"inner folds", RECORDING), false)?;
        }
        let groups = values;
        let (outer, odd, names) = (Vec::new(), Vec::new(), labels.names().to_vec());
        let description = "inner folds".into();
        Ok(Self { description, outer, groups, odd, are_folds: false, names, seed })
    }

    /// What is never split, one name per row; `None` where any row may be held out.
    pub fn groups(&self) -> Option<&[String]> {
        self.groups.as_deref()
    }

    /// What rows belong to that are not independent of each other: the groups, unless they are no
    /// more than the folds of `fold=COLUMN`. A bootstrap draws them together.
    pub fn dependent(&self) -> Option<&[String]> {
        self.groups().filter(|_| !self.are_folds)
    }

    /// Folds inside these rows, of whole groups where there are groups. Row numbers are positions
    /// in `rows`.
    ///
    /// # Errors
    /// [`ModelError::Folds`] for a class with a single row.
    pub fn inner(&self, rows: &[usize], classes: &Classes) -> crate::Result<Vec<Fold>> {
        let y = classes.indices();
        let Some(groups) = &self.groups else {
            let inside: Vec<usize> = rows.iter().map(|&row| y[row]).collect();
            let count = |class| inside.iter().filter(|&&c| c == class).count();
            let counts = (0..self.names.len()).map(|class| (count(class), class));
            let Some((fewest, class)) = counts.filter(|(n, _)| *n > 0).min() else {
                return splits::stratified_k_fold(&inside, FOLDS, Some(self.seed));
            };
            if fewest < 2 {
                let name = &self.names[class];
                let reason =
                    format!("class {name} has 1 row for choosing parameters; 2 are needed");
                return Err(ModelError::Folds { reason });
            }
            return splits::stratified_k_fold(&inside, fewest.min(FOLDS), Some(self.seed));
        };
        let inside: Vec<&str> = rows.iter().map(|&row| groups[row].as_str()).collect();
        let different = Labels::of(&inside).0.len();
        if different < 2 {
            let reason = "the training rows are all of one group, so parameters cannot be chosen on other groups \
                          than they were fitted to: leave out --tune, or name finer groups with --groups"
                .into();
            return Err(ModelError::Folds { reason });
        }
        splits::group_k_fold(&inside, different.clamp(2, FOLDS))
    }

    /// What is odd, in words: classes that look the same, rows that are all parts of one recording or
    /// copies of one another, classes that some fold tests without having trained on them.
    pub fn warnings(&self, classes: &Classes) -> Vec<String> {
        let untrained = self.untrained(classes);
        let of_fold = untrained.chunk_by(|(_, a), (_, b)| a == b).map(|classes| {
            let (class, fold) = classes[0];
            let first = &self.names[class];
            match classes.len() {
                1 => format!("fold {fold}: class {first} has no training rows"),
                n => format!("fold {fold}: {n} classes have no training rows, such as {first}"),
            }
        });
        self.odd.iter().cloned().chain(of_fold).collect()
    }

    /// Classes that some fold tests without having trained on them, each with the fold.
    fn untrained(&self, classes: &Classes) -> Vec<(usize, &str)> {
        let y = classes.indices();
        let mut found = Vec::new();
        for fold in &self.outer {
            let trained: Vec<usize> = fold.train.iter().map(|&row| y[row]).collect();
            let mut tested: Vec<usize> = fold.test.iter().map(|&row| y[row]).collect();
            tested.sort_unstable();
            tested.dedup();
            tested.retain(|class| !trained.contains(class));
            found.extend(tested.into_iter().map(|class| (class, fold.name.as_str())));
        }
        found
    }
}

/// Refuses folds that hold out a part of a group; `is_named` says that the user chose the column.
fn refuse_split(
    folds: &[Fold],
    groups: &[String],
    (plan, column): (&dyn fmt::Display, &str),
    is_named: bool,
) -> Result<()> {
    let mut fold_of: HashMap<&str, &str> = HashMap::new();
    for fold in folds {
        for &row in &fold.test {
            let other = *fold_of.entry(&groups[row]).or_insert(&fold.name);
            if other != fold.name {
                let remedy = match is_named {
                    true => "--groups must not be split",
                    false => "to allow this, name the groups with --groups",
                };
                let reason = format!(
                    "{plan}: {column} {} is in the folds {other} and {}; {remedy}",
                    groups[row], fold.name
                );
                return Err(ModelError::Folds { reason }.into());
            }
        }
    }
    Ok(())
}

/// Whether some fold tests a value that it also trains on.
fn splits_any(folds: &[Fold], values: &[String]) -> bool {
    folds.iter().any(|fold| {
        let trained: HashSet<&String> = fold.train.iter().map(|&row| &values[row]).collect();
        fold.test.iter().any(|&row| !is_missing(&values[row]) && trained.contains(&values[row]))
    })
}

fn stratified(labels: &Labels, y: &[usize], k: usize, seed: u32) -> Result<Vec<Fold>> {
    for (class, name) in labels.names().iter().enumerate() {
        let rows = y.iter().filter(|&&c| c == class).count();
        if rows < k {
            let advice = match rows {
                0 | 1 => "leave the class out or add rows".into(),
                _ => format!("--cv {rows} makes {rows} folds"),
            };
            let rows = count(rows, "row");
            let reason =
                format!("class {name} has {rows}, too few for {k} stratified folds: {advice}");
            return Err(ModelError::Folds { reason }.into());
        }
    }
    Ok(splits::stratified_k_fold(y, k, Some(seed))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four rows, r0 to r3, with these columns.
    fn table<const N: usize>(columns: [(&str, [&str; 4]); N]) -> LabelledTable {
        let owned = |values: [&str; 4]| values.map(String::from).to_vec();
        let columns = columns.map(|(name, values)| (name.to_string(), owned(values)));
        let ids = owned(["r0", "r1", "r2", "r3"]);
        LabelledTable::of_columns(std::path::Path::new("x.npz"), ids, columns.to_vec())
    }

    #[test]
    fn rows_without_a_group_or_fold_are_refused() {
        let table = table([("y", ["a", "b", "a", "b"]), ("f", ["1", "", "2", "NaN"])]);
        let (labels, classes) = table.classes("y").unwrap();
        let folds = |plan: &str, groups| {
            let plan: CvPlan = plan.parse().unwrap();
            Folds::new(Some(&plan), &table, groups, (&labels, &classes), 0)
        };
        for (plan, groups) in [("fold=f", None), ("group=f", None), ("2", Some("f"))] {
            let refused = folds(plan, groups).unwrap_err().to_string();
            let expected = "2 rows without f of 4, the first is r1";
            assert!(refused.contains(expected), "{plan}: {refused}");
        }
        assert!(folds("2", None).is_ok());
    }

    /// Windows of recordings: the recordings were the groups, not what contains them.
    #[test]
    fn containers_of_windows_are_groups() {
        let windows = table([
            ("y", ["a", "b", "a", "b"]),
            ("recording", ["r1", "r2", "r3", "r4"]),
            ("container", ["1", "1", "2", "2"]),
        ]);
        let (labels, classes) = windows.classes("y").unwrap();
        let folds = |plan: Option<&CvPlan>, groups| {
            Folds::new(plan, &windows, groups, (&labels, &classes), 0).unwrap()
        };
        let containers = Some(&["1", "1", "2", "2"].map(String::from)[..]);
        assert_eq!(folds(None, None).dependent(), containers);
        assert_eq!(folds(Some(&CvPlan::Group("container".into())), None).dependent(), containers);
        assert_eq!(folds(None, Some("container")).dependent(), containers);
        let choice = Folds::for_choice(&windows, None, (&labels, &classes), 0).unwrap();
        assert_eq!(choice.groups(), containers);
        let said = folds(Some(&CvPlan::K(2)), None).warnings(&classes).join(" ");
        assert!(said.contains("--groups container"), "{said}");
        // Of two usual columns the first is taken, whether or not it splits the other.
        let both = table([
            ("y", ["a", "b", "a", "b"]),
            ("container", ["1", "1", "2", "2"]),
            ("group", ["p", "q", "p", "q"]),
            ("half", ["1", "2", "2", "1"]),
        ]);
        let (labels, classes) = both.classes("y").unwrap();
        let said = |plan: Option<&CvPlan>| {
            let found = Folds::new(plan, &both, None, (&labels, &classes), 0).unwrap();
            found.warnings(&classes).join(" ")
        };
        let split = "rows of one group are in both training and test: --groups group";
        assert!(said(None).contains(split), "{}", said(None));
        let halves = said(Some(&CvPlan::Fold("half".into())));
        assert!(halves.contains("the scores are not those of a new container"), "{halves}");
        // A recording that belongs to two groups is split by them.
        let odd = table([
            ("y", ["a", "b", "a", "b"]),
            ("recording", ["r1", "r1", "r2", "r2"]),
            ("container", ["1", "2", "2", "1"]),
        ]);
        let (labels, classes) = odd.classes("y").unwrap();
        let split = Folds::new(None, &odd, None, (&labels, &classes), 0).unwrap_err().to_string();
        assert!(split.contains("recording r1 is in the folds 1 and 2"), "{split}");
    }

    #[test]
    fn groups_that_a_plan_splits_are_said_and_the_target_is_none() {
        let grouped = table([("container", ["a", "b", "a", "b"]), ("group", ["1", "1", "2", "2"])]);
        let (labels, classes) = grouped.classes("container").unwrap();
        let folds = |plan: Option<&CvPlan>, groups| {
            Folds::new(plan, &grouped, groups, (&labels, &classes), 0).unwrap()
        };
        assert_eq!(folds(None, None).description, "each group once");
        let said = folds(Some(&CvPlan::K(2)), None).warnings(&classes).join(" ");
        assert!(
            said.contains("one group are in both") && said.contains("--groups group"),
            "{said}"
        );
        let kept = folds(Some(&CvPlan::K(2)), Some("group")).warnings(&classes).join(" ");
        assert!(!kept.contains("--groups"), "{kept}");

        // A target of this name was its own groups: each fold was of a class that no other had.
        let sound = ["studio", "phone", "studio", "phone"];
        let named = table([("recording", sound)]);
        let (of_sound, sounds) = named.classes("recording").unwrap();
        let found = Folds::new(Some(&CvPlan::K(2)), &named, None, (&of_sound, &sounds), 0).unwrap();
        assert!(found.description.contains("stratified"), "{}", found.description);

        let apart = table([("y", ["a", "b", "a", "b"]), ("group", ["1", "2", "3", ""])]);
        let (y, of_y) = apart.classes("y").unwrap();
        let whole = Folds::new(Some(&CvPlan::K(2)), &apart, None, (&y, &of_y), 0).unwrap();
        assert!(!whole.warnings(&of_y).join(" ").contains("--groups"), "no group has two rows");

        let by_group = folds(None, None);
        let refused = by_group.inner(&[0, 1], &classes).unwrap_err().to_string();
        assert!(refused.contains("all of one group") && refused.contains("--tune"), "{refused}");
    }
}
