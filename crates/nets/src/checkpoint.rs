//! A training on disk after each epoch: a safetensors file of parameters and moments, whose text
//! entry says how far it came. A training that goes on from it ends in the same bytes.

use std::collections::HashMap;
use std::path::Path;

use corsmal_files::sealed::Seal;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::course::Course;
use crate::history::Epoch;
use crate::loss::Targets;
use crate::network::Network;
use crate::parameters::Parameters;
use crate::recipe::Recipe;
use crate::trainer::Trainer;
use crate::weights::{self, State, WeightsError};

const ENTRY: &str = "corsmal-feat-checkpoint";

/// The best epoch so far: its merit, number, parameters.
pub(crate) type Best = Option<(f64, usize, Parameters)>;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    /// what training it belongs to
    key: String,
    steps: u64,
    epochs: Vec<Epoch>,
    best: Option<(f64, usize)>,
}

/// Says which training this is: recipe, network, GPU, items, targets, rows, what it begins with.
pub(crate) fn key(network: &Network, course: &Course<'_>, recipe: &Recipe) -> String {
    let mut hash = blake3::Hasher::new();
    // Checkpoints from before there were schedules go on.
    let recipe = serde_json::to_string(recipe).unwrap_or_default();
    let recipe = recipe.replace(r#""schedule":"constant","#, "");
    hash.update(format!("{} {recipe}", network.name()).as_bytes());
    if let Some(gpu) = network.device().gpu_name() {
        hash.update(gpu.as_bytes());
    }
    let (classes, numbers): (&[usize], &[f32]) = match course.targets {
        Targets::Classes(classes) => (classes, &[]),
        Targets::Numbers(numbers) => (&[], numbers),
    };
    numbers.iter().for_each(|v| {
        hash.update(&v.to_le_bytes());
    });
    for numbers in [classes, course.train, course.watched] {
        hash.update(b"/");
        numbers.iter().for_each(|n| {
            hash.update(&(*n as u64).to_le_bytes());
        });
    }
    for column in &course.items.columns {
        hash.update(b"/");
        column.offsets.iter().for_each(|n| {
            hash.update(&(*n as u64).to_le_bytes());
        });
        let bytes: Vec<u8> = column.values.iter().flat_map(|v| v.to_le_bytes()).collect();
        hash.update(&bytes);
    }
    for (name, _, values) in network.beginning().into_iter().flatten() {
        hash.update(name.as_bytes());
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        hash.update(&bytes);
    }
    hash.finalize().to_hex().to_string()
}

fn state_of(parameters: &Parameters, prefix: &str, state: &mut State) {
    for (declared, values) in parameters.iter() {
        let name = format!("{prefix}{}", declared.name);
        state.push((name, declared.shape.clone(), values.to_vec()));
    }
}

/// Writes the training as it is, whole or not at all.
pub(crate) fn save(
    path: &Path,
    key: &str,
    trainer: &Trainer<'_>,
    epochs: &[Epoch],
    best: &Best,
) -> Result<(), WeightsError> {
    let mut state = State::new();
    let parameters = trainer.network.parameters();
    state_of(parameters, "now.", &mut state);
    if let Some((_, _, best)) = best {
        state_of(best, "best.", &mut state);
    }
    let trained = parameters.declared().iter().filter(|d| d.trained);
    for (declared, [first, second]) in trained.zip(&trainer.optimiser.moments) {
        for (moment, values) in [("first", first), ("second", second)] {
            let name = format!("{moment}.{}", declared.name);
            state.push((name, vec![values.len()], values.clone()));
        }
    }
    let text = Text {
        key: key.into(),
        steps: trainer.optimiser.steps,
        epochs: epochs.to_vec(),
        best: best.as_ref().map(|b| (b.0, b.1)),
    };
    let content = |reason| WeightsError::Content { path: path.into(), reason };
    let text = weights::sealed(&text, &state).map_err(content)?;
    let texts = HashMap::from([(ENTRY.to_owned(), text)]);
    let bytes = weights::to_safetensors(&state, Some(texts)).map_err(content)?;
    corsmal_files::draft::write(path, &bytes)
        .map_err(|source| WeightsError::Io { path: path.into(), source })
}

/// Most steps of a training: beyond them a share of it would not be exact.
const MOST_STEPS: u64 = 1 << f64::MANTISSA_DIGITS;

/// Goes on from a file, where there is one, with a training of so many `epochs`.
pub(crate) fn resume(
    path: &Path,
    (key, epochs): (&str, usize),
    trainer: &mut Trainer<'_>,
) -> Result<(Vec<Epoch>, Best), WeightsError> {
    if !path.exists() {
        return Ok((Vec::new(), None));
    }
    let content = |reason: String| WeightsError::Content { path: path.into(), reason };
    let bytes = weights::bytes(path)?;
    let text = weights::safetensors_text(&bytes, ENTRY)
        .map_err(content)?
        .ok_or_else(|| content("not a training checkpoint".into()))?;
    let mut text: Value = serde_json::from_str(&text).map_err(|e| content(e.to_string()))?;
    let seal = Seal::take(&mut text);
    let text: Text = serde_json::from_value(text).map_err(|e| content(e.to_string()))?;
    if text.key != key {
        return Err(content(
            "the checkpoint is from another training run (recipe, items or rows differ); remove \
             it, or give another file"
                .into(),
        ));
    }
    let is_possible = text.epochs.len() <= epochs
        && text.steps <= MOST_STEPS
        && text.best.is_none_or(|(_, epoch)| epoch < text.epochs.len());
    if !is_possible {
        let (done, steps) = (text.epochs.len(), text.steps);
        return Err(content(format!(
            "the checkpoint has {done} of {epochs} epochs and {steps} steps, which cannot be; remove it"
        )));
    }
    let state = weights::from_safetensors(&bytes).map_err(content)?;
    let damaged = |reason| content(format!("the checkpoint is {reason}; remove it"));
    seal.check(weights::numbers(&state)).map_err(damaged)?;
    let mut parts: HashMap<String, State> = HashMap::new();
    for (name, shape, values) in state {
        let (part, name) = name.split_once('.').unwrap_or(("", &name));
        parts.entry(part.into()).or_default().push((name.into(), shape, values));
    }
    let mut part = |name: &str| parts.remove(name).unwrap_or_default();
    let mut parameters = trainer.network.parameters().clone();
    let mut load = |state: &State| {
        parameters.load("the checkpoint", state).map_err(|e| content(e.to_string()))?;
        Ok::<_, WeightsError>(parameters.clone())
    };
    let now = load(&part("now"))?;
    let best = match text.best {
        Some((score, epoch)) => Some((score, epoch, load(&part("best"))?)),
        None => None,
    };
    for (moment, name) in ["first", "second"].into_iter().enumerate() {
        let values: HashMap<String, Vec<f32>> =
            part(name).into_iter().map(|(name, _, values)| (name, values)).collect();
        let trained = now.declared().iter().filter(|d| d.trained);
        for (declared, moments) in trained.zip(&mut trainer.optimiser.moments) {
            match values.get(&declared.name) {
                Some(values) if values.len() == moments[moment].len() => {
                    moments[moment].copy_from_slice(values);
                }
                _ => return Err(content(format!("no {name} moment of {}", declared.name))),
            }
        }
    }
    trainer.optimiser.steps = text.steps;
    *trainer.network.parameters_mut() = now;
    Ok((text.epochs, best))
}
