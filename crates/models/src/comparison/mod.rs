//! Whether two classifiers differ on the same rows.

mod groups;

use std::collections::{HashMap, HashSet};

use serde::Serialize;

use crate::error::{ModelError, Result};
use crate::labels::{Labels, alike};
use crate::predictions::{Id, PredictionError, PredictionTable};
use crate::scores::{Interval, Scores, Tally, check_spelling, drawn, units};

/// McNemar's exact test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct McNemar {
    /// rows only the first got right
    pub only_first: usize,
    /// rows only the second got right
    pub only_second: usize,
    /// two-sided probability of a split at least this uneven if both are equally good
    pub p_value: f64,
}

/// McNemar's exact test on two predictions of the same rows.
///
/// # Errors
/// Different lengths.
pub fn mcnemar(truth: &[usize], first: &[usize], second: &[usize]) -> Result<McNemar> {
    same_length(truth, first, second)?;
    let right = |p: &[usize], row: usize| p[row] == truth[row];
    let count = |a: &[usize], b: &[usize]| {
        (0..truth.len()).filter(|&row| right(a, row) && !right(b, row)).count()
    };
    let (only_first, only_second) = (count(first, second), count(second, first));
    let n = only_first + only_second;
    // Binomial tail, each term from the one before, in logarithms against underflow.
    let mut log_term = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for k in 0..=only_first.min(only_second) {
        tail += log_term.exp();
        log_term += ((n - k) as f64 / (k + 1) as f64).ln();
    }
    Ok(McNemar { only_first, only_second, p_value: (2.0 * tail).min(1.0) })
}

/// Bootstrap interval of the difference of weighted F1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bootstrap {
    /// weighted F1 of the second minus that of the first
    pub difference: f64,
    /// lower end of the 95 % percentile interval
    pub low: f64,
    /// its upper end
    pub high: f64,
    /// part of resamples in which the second is not better, doubled for both sides, at most 1, and at least what n
    /// rows or groups that agree by chance have (0.5 to the power of n - 1); `None` for fewer than ten
    pub p_value: Option<f64>,
}

/// Fewest rows or groups whose draws say how probable a difference is.
const FEWEST: usize = 10;

/// Resamples rows, or whole groups when given, with replacement.
///
/// # Errors
/// Different lengths, no rows, or no resamples.
pub fn bootstrap<S: AsRef<str>>(
    truth: &[usize],
    first: &[usize],
    second: &[usize],
    groups: Option<&[S]>,
    resamples: usize,
    seed: u64,
) -> Result<Bootstrap> {
    same_length(truth, first, second)?;
    if let Some(groups) = groups.filter(|g| g.len() != truth.len()) {
        let (what, expected) = ("groups", truth.len());
        return Err(ModelError::Length { what, expected, actual: groups.len() });
    }
    if truth.is_empty() || resamples == 0 {
        let what = "rows and resamples";
        return Err(ModelError::Length { what, expected: 1, actual: 0 });
    }
    let units = units(truth.len(), groups);
    let n_classes = truth.iter().chain(first).chain(second).max().map_or(0, |c| c + 1);
    let difference = |rows: &[usize]| {
        let f1 = |p: &[usize]| {
            let pairs = rows.iter().map(|&row| (truth[row], Some(p[row])));
            Tally::new(n_classes, pairs).weighted_f1()
        };
        f1(second) - f1(first)
    };
    let [found] = drawn(&units, resamples, seed, |rows| [difference(rows)]);
    let Interval { low, high } = Interval::of(&found);
    let part = |holds: fn(&f64) -> bool| {
        found.iter().filter(|d| holds(d)).count() as f64 / resamples as f64
    };
    let tail = part(|d| *d <= 0.0).min(part(|d| *d >= 0.0));
    // No draw of n that agree is rarer than their agreeing by chance, and draws show no p value below
    // that of one more draw on the other side.
    let least = 0.5_f64.powi(units.len() as i32 - 1).max(2.0 / (resamples as f64 + 1.0));
    let all: Vec<usize> = (0..truth.len()).collect();
    Ok(Bootstrap {
        difference: difference(&all),
        low,
        high,
        p_value: (units.len() >= FEWEST).then_some((2.0 * tail).max(least).min(1.0)),
    })
}

/// Two prediction files of the same recordings, compared.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// recordings that both predict
    pub rows: usize,
    /// the first file
    pub first: Compared,
    /// the second
    pub second: Compared,
    /// McNemar's test
    pub mcnemar: McNemar,
    /// difference of weighted F1 with rows drawn
    pub bootstrap_rows: Bootstrap,
    /// the same with whole groups drawn, of the first file, or else of the second
    pub bootstrap_groups: Option<Bootstrap>,
    /// column of the groups
    pub grouped_by: Option<String>,
    /// number of groups
    pub groups: usize,
    /// the same with whole folds drawn, where all lines have one, there are several, and they do not
    /// differ between the files
    pub bootstrap_folds: Option<Bootstrap>,
    /// number of folds of the first file
    pub folds: usize,
    /// whether a recording has another fold in the second file, or only one of the files has folds
    pub folds_differ: bool,
    /// draws of each bootstrap
    pub resamples: usize,
    /// its seed
    pub seed: u64,
    /// names of the classes, in the order of the scores
    pub labels: Labels,
    /// what makes the comparison doubtful, in words
    pub warnings: Vec<String>,
}

/// One of two files.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// the file
    pub path: String,
    /// its scores
    pub scores: Scores,
}

/// Compares predictions of the same recordings. `target` names the column of true classes, else
/// `true`, and `groups` that of groups, else `group`, `container` or `recording` where there is one. A line without a
/// prediction is wrong.
///
/// # Errors
/// Recordings that one file has and the other has not, other true classes, recordings that occur twice; numbers with
/// fractions, which are no classes; a class that predictions spell as another number; no such groups, or other ones
/// in the second file.
pub fn compare(
    first: &PredictionTable,
    second: &PredictionTable,
    (target, groups): (Option<&str>, Option<&str>),
    resamples: usize,
    seed: u64,
) -> std::result::Result<Comparison, PredictionError> {
    let (truth, other_truth) = (first.truth(target)?, second.truth(target)?);
    first.check_once_each()?;
    second.check_once_each()?;
    let places: HashMap<&Id, usize> =
        second.rows.iter().enumerate().map(|(at, row)| (&row.key, at)).collect();
    let (one, two) = (first.path.display(), second.path.display());
    let known: HashSet<&Id> = first.rows.iter().map(|row| &row.key).collect();
    if let Some(extra) = second.rows.iter().find(|row| !known.contains(&row.key)) {
        return Err(second.content(format!("{:?} is not in {one}", extra.key.0)));
    }
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for (row, truth) in first.rows.iter().zip(&truth) {
        let Some(&at) = places.get(&row.key) else {
            return Err(first.content(format!("{:?} is not in {two}", row.key.0)));
        };
        if other_truth[at] != *truth {
            return Err(first.content(format!(
                "{:?} is {truth} here and {} in {two}: predictions of one target are compared",
                row.key.0, other_truth[at]
            )));
        }
        let name = |table: &PredictionTable, class: Option<usize>| {
            class.map(|class| table.labels[class].clone())
        };
        a.push(name(first, row.class));
        b.push(name(second, second.rows[at].class));
    }
    let truth: Vec<String> = truth.into_iter().map(String::from).collect();
    let number = |text: &String| text.parse::<f64>().ok().filter(|value| value.is_finite());
    let predicted = a.iter().chain(&b).flatten();
    let mut all = truth.iter().chain(predicted.clone());
    if all.clone().all(|text| number(text).is_some())
        && all.any(|text| number(text).is_some_and(|value| value.fract() != 0.0))
    {
        let reason = "has numbers, but classes are compared here: `score --numeric` measures the \
                      errors of each file";
        return Err(first.content(reason));
    }
    let spelled: Vec<&str> = truth.iter().map(String::as_str).collect();
    check_spelling(first, &spelled, false)?;
    check_spelling(second, &spelled, false)?;
    let named: Vec<&String> = truth.iter().chain(predicted).collect();
    let (labels, all) = Labels::of(&named);
    let truth = &all[..truth.len()];
    let mut named = all[truth.len()..].iter().copied();
    let mut classes = |of: &[Option<String>]| -> Vec<Option<usize>> {
        of.iter().map(|name| name.as_ref().and_then(|_| named.next())).collect()
    };
    let (a, b) = (classes(&a), classes(&b));
    let refuse = |e: ModelError| first.model(e);
    let scores = |p: &[Option<usize>], path: String| {
        Scores::with_unknown(truth, p.iter().copied(), labels.len())
            .map(|scores| Compared { path, scores })
    };
    let (one_scores, two_scores) = (scores(&a, one.to_string()), scores(&b, two.to_string()));
    // To the tests, a class that no row has stands for no prediction.
    let all = |p: Vec<Option<usize>>| -> Vec<usize> {
        p.into_iter().map(|class| class.unwrap_or(labels.len())).collect()
    };
    let (a, b) = (&all(a)[..], &all(b)[..]);
    let grouped = groups::of_both(first, second, (target, groups), &places)?;
    // Groups of one row are rows, the classes are no groups, and of one group nothing is drawn.
    let grouped = grouped.filter(|(name, of): &(&str, Vec<&str>)| {
        Some(*name) != target && (2..of.len()).contains(&Labels::of(of).0.len())
    });
    let by_group =
        grouped.as_ref().map(|(_, of)| bootstrap(truth, a, b, Some(of), resamples, seed));
    let mut warnings = alike(&labels);
    warnings.extend(first.unmatched.iter().cloned());
    if let Some((column, _)) = &grouped {
        warnings.push(format!(
            "rows of one {column} are not independent: McNemar's test and the interval over rows assume that they \
             are, so both overstate the evidence"
        ));
    }
    if let (Some(column), None) = (groups, &grouped) {
        warnings.push(format!(
            "no groups are drawn by {column:?}: it has a single value, or another one in each row, or it is the target"
        ));
    }
    let (folds, others) = (first.held_out_folds(), second.held_out_folds());
    let folds_differ = match (&folds, &others) {
        (Some(folds), Some(others)) => {
            let mut pairs = first.rows.iter().zip(folds);
            pairs.any(|(row, fold)| others[places[&row.key]] != *fold)
        }
        (one, other) => one.is_some() != other.is_some(),
    };
    let paths = [&first.path, &second.path].map(|path| path.display());
    match (&folds, &others) {
        (Some(_), Some(_)) if folds_differ => warnings.push(format!(
            "{}: its folds are not those of {}, so none are drawn",
            paths[1], paths[0]
        )),
        (Some(_), None) | (None, Some(_)) => {
            let [with, without] = if folds.is_some() { [0, 1] } else { [1, 0] };
            warnings.push(format!(
                "{} has folds and {} has {}: no folds are drawn, and the comparison is unfair if a classifier \
                 was trained on the rows that it predicts",
                paths[with],
                paths[without],
                [first, second][without].no_folds()
            ));
        }
        _ => {}
    }
    let folds = folds.unwrap_or_default();
    let n_folds = Labels::of(&folds).0.len();
    let foldwise = n_folds > 1 && !folds_differ && folds.iter().all(|fold| !fold.is_empty());
    let by_fold = foldwise.then(|| bootstrap(truth, a, b, Some(&folds), resamples, seed));
    Ok(Comparison {
        rows: truth.len(),
        first: one_scores.map_err(refuse)?,
        second: two_scores.map_err(refuse)?,
        mcnemar: mcnemar(truth, a, b).map_err(refuse)?,
        bootstrap_rows: bootstrap::<&str>(truth, a, b, None, resamples, seed).map_err(refuse)?,
        bootstrap_groups: by_group.transpose().map_err(refuse)?,
        groups: grouped.as_ref().map_or(0, |(_, of)| Labels::of(of).0.len()),
        grouped_by: grouped.map(|(column, _)| column.to_owned()),
        bootstrap_folds: by_fold.transpose().map_err(refuse)?,
        folds: n_folds,
        folds_differ,
        resamples,
        seed,
        labels,
        warnings,
    })
}

fn same_length(truth: &[usize], first: &[usize], second: &[usize]) -> Result<()> {
    match [first, second].into_iter().find(|p| p.len() != truth.len()) {
        Some(p) => {
            let (what, expected) = ("predictions", truth.len());
            Err(ModelError::Length { what, expected, actual: p.len() })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mcnemar_is_the_binomial_test() {
        // 2 against 8: scipy.stats.binomtest(2, 10).pvalue = 0.109375
        let truth = vec![0; 20];
        let first: Vec<usize> = (0..20).map(|i| usize::from(i >= 2)).collect();
        let second: Vec<usize> = (0..20).map(|i| usize::from(!(2..10).contains(&i))).collect();
        let test = mcnemar(&truth, &first, &second).unwrap();
        assert_eq!((test.only_first, test.only_second), (2, 8));
        assert!((test.p_value - 0.109_375).abs() < 1e-12);
        assert_eq!(mcnemar(&truth, &first, &first).unwrap().p_value, 1.0);
        assert!(mcnemar(&truth, &first, &second[1..]).is_err());
    }

    #[test]
    fn bootstrap_sees_a_clear_difference_and_none_in_equals() {
        let truth: Vec<usize> = (0..200).map(|i| i % 2).collect();
        let first: Vec<usize> =
            (0..200).map(|i| if i % 3 == 0 { 1 - i % 2 } else { i % 2 }).collect();
        let clear = bootstrap::<&str>(&truth, &first, &truth, None, 500, 1).unwrap();
        assert!(clear.low > 0.2 && clear.high < 0.5, "{clear:?}");
        // 500 draws that agree show no more.
        assert_eq!(clear.p_value, Some(2.0 / 501.0));
        let one = bootstrap::<&str>(&truth, &first, &truth, None, 1, 1).unwrap();
        assert_eq!(one.p_value, Some(1.0));
        let none = bootstrap::<&str>(&truth, &first, &first, None, 500, 1).unwrap();
        assert_eq!(
            (none.difference, none.low, none.high, none.p_value),
            (0.0, 0.0, 0.0, Some(1.0))
        );
        let groups: Vec<String> = (0..200).map(|i| (i / 20).to_string()).collect();
        let grouped = bootstrap(&truth, &first, &truth, Some(&groups), 500, 1).unwrap();
        assert!(grouped.difference == clear.difference && grouped.low > 0.2);
        assert_eq!(grouped.p_value, Some(2.0 / 501.0));
        let grouped = bootstrap(&truth, &first, &truth, Some(&groups), 5000, 1).unwrap();
        assert_eq!(grouped.p_value, Some(0.5_f64.powi(9)));
        // Nine groups that agree are no proof.
        let groups: Vec<String> = (0..200).map(|i| (i / 25 + i / 199).to_string()).collect();
        let few = bootstrap(&truth, &first, &truth, Some(&groups), 500, 1).unwrap();
        assert_eq!((few.difference, few.p_value), (clear.difference, None));
    }
}
