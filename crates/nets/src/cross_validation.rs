//! Scores on items that a network was not trained on.

use std::path::Path;

use crate::device::Device;
use crate::error::{NetError, Result};
use crate::fit::{self, History, Progress, Task};
use crate::items::Items;
use crate::networks::Definition;
use crate::random::Stream;
use crate::recipe::{Recipe, Select};
use crate::weights::State;

/// Items trained on and items held out.
#[derive(Clone, Debug, PartialEq)]
pub struct FoldItems {
    /// its name
    pub name: String,
    /// items trained on
    pub train: Vec<usize>,
    /// items held out
    pub test: Vec<usize>,
}

/// What a fold found.
#[derive(Clone, Debug, PartialEq)]
pub struct FoldResult {
    /// the fold's name
    pub name: String,
    /// items held out
    pub test: Vec<usize>,
    /// probability of each class for each of them
    pub probabilities: Vec<Vec<f64>>,
    /// what became of the training
    pub history: History,
    /// group held out of the training items to choose the epoch by
    pub validation: Option<String>,
}

/// Data of a cross-validation.
#[derive(Clone, Copy, Debug)]
pub struct Data<'a> {
    /// all items
    pub items: &'a Items,
    /// class of each
    pub classes: &'a [usize],
    /// how many classes there are
    pub n_classes: usize,
    /// group of each item, for a validation group of whole groups
    pub groups: Option<&'a [String]>,
    /// what trainings begin with instead of random numbers; see [`crate::network::Network::begin_with`]
    pub weights: Option<&'a State>,
    /// where trainings compute
    pub device: &'a Device,
}

/// Trains a network for each fold and classifies what the fold holds out, in its order. Checkpoints
/// go to files in `folder`, `progress` is told fold by fold.
///
/// # Errors
/// As [`fit::fit`]; a validation group without groups.
pub fn cross_validate(
    definition: &Definition,
    data: Data<'_>,
    folds: &[FoldItems],
    recipe: &Recipe,
    folder: Option<&Path>,
    score: impl Fn(&[usize], &[usize]) -> f64,
    mut progress: impl FnMut(&FoldItems, Progress<'_>) -> bool,
) -> Result<Vec<FoldResult>> {
    let mut results = Vec::new();
    for (number, fold) in folds.iter().enumerate() {
        let mut network = definition.build(Some(data.n_classes), recipe.seed)?;
        network.run_on(data.device.clone());
        data.weights.map(|state| network.begin_with(state)).transpose()?;
        let (train, watched, validation) = watched(data, fold, recipe)?;
        let task =
            Task { items: data.items, classes: data.classes, train: &train, watched: &watched };
        let path = folder.map(|f| f.join(format!("fold-{number}.safetensors")));
        let tell = |told: Progress<'_>| progress(fold, told);
        let history = fit::fit(&mut network, task, recipe, path.as_deref(), &score, tell)?;
        let probabilities = fit::probabilities(&network, data.items, &fold.test, recipe)?;
        let (name, test) = (fold.name.clone(), fold.test.clone());
        results.push(FoldResult { name, test, probabilities, history, validation });
    }
    Ok(results)
}

/// Items trained on, items that choose the epoch, and the group that these are, where they are one.
///
/// # Errors
/// A validation group without groups, or of groups each of which has all items of a class; a fifth of too few
/// items; no held-out items to choose the epoch by, as published.
pub fn watched(
    data: Data<'_>,
    fold: &FoldItems,
    recipe: &Recipe,
) -> Result<(Vec<usize>, Vec<usize>, Option<String>)> {
    match recipe.select {
        Select::Last => Ok((fold.train.clone(), Vec::new(), None)),
        Select::Published if fold.test.is_empty() => Err(NetError::Targets(
            "select = published chooses the epoch by the fold that is held out, which only \
             cross-validation has: use last, validation or split"
                .into(),
        )),
        Select::Published => Ok((fold.train.clone(), fold.test.clone(), None)),
        Select::Split => {
            let held = fifth(data, fold, recipe);
            if held.is_empty() {
                return Err(NetError::Targets(
                    "select = split holds out a fifth of the training items of each class: at least \
                     one class must have 3"
                        .into(),
                ));
            }
            let train = fold.train.iter().filter(|i| held.binary_search(i).is_err());
            Ok((train.copied().collect(), held, None))
        }
        Select::Validation => {
            let refuse = || {
                NetError::Targets(
                    "select = validation holds out a group of the training items: it needs groups \
                     (--groups), at least two of them in training"
                        .into(),
                )
            };
            let groups = data.groups.ok_or_else(refuse)?;
            let mut names: Vec<&String> = fold.train.iter().map(|&i| &groups[i]).collect();
            names.sort_unstable();
            names.dedup();
            if names.len() < 2 {
                return Err(refuse());
            }
            let found = names.len();
            names.retain(|&name| !holds_a_class(data, groups, fold, name));
            if names.is_empty() {
                return Err(NetError::Targets(format!(
                    "select = validation holds out a group of the training items, but each of the {found} \
                     groups in training holds all items of some class, which could then not be learned: name other \
                     groups (--groups), or use last or split"
                )));
            }
            let stream = Stream::new(recipe.seed, &format!("validation group of {}", fold.name));
            let chosen = names[stream.below(0, names.len())];
            let (held, train): (Vec<usize>, Vec<usize>) =
                fold.train.iter().partition(|&&i| groups[i] == *chosen);
            Ok((train, held, Some(chosen.clone())))
        }
    }
}

/// Whether all training items of some class are of one group.
fn holds_a_class(data: Data<'_>, groups: &[String], fold: &FoldItems, name: &str) -> bool {
    let mut items = vec![[0_usize; 2]; data.n_classes];
    for &item in &fold.train {
        // Impossible classes are refused later.
        let class = data.classes.get(item).and_then(|&class| items.get_mut(class));
        class.into_iter().for_each(|counts| counts[usize::from(groups[item] == name)] += 1);
    }
    items.iter().any(|[others, own]| *others == 0 && *own > 0)
}

/// A random fifth of the training items of each class, ascending.
fn fifth(data: Data<'_>, fold: &FoldItems, recipe: &Recipe) -> Vec<usize> {
    let stream = Stream::new(recipe.seed, &format!("fifth of {}", fold.name));
    let mut held = Vec::new();
    for class in 0..data.n_classes {
        let items: Vec<usize> =
            fold.train.iter().copied().filter(|&i| data.classes[i] == class).collect();
        let order = stream.part(class as u64).permutation(items.len());
        held.extend(order.into_iter().take((items.len() + 2) / 5).map(|i| items[i]));
    }
    held.sort_unstable();
    held
}
