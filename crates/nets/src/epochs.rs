//! The training loop, whatever is learned.

use std::collections::HashMap;
use std::path::Path;
use std::time::{Duration, Instant};

use crate::checkpoint;
use crate::course::Course;
use crate::error::{NetError, Result};
use crate::history::{Epoch, History, Progress};
use crate::layers::MOMENTUM;
use crate::memory;
use crate::network::Network;
use crate::random::Stream;
use crate::recipe::{Activation, InitialKind, Recipe, Select};
use crate::trainer::{StepSettings, Trainer};

/// How good a network is on the watched items.
pub(crate) struct Rating {
    /// shown and kept in the history
    pub score: f64,
    /// chooses the epoch, more is better
    pub merit: f64,
}

/// Trains from initial values of the recipe's seed. `rate` says how good a network is on the
/// watched items.
///
/// # Errors
/// As [`crate::fit::fit`].
pub(crate) fn run(
    course: &Course<'_>,
    network: &mut Network,
    recipe: &Recipe,
    checkpoint: Option<&Path>,
    rate: impl Fn(&Network) -> Result<Rating>,
    mut progress: impl FnMut(Progress<'_>) -> bool,
) -> Result<History> {
    let memory = memory::of_training(network, course, recipe);
    memory::require(memory, corsmal_files::memory::available())?;
    match recipe.initial {
        InitialKind::Pytorch => network.start(recipe.seed),
        InitialKind::Xavier => network.start_xavier(recipe.seed, false),
        InitialKind::Glorot => network.start_xavier(recipe.seed, true),
    }
    network.train_through_activation(recipe.activation == Activation::Double);
    let settings = StepSettings {
        optimiser: recipe.optimiser(),
        clip_grad_norm: (recipe.clip_grad_norm > 0.0).then_some(recipe.clip_grad_norm),
        loss: course.loss.clone(),
        class_weights: course.class_weights.clone(),
        dropout: recipe.dropout.then_some(recipe.seed),
    };
    let began = Instant::now();
    let expected = trial(course, network, recipe, &settings)?;
    let key = checkpoint.map(|_| checkpoint::key(network, course, recipe));
    let place = checkpoint.zip(key.as_deref());
    let mut trainer = Trainer::new(network, settings);
    let (mut epochs, mut best) = match place {
        Some((path, key)) => checkpoint::resume(path, (key, recipe.epochs), &mut trainer)?,
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
    let is_short = is_short(course, trainer.network, recipe);
    for epoch in resumed..recipe.epochs {
        let mut sum = 0.0;
        let steps = steps_of(course.train, trainer.network, recipe, epoch);
        let all = (recipe.epochs * steps.len()) as u64;
        for (step, rows) in steps.iter().enumerate() {
            tell(&epochs, Some(step))?;
            let chance = Stream::new(recipe.seed, "offset").part(epoch as u64);
            let inputs = course.items.laid(trainer.network, rows, recipe, chance);
            let targets = course.targets.pick(rows, trainer.network.outputs());
            trainer.optimiser.share = recipe.schedule.share(trainer.optimiser.steps, all);
            sum += trainer.step(&inputs, &targets)?.loss;
        }
        let mut result = Epoch { loss: sum / steps.len() as f64, score: None };
        if !course.watched.is_empty() {
            let Rating { score, merit } = match is_short {
                true => rate_settled(course, trainer.network, recipe, &rate)?,
                false => rate(trainer.network)?,
            };
            result.score = Some(score);
            if recipe.select != Select::Last && best.as_ref().is_none_or(|b| merit > b.0) {
                best = Some((merit, epoch, trainer.network.parameters().unpacked()));
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
    if is_short {
        settle(course, network, recipe)?;
    }
    Ok(History { epochs, kept })
}

/// Whether a training ends before running statistics have settled.
fn is_short(course: &Course<'_>, network: &Network, recipe: &Recipe) -> bool {
    recipe.epochs * steps_of(course.train, network, recipe, 0).len() < SETTLED
}

/// Steps after which running statistics have forgotten what they began with.
const SETTLED: usize = 100;

/// Sets the running statistics of batch normalisation to the means over the batches of one more epoch, in which
/// nothing is learned. After a few steps they are still near their initial values, and evaluation, which uses them,
/// would not be what was trained.
fn settle(course: &Course<'_>, network: &mut Network, recipe: &Recipe) -> Result<()> {
    let names = running(network);
    if names.is_empty() {
        return Ok(());
    }
    for name in &names {
        network.parameters_mut().get_mut(name).values_mut().fill(0.0);
    }
    let (mut sums, mut items) = (HashMap::<String, Vec<f64>>::new(), 0.0);
    for rows in steps_of(course.train, network, recipe, recipe.epochs) {
        let chance = Stream::new(recipe.seed, "offset").part(recipe.epochs as u64);
        let inputs = course.items.laid(network, &rows, recipe, chance);
        let targets = course.targets.pick(&rows, network.outputs());
        let found =
            network.gradients(&inputs, &targets, &course.loss, &course.class_weights, None)?;
        items += rows.len() as f64;
        for (name, moved) in found.running {
            let sum = sums.entry(name).or_insert_with(|| vec![0.0; moved.len()]);
            let from_zero = moved.iter().map(|&v| f64::from(v) / MOMENTUM * rows.len() as f64);
            sum.iter_mut().zip(from_zero).for_each(|(sum, v)| *sum += v);
        }
    }
    for (name, sum) in sums {
        let values = network.parameters_mut().get_mut(&name).values_mut();
        values.iter_mut().zip(sum).for_each(|(value, sum)| *value = (sum / items) as f32);
    }
    match network.parameters().not_finite() {
        None => Ok(()),
        Some((name, value)) => {
            let (step, what) = (recipe.epochs as u64, format!("the mean of {name}"));
            Err(NetError::Diverged { step, what, value })
        }
    }
}

/// Names of running statistics.
fn running(network: &Network) -> Vec<String> {
    let declared = network.parameters().declared().iter();
    declared.filter(|d| !d.trained).map(|d| d.name.clone()).collect()
}

/// How good the network would be if its training ended here. Training goes on from the statistics that it has.
fn rate_settled(
    course: &Course<'_>,
    network: &mut Network,
    recipe: &Recipe,
    rate: impl Fn(&Network) -> Result<Rating>,
) -> Result<Rating> {
    let of = |network: &Network, name: &String| network.parameters().get(name).values().to_vec();
    let kept: Vec<(String, Vec<f32>)> =
        running(network).into_iter().map(|name| (name.clone(), of(network, &name))).collect();
    settle(course, network, recipe)?;
    let rating = rate(network);
    for (name, values) in kept {
        network.parameters_mut().get_mut(&name).values_mut().copy_from_slice(&values);
    }
    rating
}

/// Duration of the whole training, from one step that changes nothing.
fn trial(
    course: &Course<'_>,
    network: &Network,
    recipe: &Recipe,
    settings: &StepSettings,
) -> Result<Duration> {
    let rows = &steps_of(course.train, network, recipe, 0)[0];
    let inputs = course.items.laid(network, rows, recipe, Stream::new(recipe.seed, "offset"));
    let targets = course.targets.pick(rows, network.outputs());
    let step =
        || network.gradients(&inputs, &targets, &settings.loss, &settings.class_weights, None);
    if network.device().gpu_name().is_some() {
        // The first step translates the layers for the GPU.
        step()?;
    }
    let began = Instant::now();
    step()?;
    let work = |rows: &[usize]| rows.iter().map(|&r| course.items.work(r)).sum::<usize>() as f64;
    // Evaluation takes about a third of a step.
    let is_settled = is_short(course, network, recipe)
        && !course.watched.is_empty()
        && !running(network).is_empty();
    let settling = if is_settled { work(course.train) } else { 0.0 };
    let all = (work(course.train) + work(course.watched) / 3.0 + settling) / work(rows).max(1.0);
    Ok(began.elapsed().mul_f64(all * recipe.epochs as f64))
}

/// The rows of each step of an epoch. A last batch that is too small for the network joins the one before.
fn steps_of(train: &[usize], network: &Network, recipe: &Recipe, epoch: usize) -> Vec<Vec<usize>> {
    let order = Stream::new(recipe.seed, "order").part(epoch as u64).permutation(train.len());
    let rows: Vec<usize> = order.into_iter().map(|i| train[i]).collect();
    let whole = rows.len() / recipe.batch * recipe.batch;
    let used = if recipe.drop_last { whole } else { rows.len() };
    let mut steps: Vec<Vec<usize>> =
        rows[..used].chunks(recipe.batch).map(<[usize]>::to_vec).collect();
    if let [.., before, last] = &mut steps[..]
        && last.len() < network.fewest_items()
    {
        before.append(last);
        steps.pop();
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::Batch;
    use crate::fit::{self, Task};
    use crate::items::{Column, Items};
    use crate::networks;

    /// The last batch of one item set the variance of each number to nine tenths, and the network stored that.
    #[test]
    fn a_single_item_joins_the_batch_before_it() {
        let rows: Vec<usize> = (0..9).collect();
        let lengths = |name: &str, batch: usize| -> Vec<usize> {
            let definition = networks::named(name).unwrap();
            let network = definition.build(None, 0).unwrap();
            let recipe = Recipe { batch, ..definition.recipe };
            steps_of(&rows, &network, &recipe, 0).iter().map(Vec::len).collect()
        };
        assert_eq!(lengths("m2_capacity", 8), [9]);
        assert_eq!(lengths("m2_capacity", 4), [4, 5]);
        assert_eq!(lengths("m2_capacity", 7), [7, 2]);
        // An image has a variance of its own.
        assert_eq!(lengths("m4_type", 8), [8, 1]);

        let network = networks::named("m2_capacity").unwrap().build(None, 0).unwrap();
        let one: Vec<Batch> = network
            .inputs()
            .iter()
            .map(|input| Batch::new(vec![0.5; input.shape.len()], input.shape))
            .collect();
        let targets = crate::loss::Targets::Numbers(vec![1.0]);
        let loss = crate::loss::Loss::Mse;
        let refused = network.gradients(&one, &targets, &loss, &[], None).unwrap_err().to_string();
        assert!(refused.contains("at least 2 items") && refused.contains("has 1"), "{refused}");
    }

    /// Trained to a loss near 0, the network gave every recording the same class: what it had learned by the statistics
    /// of its batches was nothing by the running ones.
    #[test]
    fn a_short_training_is_of_use() {
        let definition = networks::named("mel_cnn").unwrap();
        let mut network = definition.build(Some(2), 0).unwrap();
        let size = network.inputs()[0].shape.len();
        let mut state = 1u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let classes: Vec<usize> = (0..8).map(|i| i % 2).collect();
        let images: Vec<Vec<f32>> = classes
            .iter()
            .map(|&class| {
                let half = |at: usize| usize::from(at >= size / 2);
                (0..size)
                    .map(|at| 10.0 * noise() + if half(at) == class { 6.0 } else { 4.0 })
                    .collect()
            })
            .collect();
        let items = Items { columns: vec![Column::of(images.iter().map(Vec::as_slice))] };
        let rows: Vec<usize> = (0..8).collect();
        let task = Task { items: &items, classes: &classes, train: &rows, watched: &[] };
        let recipe = Recipe { epochs: 12, batch: 8, ..definition.recipe };
        fit::fit(&mut network, task, &recipe, None, |_, _| 0.0, |_| true).unwrap();
        let inputs = items.laid(&network, &rows, &recipe, Stream::new(0, "offset"));
        let watched = Task { items: &items, classes: &classes, train: &rows, watched: &rows };
        let right = |truth: &[usize], found: &[usize]| {
            truth.iter().zip(found).filter(|(t, f)| t == f).count() as f64 / truth.len() as f64
        };
        let mut chosen = definition.build(Some(2), 0).unwrap();
        let by_epoch = Recipe { select: Select::Validation, ..recipe };
        let history = fit::fit(&mut chosen, watched, &by_epoch, None, right, |_| true).unwrap();
        let scores: Vec<f64> = history.epochs.iter().filter_map(|epoch| epoch.score).collect();
        // The score of the epoch that is kept is that of the network that is written.
        let kept = chosen.logits(&inputs).unwrap();
        let found: Vec<usize> =
            kept.values.values().chunks(2).map(|row| usize::from(row[1] > row[0])).collect();
        assert_eq!(scores[history.kept], right(&classes, &found), "{scores:?}");
        assert_eq!(scores[history.kept], 1.0, "{scores:?}");
        let targets = crate::loss::Targets::Classes(classes);
        let targets = targets.pick(&rows, network.outputs());
        let loss = crate::loss::Loss::CrossEntropy;
        let learned = network.gradients(&inputs, &targets, &loss, &[], None).unwrap().outputs;
        let used = network.logits(&inputs).unwrap();
        let both = learned.values.values().iter().zip(used.values.values());
        for (learned, used) in both {
            assert!(
                (learned - used).abs() < 0.02 * learned.abs().max(1.0),
                "{learned}, then {used}"
            );
        }
    }
}
