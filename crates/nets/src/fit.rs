//! Training of classes.

use std::path::Path;

use crate::course::Course;
use crate::epochs::{self, Rating};
use crate::error::{NetError, Result};
use crate::items::{Items, TOGETHER};
use crate::layers::softmax;
use crate::loss::{Loss, Targets};
use crate::memory;
use crate::network::Network;
use crate::random::Stream;
use crate::recipe::{Padding, Recipe, Select};

pub use crate::history::{Epoch, History, Progress};
pub use crate::task::Task;

/// Bytes that items classified together may take; one item may take more. Where padding counts it has a say in the
/// numbers, so that there only the number of items decides.
const MOST: u64 = 1 << 30;

/// Trains a network from initial values of the recipe's seed. `score` rates classes against
/// predicted ones, more is better; `progress` is told before the first epoch, before each step and after
/// each epoch, and ends the training by returning false. With a `checkpoint`, the training is kept there after each
/// epoch and goes on from there.
///
/// # Errors
/// Items that do not fit, too few of them or of their classes; [`NetError::Diverged`];
/// [`NetError::Stopped`]; [`NetError::Checkpoint`].
pub fn fit(
    network: &mut Network,
    task: Task<'_>,
    recipe: &Recipe,
    checkpoint: Option<&Path>,
    score: impl Fn(&[usize], &[usize]) -> f64,
    progress: impl FnMut(Progress<'_>) -> bool,
) -> Result<History> {
    recipe.check()?;
    task.items.check(network)?;
    check(network, task, recipe)?;
    let targets = Targets::Classes(task.classes.to_vec());
    let course = Course {
        items: task.items,
        targets: &targets,
        train: task.train,
        watched: task.watched,
        loss: Loss::CrossEntropy,
        class_weights: class_weights(network.outputs(), task, recipe),
    };
    let truth: Vec<usize> = task.watched.iter().map(|&r| task.classes[r]).collect();
    let rate = |network: &Network| {
        let proba = probabilities(network, task.items, task.watched, recipe)?;
        let score = score(&truth, &labels(&proba));
        let merit = if recipe.select == Select::Split { -log_loss(&truth, &proba) } else { score };
        Ok(Rating { score, merit })
    };
    epochs::run(&course, network, recipe, checkpoint, rate, progress)
}

/// Probability of each class for these items, in batches in their order.
///
/// # Errors
/// Items that the network does not take; [`NetError::Output`].
pub fn probabilities(
    network: &Network,
    items: &Items,
    rows: &[usize],
    recipe: &Recipe,
) -> Result<Vec<Vec<f64>>> {
    let mut all = Vec::with_capacity(rows.len());
    let free = corsmal_files::memory::available();
    for rows in together(network, items, rows, recipe) {
        memory::require_for_items(memory::of_evaluation(network, items, rows, recipe), free)?;
        let chance = Stream::new(recipe.seed, "offset of predictions");
        let out = network.logits(&items.laid(network, rows, recipe, chance))?;
        let n = out.shape.len();
        let mut values = out.values.into_values();
        if let Some(at) = values.iter().position(|v| !v.is_finite()) {
            let network = network.name().into();
            return Err(NetError::Output { network, item: rows[at / n], value: values[at] });
        }
        softmax(&mut values, n);
        all.extend(values.chunks_exact(n).map(|p| p.iter().map(|&v| f64::from(v)).collect()));
    }
    Ok(all)
}

/// The rows in parts that are classified together.
fn together<'r>(
    network: &Network,
    items: &Items,
    mut rows: &'r [usize],
    recipe: &Recipe,
) -> Vec<&'r [usize]> {
    let mut parts = Vec::new();
    while !rows.is_empty() {
        let mut count = TOGETHER.min(rows.len());
        let fits =
            |count: usize| memory::of_evaluation(network, items, &rows[..count], recipe) <= MOST;
        while recipe.padding == Padding::Masked && count > 1 && !fits(count) {
            count = count.div_ceil(2);
        }
        let (part, rest) = rows.split_at(count);
        parts.push(part);
        rows = rest;
    }
    parts
}

/// The most probable classes; the lowest among equals.
pub fn labels(probabilities: &[Vec<f64>]) -> Vec<usize> {
    let best = |row: &Vec<f64>| {
        (1..row.len()).fold(0, |best, class| if row[class] > row[best] { class } else { best })
    };
    probabilities.iter().map(best).collect()
}

/// Mean cross-entropy; a probability below Keras's 1e-7 counts as that.
fn log_loss(truth: &[usize], probabilities: &[Vec<f64>]) -> f64 {
    let losses = truth.iter().zip(probabilities).map(|(&class, row)| -row[class].max(1e-7).ln());
    losses.sum::<f64>() / truth.len() as f64
}

fn check(network: &Network, task: Task<'_>, recipe: &Recipe) -> Result<()> {
    let refuse = |text: String| Err(NetError::Targets(text));
    let (n, outputs) = (task.items.len(), network.outputs());
    if task.classes.len() != n {
        return refuse(format!("{} classes for {n} items", task.classes.len()));
    }
    if let Some(bad) = task.train.iter().chain(task.watched).find(|&&r| r >= n) {
        return refuse(format!("item {bad} of {n}"));
    }
    if let Some(bad) = task.classes.iter().find(|&&c| c >= outputs) {
        return refuse(format!("class {bad} for a network of {outputs} classes"));
    }
    let first = task.train.first().map(|&r| task.classes[r]);
    if task.train.iter().all(|&r| Some(task.classes[r]) == first) {
        return refuse("training needs items of at least 2 classes".into());
    }
    if recipe.drop_last && task.train.len() < recipe.batch {
        let (items, batch) = (task.train.len(), recipe.batch);
        return refuse(format!("{items} items do not fill a batch of {batch} (drop_last)"));
    }
    if recipe.select != Select::Last && task.watched.is_empty() {
        return refuse("choosing an epoch needs validation items".into());
    }
    Ok(())
}

/// Inverse frequencies of the training items' classes, their sum 1; zero for a class without items.
fn class_weights(outputs: usize, task: Task<'_>, recipe: &Recipe) -> Vec<f32> {
    if !recipe.class_weights {
        return Vec::new();
    }
    let mut counts = vec![0usize; outputs];
    task.train.iter().for_each(|&r| counts[task.classes[r]] += 1);
    let inverse = |&n: &usize| if n == 0 { 0.0 } else { 1.0 / n as f64 };
    let sum: f64 = counts.iter().map(inverse).sum();
    counts.iter().map(|n| (inverse(n) / sum) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::items::Column;
    use crate::networks;

    #[test]
    fn a_long_item_is_not_classified_with_many() {
        let definition = networks::named("m5_vggish_level").unwrap();
        let network = definition.build(None, 0).unwrap();
        let long = vec![0.0; 128 * 200_000];
        let mut column = Column::of([&long[..]]);
        (0..70).for_each(|_| column.push(&[0.0; 128]));
        let items = Items { columns: vec![column] };
        let rows: Vec<usize> = (0..71).collect();
        let sizes = |padding| -> Vec<usize> {
            let recipe = Recipe { padding, ..definition.recipe };
            together(&network, &items, &rows, &recipe).iter().map(|part| part.len()).collect()
        };
        assert_eq!(sizes(Padding::Masked), [8, 63]);
        assert_eq!(sizes(Padding::Published), [64, 7]);
    }
}
