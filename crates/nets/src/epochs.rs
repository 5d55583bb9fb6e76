//! The training loop, whatever is learned.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::checkpoint;
use crate::course::Course;
use crate::error::{NetError, Result};
use crate::history::{Epoch, History, Progress};
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
        let steps = steps_of(course.train, recipe, epoch);
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
            let Rating { score, merit } = rate(trainer.network)?;
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
    Ok(History { epochs, kept })
}

/// Duration of the whole training, from one step that changes nothing.
fn trial(
    course: &Course<'_>,
    network: &Network,
    recipe: &Recipe,
    settings: &StepSettings,
) -> Result<Duration> {
    let rows = &steps_of(course.train, recipe, 0)[0];
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
    let all = (work(course.train) + work(course.watched) / 3.0) / work(rows).max(1.0);
    Ok(began.elapsed().mul_f64(all * recipe.epochs as f64))
}

/// The rows of each step of an epoch.
fn steps_of(train: &[usize], recipe: &Recipe, epoch: usize) -> Vec<Vec<usize>> {
    let order = Stream::new(recipe.seed, "order").part(epoch as u64).permutation(train.len());
    let rows: Vec<usize> = order.into_iter().map(|i| train[i]).collect();
    let whole = rows.len() / recipe.batch * recipe.batch;
    let used = if recipe.drop_last { whole } else { rows.len() };
    rows[..used].chunks(recipe.batch).map(<[usize]>::to_vec).collect()
}
