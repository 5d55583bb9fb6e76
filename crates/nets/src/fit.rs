//! The training loop.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::checkpoint;
use crate::error::{NetError, Result};
use crate::items::Items;
use crate::layers::softmax;
use crate::loss::{Loss, Targets};
use crate::memory;
use crate::network::Network;
use crate::random::Stream;
use crate::recipe::{Activation, InitialKind, Recipe, Select};
use crate::trainer::{StepSettings, Trainer};

pub use crate::history::{Epoch, History, Progress};
pub use crate::task::Task;

/// Items classified together where nothing asks for another number; M5's predictions depend on it.
const TOGETHER: usize = 64;

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
    mut progress: impl FnMut(Progress<'_>) -> bool,
) -> Result<History> {
    recipe.check()?;
    task.items.check(network)?;
    check(network, task, recipe)?;
    let memory = memory::of_training(network, task, recipe);
    memory::require(memory, memory::available())?;
    match recipe.initial {
        InitialKind::Pytorch => network.start(recipe.seed),
        InitialKind::Xavier => network.start_xavier(recipe.seed, false),
        InitialKind::Glorot => network.start_xavier(recipe.seed, true),
    }
    network.train_through_activation(recipe.activation == Activation::Double);
    let settings = StepSettings {
        optimiser: recipe.optimiser(),
        clip_grad_norm: (recipe.clip_grad_norm > 0.0).then_some(recipe.clip_grad_norm),
        loss: Loss::CrossEntropy,
        class_weights: class_weights(network.outputs(), task, recipe),
        dropout: recipe.dropout.then_some(recipe.seed),
    };
    let began = Instant::now();
    let expected = trial(network, task, recipe, &settings)?;
    let key = checkpoint.map(|_| checkpoint::key(network, task, recipe));
    let place = checkpoint.zip(key.as_deref());
    let mut trainer = Trainer::new(network, settings);
    let (mut epochs, mut best) = match place {
        Some((path, key)) => checkpoint::resume(path, key, &mut trainer)?,
        None => (Vec::new(), None),
    };
    let resumed = epochs.len();
    let mut tell = |epochs: &[Epoch], step: Option<usize>| {
        let (elapsed, total) = (began.elapsed(), recipe.epochs);
        let to_come = total - epochs.len();
        let left = match epochs.len() - resumed {
            0 => expected.mul_f64(to_come as f64 / total as f64),
            n => elapsed.mul_f64(to_come as f64 / n as f64),
        };
        let goes_on = progress(Progress { epochs, step, total, elapsed, left, memory });
        if goes_on { Ok(()) } else { Err(NetError::Stopped { epochs: epochs.len() }) }
    };
    tell(&epochs, None)?;
    for epoch in resumed..recipe.epochs {
        let mut sum = 0.0;
        let steps = steps_of(task.train, recipe, epoch);
        for (step, rows) in steps.iter().enumerate() {
            tell(&epochs, Some(step))?;
            let chance = Stream::new(recipe.seed, "offset").part(epoch as u64);
            let inputs = task.items.laid(trainer.network, rows, recipe, chance);
            let classes = rows.iter().map(|&r| task.classes[r]).collect();
            sum += trainer.step(&inputs, &Targets::Classes(classes))?.loss;
        }
        let mut result = Epoch { loss: sum / steps.len() as f64, score: None };
        if !task.watched.is_empty() {
            let proba = probabilities(trainer.network, task.items, task.watched, recipe)?;
            let truth: Vec<usize> = task.watched.iter().map(|&r| task.classes[r]).collect();
            let reached = score(&truth, &labels(&proba));
            result.score = Some(reached);
            if recipe.select != Select::Last && best.as_ref().is_none_or(|b| reached > b.0) {
                best = Some((reached, epoch, trainer.network.parameters().clone()));
            }
        }
        epochs.push(result);
        if let Some((path, key)) = place {
            checkpoint::save(path, key, &trainer, &epochs, &best)?;
        }
        tell(&epochs, None)?;
    }
    let mut kept = recipe.epochs - 1;
    if let Some((_, epoch, parameters)) = best {
        kept = epoch;
        *network.parameters_mut() = parameters;
    }
    Ok(History { epochs, kept })
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
    for rows in rows.chunks(TOGETHER) {
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

/// The most probable classes; the lowest among equals.
pub fn labels(probabilities: &[Vec<f64>]) -> Vec<usize> {
    let best = |row: &Vec<f64>| {
        (1..row.len()).fold(0, |best, class| if row[class] > row[best] { class } else { best })
    };
    probabilities.iter().map(best).collect()
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

/// The rows of each step of an epoch.
fn steps_of(train: &[usize], recipe: &Recipe, epoch: usize) -> Vec<Vec<usize>> {
    let order = Stream::new(recipe.seed, "order").part(epoch as u64).permutation(train.len());
    let rows: Vec<usize> = order.into_iter().map(|i| train[i]).collect();
    let whole = rows.len() / recipe.batch * recipe.batch;
    let used = if recipe.drop_last { whole } else { rows.len() };
    rows[..used].chunks(recipe.batch).map(<[usize]>::to_vec).collect()
}

/// Duration of the whole training, from one step that changes nothing.
fn trial(
    network: &Network,
    task: Task<'_>,
    recipe: &Recipe,
    settings: &StepSettings,
) -> Result<Duration> {
    let rows = &steps_of(task.train, recipe, 0)[0];
    let inputs = task.items.laid(network, rows, recipe, Stream::new(recipe.seed, "offset"));
    let classes = Targets::Classes(rows.iter().map(|&r| task.classes[r]).collect());
    let began = Instant::now();
    network.gradients(&inputs, &classes, &settings.loss, &settings.class_weights, None)?;
    let work = |rows: &[usize]| rows.iter().map(|&r| task.items.work(r)).sum::<usize>() as f64;
    // Evaluation takes about a third of a step.
    let all = (work(task.train) + work(task.watched) / 3.0) / work(rows).max(1.0);
    Ok(began.elapsed().mul_f64(all * recipe.epochs as f64))
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
