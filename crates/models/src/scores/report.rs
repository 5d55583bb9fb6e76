//! Everything that a prediction file with true classes is scored by.

use std::collections::HashSet;
use std::fmt::Display;
use std::hash::Hash;

use ndarray::ArrayView1;
use serde::Serialize;

use super::curves::ClassCurves;
use super::doubts;
use super::interval::{Interval, intervals, units};
use super::reliability::Reliability;
use super::{NumericScores, Scores, Tally, no_estimate};
use crate::error::ModelError;
use crate::labels::{Labels, is_missing, missing, positions};
use crate::predictions::{PredictionError, PredictionTable};
use crate::words::count;

/// What is scored against what.
#[derive(Clone, Debug, PartialEq)]
pub struct Scoring {
    /// column of true classes; `true` where not given
    pub target: Option<String>,
    /// column of groups that are drawn together; a column `group`, `container` or `recording` where
    /// not given, else single rows
    pub groups: Option<String>,
    /// predictions with a highest probability below it are unknown
    pub reject: f64,
    /// whether the target is a number even where all its values are whole
    pub numeric: bool,
    /// draws of the bootstrap
    pub draws: usize,
    /// its seed
    pub seed: u64,
}

impl Default for Scoring {
    fn default() -> Self {
        Self { target: None, groups: None, reject: 0.0, numeric: false, draws: 2000, seed: 0 }
    }
}

/// Scores of a prediction file.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum ScoreReport {
    /// of classes
    Classes(Box<ClassReport>),
    /// of numbers
    Numbers(NumericScores),
}

/// Scores of classes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClassReport {
    /// names of the classes
    pub labels: Vec<String>,
    /// rows scored
    pub rows: usize,
    /// rows without a prediction, failed or rejected: they count as wrong
    pub unknown: usize,
    /// accuracy of the rows that have a prediction
    pub accuracy_of_known: f64,
    /// accuracy, F1, per class, confusion
    pub scores: Scores,
    /// 95 % bootstrap intervals
    pub intervals: ScoreIntervals,
    /// what was drawn: the name of a column, or `rows`
    pub drawn: String,
    /// number of different groups, or rows
    pub units: usize,
    /// scores of probabilities, over rows that have them
    pub calibration: Option<Reliability>,
    /// curves of each class against the others; absent where a class or all others have no rows
    pub curves: Option<Vec<Option<ClassCurves>>>,
    /// mean of the areas under the ROC curves (`roc_auc_score(multi_class="ovr")`)
    pub roc_auc: Option<f64>,
    /// mean of the average precisions
    pub average_precision: Option<f64>,
    /// what makes the scores doubtful; left out of JSON if there is nothing
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// Intervals of the scores over all classes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ScoreIntervals {
    /// of the accuracy
    pub accuracy: Interval,
    /// of the weighted F1
    pub weighted_f1: Interval,
    /// of the macro F1
    pub macro_f1: Interval,
}

/// Columns that are groups unless the user says otherwise.
const GROUPS: [&str; 3] = ["group", "container", "recording"];

impl<K: Clone + Eq + Hash + Ord + Display> PredictionTable<K> {
    /// Scores every line against its true class or number.
    ///
    /// # Errors
    /// [`PredictionError`] for missing columns or values, and recordings with several lines.
    pub fn score(&self, how: &Scoring) -> Result<ScoreReport, PredictionError> {
        let of_windows = self.check_windows()?;
        let truth = self.truth(how.target.as_deref())?;
        let grouped = self.groups(how.groups.as_deref(), how.target.as_deref())?;
        let (column, groups) =
            grouped.map_or((None, None), |(name, values)| (Some(name), Some(values)));
        // Windows of one recording are not independent of each other.
        let recordings: Option<Vec<String>> = (of_windows && groups.is_none())
            .then(|| self.rows.iter().map(|row| row.key.to_string()).collect());
        let groups = match &recordings {
            Some(names) => Some(names.iter().map(String::as_str).collect()),
            None => groups,
        };
        let by_default = if of_windows { "recording" } else { "rows" };
        let drawn = column.unwrap_or(by_default).to_string();
        let decimal = |text: &&str| text.parse::<f64>().is_ok() && text.parse::<i128>().is_err();
        let has_proba = self.rows.iter().any(|row| row.proba.is_some());
        // The name of one class may look like a number: others are no numbers, and are predicted.
        let is_name = |text: &&str| text.parse::<f64>().is_err();
        let names: HashSet<&str> = truth.iter().copied().filter(is_name).collect();
        let mut predicted = self.rows.iter().filter_map(|row| row.class);
        let are_classes = predicted.any(|class| names.contains(self.labels[class].as_str()));
        let numbers = !has_proba && truth.iter().any(decimal) && !are_classes;
        if !how.numeric {
            doubts::check_spelling(self, &truth, numbers)?;
        }
        if how.numeric || numbers {
            if how.reject > 0.0 {
                let reason = "numbers are scored; --reject is for classes";
                return Err(self.content(reason));
            }
            let numbers = self.score_numbers(&truth, (&drawn, groups.as_deref()), how)?;
            return Ok(ScoreReport::Numbers(numbers));
        }
        let report = self.score_classes(&truth, groups.as_deref(), drawn, how)?;
        Ok(ScoreReport::Classes(Box::new(report)))
    }

    /// Groups of rows that are not independent of each other: the column of that name, or else the first that
    /// is usual for them and has several values, unless it is the `target`.
    ///
    /// # Errors
    /// There is no such column, or a row has no group.
    pub(crate) fn groups<'t>(
        &'t self,
        wanted: Option<&'t str>,
        target: Option<&str>,
    ) -> Result<Option<(&'t str, Vec<&'t str>)>, PredictionError> {
        let usual = || self.usual_groups(target).map(|(_, column)| column);
        let Some(name) = wanted.or_else(usual) else { return Ok(None) };
        let values = self.column(name).ok_or_else(|| {
            let choices = corsmal_names::choices(name, self.columns.iter().map(String::as_str));
            self.content(format!("no column {name:?} of groups; {choices}"))
        })?;
        self.require_groups(name, &values)?;
        Ok(Some((name, values)))
    }

    /// The first usual column of groups that has several values and is not the target, and its rank
    /// among them.
    pub(crate) fn usual_groups(&self, target: Option<&str>) -> Option<(usize, &'static str)> {
        let several = |column: &str| {
            self.column(column).is_some_and(|values| Labels::of(&values).0.len() > 1)
        };
        let mut columns = GROUPS.into_iter().enumerate();
        columns.find(|&(_, column)| Some(column) != target && several(column))
    }

    /// Refuses rows without a group.
    pub(crate) fn require_groups(
        &self,
        name: &str,
        values: &[&str],
    ) -> Result<(), PredictionError> {
        let Some(first) = values.iter().position(|value| is_missing(value)) else { return Ok(()) };
        let (rows, id) = (count(missing(values), "row"), &self.rows[first].key);
        Err(self.content(format!(
            "{rows} without {name} of {}, the first is {id}: give every row one, or name other groups, such as id",
            values.len()
        )))
    }

    fn score_numbers(
        &self,
        truth: &[&str],
        drawn: (&str, Option<&[&str]>),
        how: &Scoring,
    ) -> Result<NumericScores, PredictionError> {
        let number = |what: &str, text: &str, row: usize| match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => {
                let id = &self.rows[row].cells[0];
                Err(self.content(format!("{id}: the {what} {text:?} is not a number")))
            }
        };
        let truths: Vec<f64> = truth
            .iter()
            .enumerate()
            .map(|(row, text)| number("true value", text, row))
            .collect::<Result<_, _>>()?;
        let none = no_estimate(&truths);
        let estimate = |(at, row): (usize, &crate::predictions::PredictionRow<K>)| {
            let text = row.class.map(|class| self.labels[class].as_str());
            let value = text.map(|text| number("estimate", text, at)).transpose()?;
            Ok(value.filter(|value| Some(*value) != none))
        };
        let estimates: Vec<Option<f64>> =
            self.rows.iter().enumerate().map(estimate).collect::<Result<_, PredictionError>>()?;
        if estimates.iter().all(Option::is_none) {
            let or = if none.is_some() { " (-1 stands for none)" } else { "" };
            return Err(self.content(format!("no row has an estimate{or}")));
        }
        let scores = NumericScores::new(&truths, &estimates, drawn, (how.draws, how.seed))
            .map_err(|e| self.model(e))?;
        Ok(NumericScores { warnings: self.unmatched.iter().cloned().collect(), ..scores })
    }

    fn score_classes(
        &self,
        truth: &[&str],
        groups: Option<&[&str]>,
        drawn: String,
        how: &Scoring,
    ) -> Result<ClassReport, PredictionError> {
        let mut table = self.clone();
        if how.reject > 0.0 {
            table.reject_below(how.reject)?;
        }
        // Classes that the model does not know are wrong whatever it says.
        let mut labels = self.labels.clone();
        let known = positions(&labels);
        let mut strange: Vec<&str> =
            truth.iter().copied().filter(|t| !known.contains_key(t)).collect();
        strange.sort_unstable();
        strange.dedup();
        labels.extend(strange.into_iter().map(String::from));
        let warnings = doubts::warnings(self, truth, &labels[self.labels.len()..]);
        let names = Labels::new(labels.clone()).map_err(|e| self.model(e))?;
        let truth = names.encode(truth).map_err(|e| self.model(e))?;
        let predicted: Vec<Option<usize>> = table.rows.iter().map(|row| row.class).collect();
        let scores = Scores::with_unknown(&truth, predicted.iter().copied(), labels.len());
        let scores = scores.map_err(|e: ModelError| self.model(e))?;
        let units = units(truth.len(), groups);
        let [accuracy, weighted_f1, macro_f1] = intervals(&units, how.draws, how.seed, |rows| {
            let pairs = rows.iter().map(|&row| (truth[row], predicted[row]));
            let tally = Tally::new(labels.len(), pairs);
            [tally.accuracy(), tally.weighted_f1(), tally.macro_f1()]
        });
        let known = predicted.iter().filter(|class| class.is_some()).count();
        let right = truth.iter().zip(&predicted).filter(|(t, p)| Some(**t) == **p).count();
        let with_proba: Vec<(usize, ArrayView1<'_, f64>)> = truth
            .iter()
            .zip(&self.rows)
            .filter_map(|(t, row)| Some((*t, ArrayView1::from(row.proba.as_deref()?))))
            .collect();
        let curves = (!with_proba.is_empty()).then(|| {
            let curve = |class: usize| {
                let rows: Vec<(f64, bool)> =
                    with_proba.iter().map(|(t, p)| (p[class], *t == class)).collect();
                ClassCurves::new(&rows)
            };
            (0..self.labels.len()).map(curve).collect::<Vec<_>>()
        });
        let mean = |area: fn(&ClassCurves) -> f64| {
            let areas: Vec<f64> = curves.as_ref()?.iter().flatten().map(area).collect();
            (!areas.is_empty()).then(|| areas.iter().sum::<f64>() / areas.len() as f64)
        };
        Ok(ClassReport {
            rows: truth.len(),
            unknown: truth.len() - known,
            accuracy_of_known: right as f64 / known.max(1) as f64,
            scores,
            intervals: ScoreIntervals { accuracy, weighted_f1, macro_f1 },
            drawn,
            units: units.len(),
            calibration: (!with_proba.is_empty())
                .then(|| Reliability::new(&with_proba, labels.len())),
            roc_auc: mean(|c| c.roc_auc),
            average_precision: mean(|c| c.average_precision),
            curves,
            labels,
            warnings,
        })
    }
}
