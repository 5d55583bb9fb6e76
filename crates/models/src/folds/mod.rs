//! Which rows are held out together.

use std::collections::{HashMap, HashSet};
use std::fmt;

use crate::copies;
use crate::cv_plan::CvPlan;
use crate::dataset::{LabelledTable, Result};
use crate::error::ModelError;
use crate::groups::{self, RECORDING};
use crate::labels::{Labels, alike, is_missing, measured, missing};
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
    /// what inner folds keep whole instead
    choice: Option<Choice>,
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
        let recordings = groups::recordings(table, target);
        let default = match (groups.or_else(|| groups::usual(table, target)), recordings) {
            (Some(column), _) => CvPlan::Group(column.into()),
            (None, Some(recordings)) => {
                CvPlan::K(FOLDS.min(Labels::of(&table.column(recordings)?).0.len()))
            }
            (None, None) => CvPlan::K(FOLDS),
        };
        let plan = plan.unwrap_or(&default);
        let named = groups;
        let recordings = recordings.filter(|_| !matches!(plan, CvPlan::Lists(_)));
        let groups = named.or(match plan {
            CvPlan::Group(column) => Some(column),
            CvPlan::Fold(folds) => groups::kept(table, target, (folds, recordings)).or(recordings),
            _ => recordings,
        });
        let column = match plan {
            CvPlan::Group(column) | CvPlan::Fold(column) => Some(column.as_str()),
            CvPlan::K(_) | CvPlan::Lists(_) => groups,
        };
        let parts = column.map(|c| groups::values(table, c, ELSE)).transpose()?;
        let outer = match (plan, &parts) {
            (CvPlan::Group(_) | CvPlan::Fold(_), Some(g)) => splits::leave_one_group_out(g)?,
            (CvPlan::K(k), Some(g)) => splits::group_k_fold(g, *k)
                .map_err(|error| too_few(error, column.filter(|_| named.is_none())))?,
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
                refuse_split(&outer, &values, (plan, groups), column.filter(|_| named.is_none()))?;
                Some(values)
            }
            _ => parts,
        };
        let is_finer = named.is_none() && matches!(plan, CvPlan::Group(_) | CvPlan::Fold(_));
        if let Some(recordings) = recordings.filter(|_| is_finer) {
            let values = groups::values(table, recordings, ELSE)?;
            refuse_split(&outer, &values, (plan, recordings), column)?;
        }
        let choice = match (named, groups, recordings) {
            (None, Some(groups), Some(recordings)) if groups != recordings => {
                Choice::of(&outer, (groups, kept.as_deref()), (recordings, table))?
            }
            _ => None,
        };
        let mut odd = alike(labels);
        odd.extend(measured(labels, classes.len()));
        if kept.is_none() {
            odd.extend(neighbours(table, target, &outer));
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
        Ok(Self { description, outer, groups: kept, choice, odd, are_folds, names, seed })
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
            let values_of = groups::values(table, recordings, otherwise)?;
            let held_out = splits::leave_one_group_out(values)?;
            refuse_split(&held_out, &values_of, (&"inner folds", recordings), column)?;
        }
        let groups = values;
        let (outer, odd, names) = (Vec::new(), Vec::new(), labels.names().to_vec());
        let description = "inner folds".into();
        let (choice, are_folds) = (None, false);
        Ok(Self { description, outer, groups, choice, odd, are_folds, names, seed })
    }

    /// What is never split, one name per row; `None` where any row may be held out.
    pub fn groups(&self) -> Option<&[String]> {
        self.groups.as_deref()
    }

    /// What inner folds keep whole: the groups, or the recordings where some fold trains on one group alone.
    pub fn choice_groups(&self) -> Option<&[String]> {
        match &self.choice {
            Some(choice) => Some(&choice.recordings),
            None => self.groups(),
        }
    }

    /// What those should know who choose parameters or epochs inside the folds.
    pub fn choice_warning(&self) -> Option<&str> {
        self.choice.as_ref().map(|choice| choice.warning.as_str())
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
        let Some(groups) = self.choice_groups() else {
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

/// What parameters are chosen on where some fold trains on one group alone.
#[derive(Clone, Debug)]
struct Choice {
    recordings: Vec<String>,
    warning: String,
}

impl Choice {
    /// The recordings, where they are needed.
    fn of(
        outer: &[Fold],
        (column, groups): (&str, Option<&[String]>),
        (recordings, table): (&str, &LabelledTable),
    ) -> Result<Option<Self>> {
        let Some(groups) = groups else { return Ok(None) };
        let is_one = |fold: &&Fold| {
            let mut trained = fold.train.iter().map(|&row| &groups[row]);
            let first = trained.next();
            trained.all(|group| Some(group) == first)
        };
        let Some(fold) = outer.iter().find(is_one) else { return Ok(None) };
        let warning = format!(
            "fold {} trains on one {column} alone, so inner folds hold out values of {recordings}: what is chosen may \
             suit no other {column}",
            fold.name
        );
        let recordings = groups::values(table, recordings, ELSE)?;
        Ok(Some(Self { recordings, warning }))
    }
}

/// Names the column that was not asked for in a refusal of too few groups.
fn too_few(error: ModelError, column: Option<&str>) -> ModelError {
    match (error, column) {
        (ModelError::TooFewGroups { groups, folds }, Some(column)) => {
            let reason = format!(
                "rows that share a value of {column} stay together, and {groups} values are too few for {folds} \
                 folds: ask for at most {groups}"
            );
            ModelError::Folds { reason }
        }
        (error, _) => error,
    }
}

/// That rows of one recording, as far as it is known, are in both training and test.
fn neighbours(
    table: &LabelledTable,
    target: (&Labels, &Classes),
    outer: &[Fold],
) -> Option<String> {
    if table.ids.len() < 2 {
        return None;
    }
    let is_one =
        |column: &str| table.column(column).is_ok_and(|values| Labels::of(&values).0.len() == 1);
    if is_one(RECORDING) || table.shared_ids().is_some_and(is_one) {
        return Some(ONE_RECORDING.into());
    }
    let ids = table.shared_ids().filter(|ids| !groups::is_target(table, ids, target))?;
    let values = table.column(ids).ok().filter(|values| splits_any(outer, values))?;
    let why = match missing(&values) {
        0 => "all rows of a class have the same one".into(),
        rows => format!("{} without one", count(rows, "row")),
    };
    Some(format!(
        "rows of one {ids} are in both training and test ({why}): if they are parts of one recording, the scores are \
         better than they would be on other recordings"
    ))
}

/// Refuses folds that hold out a part of a group; as groups, the column `allowed` would allow it.
fn refuse_split(
    folds: &[Fold],
    groups: &[String],
    (plan, column): (&dyn fmt::Display, &str),
    allowed: Option<&str>,
) -> Result<()> {
    let mut fold_of: HashMap<&str, &str> = HashMap::new();
    for fold in folds {
        for &row in &fold.test {
            let other = *fold_of.entry(&groups[row]).or_insert(&fold.name);
            if other != fold.name {
                let remedy = match allowed {
                    None => "--groups must not be split".into(),
                    Some(allowed) => format!("--groups {allowed} allows it"),
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
mod tests;
