//! What a classifier relies on, and whether more rows would help: both by training on the folds'
//! training rows and scoring their test rows.

use std::collections::{BTreeSet, HashMap};

use ndarray::{Array2, ArrayView2, Axis};
use serde::Serialize;

use crate::error::{ModelError, Result};
use crate::mt19937::RandomState;
use crate::pipeline::PipelineSpec;
use crate::scores::units;
use crate::splits::Fold;

/// Features that belong together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Family {
    /// Their common name, such as `mfcc`.
    pub name: String,
    /// Their columns.
    pub columns: Vec<usize>,
}

/// The families of features by their names, in the order of their first features: `mfcc[3].mean` and
/// `mfcc_3_mean` are of `mfcc`, of every channel, and a part of a compound vector, such as `af193[chroma_2]`, of `chroma`.
pub fn families(names: &[String]) -> Vec<Family> {
    let mut families: Vec<Family> = Vec::new();
    for (column, name) in names.iter().enumerate() {
        let stem = stem(name);
        match families.iter_mut().find(|f| f.name == stem) {
            Some(family) => family.columns.push(column),
            None => families.push(Family { name: stem.to_owned(), columns: vec![column] }),
        }
    }
    families
}

fn stem(name: &str) -> &str {
    // `ch3/mfcc[0].mean`: the channels of a feature say much the same.
    let channel = name.split_once('/').filter(|(first, _)| {
        first.strip_prefix("ch").is_some_and(|n| n.chars().all(|c| c.is_ascii_digit()))
    });
    let name = channel.map_or(name, |(_, feature)| feature);
    let outer = name.split(['[', '.']).next().unwrap_or(name);
    let inner = name.split_once('[').and_then(|(_, rest)| rest.split_once(']')).map(|(i, _)| i);
    match inner {
        // Coefficients of `poly_features` are called `f^2`.
        Some(part) if part.starts_with(|c: char| !c.is_ascii_digit()) && !part.contains('^') => {
            let number = part.char_indices().find(|(i, c)| {
                *c == '_' && part[i + 1..].starts_with(|c: char| c.is_ascii_digit())
            });
            number.map_or(part, |(i, _)| &part[..i])
        }
        Some(_) => outer,
        // `mfcc_12_mean`, as other programs name them.
        None => {
            outer.split(['_', '-']).next().filter(|word| numbered(word, outer)).unwrap_or(outer)
        }
    }
}

/// Whether a number follows the first word of a name.
fn numbered(word: &str, name: &str) -> bool {
    let rest = name[word.len()..].trim_start_matches(['_', '-']);
    !word.is_empty() && rest.starts_with(|c: char| c.is_ascii_digit())
}

/// What permuting a family costs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Importance {
    /// name of the family
    pub family: String,
    /// features in it
    pub features: usize,
    /// mean loss of accuracy, 0 to 1, over folds and repetitions
    pub mean: f64,
    /// smallest loss
    pub low: f64,
    /// largest loss
    pub high: f64,
}

/// Labelled rows and how they are divided.
#[derive(Clone, Copy, Debug)]
pub struct Setting<'a> {
    /// `[rows, features]`
    pub x: ArrayView2<'a, f64>,
    /// class indices
    pub y: &'a [usize],
    /// classes
    pub n_classes: usize,
    /// what is trained on and what is scored
    pub folds: &'a [Fold],
    /// what each row belongs to, where rows of one group are not independent
    pub groups: Option<&'a [String]>,
    /// what is trained
    pub spec: &'a PipelineSpec,
}

impl Setting<'_> {
    fn check(&self) -> Result<()> {
        crate::table::check_features(self.x)?;
        crate::table::check_labels(self.x.nrows(), self.y, self.n_classes)?;
        if let Some(groups) = self.groups.filter(|groups| groups.len() != self.y.len()) {
            let (what, expected) = ("groups", self.y.len());
            return Err(ModelError::Length { what, expected, actual: groups.len() });
        }
        let beyond = |row: &usize| *row >= self.y.len();
        for fold in self.folds {
            if fold.train.iter().chain(&fold.test).any(beyond) || fold.test.is_empty() {
                let reason = format!("fold {}: no test rows, or a row beyond the table", fold.name);
                return Err(ModelError::Folds { reason });
            }
        }
        Ok(())
    }

    fn train(&self, rows: &[usize]) -> Result<crate::pipeline::Pipeline> {
        let y: Vec<usize> = rows.iter().map(|row| self.y[*row]).collect();
        self.spec.train(self.x.select(Axis(0), rows).view(), &y, self.n_classes)
    }

    /// Rows of a class that come together: those of a group, or each by itself.
    fn units(&self, rows: impl Iterator<Item = usize>) -> Vec<Vec<usize>> {
        let rows: Vec<usize> = rows.collect();
        let groups = self.groups.map(|of| rows.iter().map(|row| &*of[*row]).collect::<Vec<&str>>());
        let mut units = units(rows.len(), groups.as_deref());
        units.iter_mut().flatten().for_each(|at| *at = rows[*at]);
        units
    }

    /// Whether a fold tests rows of one class alone.
    fn has_uniform_fold(&self) -> bool {
        let uniform =
            |fold: &Fold| fold.test.iter().all(|row| self.y[*row] == self.y[fold.test[0]]);
        self.folds.iter().any(uniform)
    }

    fn accuracy(&self, predicted: &[usize], rows: &[usize]) -> f64 {
        let right = predicted.iter().zip(rows).filter(|(p, row)| **p == self.y[**row]).count();
        right as f64 / rows.len() as f64
    }
}

/// Permutation importance of each family: in each fold the values of all its features are exchanged
/// together among the test rows, `repeats` times, and the accuracy lost is noted. Where a fold tests one class
/// alone, as a fold of one row does, values come from the test rows of all folds: others of its class would say the
/// same.
///
/// # Errors
/// No repetition, a family with a column beyond the table, folds that do not fit the table, and
/// whatever training refuses.
pub fn permutation_importance(
    setting: &Setting<'_>,
    families: &[Family],
    repeats: usize,
    seed: u32,
) -> Result<Vec<Importance>> {
    setting.check()?;
    if repeats == 0 {
        return Err(ModelError::Folds {
            reason: "at least 1 repetition of the permutation is needed".into(),
        });
    }
    let beyond = families.iter().flat_map(|f| &f.columns).find(|c| **c >= setting.x.ncols());
    if let Some(column) = beyond {
        let (expected, actual) = (setting.x.ncols(), *column + 1);
        return Err(ModelError::Length { what: "features", expected, actual });
    }
    let mut losses: Vec<Vec<f64>> = vec![Vec::new(); families.len()];
    let mut random = RandomState::new(seed);
    let of_all: Option<Vec<usize>> = setting
        .has_uniform_fold()
        .then(|| setting.folds.iter().flat_map(|fold| fold.test.iter().copied()).collect());
    for fold in setting.folds {
        let model = setting.train(&fold.train)?;
        let x = setting.x.select(Axis(0), &fold.test);
        let whole = setting.accuracy(&model.predict(x.view())?, &fold.test);
        let others = of_all.as_deref().unwrap_or(&fold.test);
        for (family, losses) in families.iter().zip(&mut losses) {
            for _ in 0..repeats {
                let mut from = others.to_vec();
                random.shuffle(&mut from);
                let permuted = permuted(&x, &family.columns, (setting.x, &from));
                let accuracy = setting.accuracy(&model.predict(permuted.view())?, &fold.test);
                losses.push(whole - accuracy);
            }
        }
    }
    let importance = |(family, losses): (&Family, Vec<f64>)| Importance {
        family: family.name.clone(),
        features: family.columns.len(),
        mean: losses.iter().sum::<f64>() / losses.len().max(1) as f64,
        low: losses.iter().copied().fold(f64::INFINITY, f64::min),
        high: losses.iter().copied().fold(f64::NEG_INFINITY, f64::max),
    };
    Ok(families.iter().zip(losses).map(importance).collect())
}

/// `x` with the values that other rows of the table have in these columns.
fn permuted(
    x: &Array2<f64>,
    columns: &[usize],
    (table, from): (ArrayView2<'_, f64>, &[usize]),
) -> Array2<f64> {
    let mut out = x.clone();
    for &column in columns {
        let values = from.iter().map(|row| table[[*row, column]]);
        out.column_mut(column).iter_mut().zip(values).for_each(|(slot, value)| *slot = value);
    }
    out
}

/// Accuracy with a part of the training rows.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LearningPoint {
    /// mean number of training rows
    pub rows: f64,
    /// mean accuracy over folds, 0 to 1
    pub mean: f64,
    /// lowest accuracy among the folds
    pub low: f64,
    /// highest accuracy among the folds
    pub high: f64,
}

/// Accuracies with growing parts of the training rows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LearningCurve {
    /// those that could be trained
    pub points: Vec<LearningPoint>,
    /// the largest share that could not be trained, and why
    pub refused: Option<(f64, String)>,
}

/// Accuracy on the test rows when only these shares (above 0, up to 1) of each class's training rows, or
/// groups of them, are learned from, at least two of each class. Smaller parts are contained in larger ones. What
/// cannot be trained on a part, such as 15 neighbours on 10 rows, has no point there.
///
/// # Errors
/// A share out of range, folds or groups that do not fit the table.
pub fn learning_curve(setting: &Setting<'_>, shares: &[f64], seed: u32) -> Result<LearningCurve> {
    setting.check()?;
    if let Some(share) = shares.iter().find(|share| !(**share > 0.0 && **share <= 1.0)) {
        let reason =
            format!("the share of training rows must be above 0 and at most 1, not {share}");
        return Err(ModelError::Folds { reason });
    }
    let mut random = RandomState::new(seed);
    let orders: Vec<Vec<Vec<Vec<usize>>>> = setting
        .folds
        .iter()
        .map(|fold| {
            // One order of the groups for all classes, which groups may share.
            let places = setting.groups.map(|groups| {
                let names: BTreeSet<&str> = fold.train.iter().map(|row| &*groups[*row]).collect();
                let mut names: Vec<&str> = names.into_iter().collect();
                random.shuffle(&mut names);
                names.into_iter().zip(0..).collect::<HashMap<&str, usize>>()
            });
            let of_class = |class: usize| {
                let rows = fold.train.iter().copied().filter(|row| setting.y[*row] == class);
                let mut units = setting.units(rows);
                match (setting.groups, &places) {
                    (Some(groups), Some(places)) => {
                        units.sort_by_key(|unit| places[&*groups[unit[0]]]);
                    }
                    _ => random.shuffle(&mut units),
                }
                units
            };
            (0..setting.n_classes).map(of_class).collect()
        })
        .collect();
    let point = |share: &f64| -> Result<LearningPoint> {
        let mut accuracies = Vec::with_capacity(setting.folds.len());
        let mut rows = 0;
        for (fold, order) in setting.folds.iter().zip(&orders) {
            let mut part: Vec<usize> = Vec::new();
            for class in order {
                let wanted = (share * class.len() as f64).round().max(2.0) as usize;
                part.extend(class[..wanted.min(class.len())].iter().flatten());
            }
            part.sort_unstable();
            rows += part.len();
            let model = setting.train(&part)?;
            let x = setting.x.select(Axis(0), &fold.test);
            accuracies.push(setting.accuracy(&model.predict(x.view())?, &fold.test));
        }
        let n = accuracies.len().max(1) as f64;
        Ok(LearningPoint {
            rows: rows as f64 / n,
            mean: accuracies.iter().sum::<f64>() / n,
            low: accuracies.iter().copied().fold(f64::INFINITY, f64::min),
            high: accuracies.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    };
    let (mut points, mut refused) = (Vec::<LearningPoint>::new(), None::<(f64, String)>);
    for share in shares {
        match point(share) {
            // Few groups: this part is the one before.
            Ok(point) if points.last().is_some_and(|last| last.rows == point.rows) => {}
            Ok(point) => points.push(point),
            Err(error) if refused.as_ref().is_none_or(|(most, _)| most < share) => {
                refused = Some((*share, error.to_string()));
            }
            Err(_) => {}
        }
    }
    Ok(LearningCurve { points, refused })
}
