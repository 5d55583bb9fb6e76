//! How M2's network learns capacities.

use std::path::Path;

use super::estimate::{LARGEST_ML, millilitres_of};
use super::network::{CapacityNetwork, FORMAT, Header};
use crate::course::Course;
use crate::epochs::{self, Rating};
use crate::error::{NetError, Result};
use crate::fit::Progress;
use crate::items::{Column, Items};
use crate::loss::{Loss, Targets};
use crate::network::Network;
use crate::networks::{self, Definition};
use crate::random::Stream;
use crate::recipe::{Recipe, Select};

/// The part of the examples that no step sees, as published.
const WATCHED: f64 = 0.15;

/// A region whose container's capacity is known.
#[derive(Clone, Copy, Debug)]
pub struct Example<'a> {
    /// the region's depth over 700 mm, resized to 112 by 112, row by row
    pub depth: &'a [f32],
    /// its height over 720 px and width over 1280 px
    pub size: [f32; 2],
    /// capacity in mL
    pub millilitres: f64,
}

/// The recipe of M2's network with some keys replaced; keys that mean nothing to it are refused.
///
/// # Errors
/// [`NetError::Recipe`], [`NetError::RecipeKey`].
pub fn recipe(changes: &serde_json::Map<String, serde_json::Value>) -> Result<Recipe> {
    let definition = definition()?;
    let (usual, recipe) = (definition.recipe, definition.recipe_with(changes)?);
    let without = [
        ("class_weights", usual.class_weights == recipe.class_weights),
        ("dropout", usual.dropout == recipe.dropout),
        ("padding", usual.padding == recipe.padding),
        ("offset", usual.offset == recipe.offset),
        ("activation", usual.activation == recipe.activation),
        ("select", matches!(recipe.select, Select::Last | Select::Validation)),
    ];
    let Some((key, _)) = without.into_iter().find(|(_, unchanged)| !unchanged) else {
        return Ok(recipe);
    };
    let value = changes.get(key).map(ToString::to_string).unwrap_or_default();
    let allowed = match key {
        "select" => "last or validation; M2 has no test fold".to_owned(),
        _ => format!("only its usual value: {} does not use it", definition.name),
    };
    Err(NetError::Recipe { key: key.into(), value, allowed })
}

fn definition() -> Result<&'static Definition> {
    networks::named("m2_capacity")
}

/// Trains M2's network: the squared error of the capacity over 4000 mL on a random 85 % of the examples. The score
/// of an epoch is the benchmark's, exp(-|error| / capacity), over the other 15 %. `provenance` goes into
/// the model; `checkpoint` and `progress` are those of [`crate::fit::fit`].
///
/// # Errors
/// Fewer than two examples to learn from, or regions that the network does not take;
/// [`NetError::Diverged`]; [`NetError::Stopped`]; [`NetError::Checkpoint`].
pub fn train(
    examples: &[Example<'_>],
    recipe: &Recipe,
    provenance: serde_json::Value,
    checkpoint: Option<&Path>,
    progress: impl FnMut(Progress<'_>) -> bool,
) -> Result<CapacityNetwork> {
    recipe.check()?;
    let mut network = definition()?.build(None, recipe.seed)?;
    let items = Items {
        columns: vec![
            Column::of(examples.iter().map(|e| e.depth)),
            Column::of(examples.iter().map(|e| &e.size[..])),
        ],
    };
    items.check(&network)?;
    let order = Stream::new(recipe.seed, "validation").permutation(examples.len());
    let (watched, train) = order.split_at((examples.len() as f64 * WATCHED) as usize);
    refuse(examples, train.len(), watched.len(), recipe)?;
    let numbers = examples.iter().map(|e| (e.millilitres / LARGEST_ML) as f32).collect();
    let course = Course {
        items: &items,
        targets: &Targets::Numbers(numbers),
        train,
        watched,
        loss: Loss::Mse,
        class_weights: Vec::new(),
    };
    let rate = |network: &Network| {
        let score = |&row: &usize| {
            let Example { depth, size, millilitres } = examples[row];
            let estimate = millilitres_of(network, depth, size)?;
            Ok(score_of(estimate, millilitres))
        };
        let scores: Result<Vec<f64>> = watched.iter().map(score).collect();
        let score = scores?.iter().sum::<f64>() / watched.len() as f64;
        Ok(Rating { score, merit: score })
    };
    let history = epochs::run(&course, &mut network, recipe, checkpoint, rate, progress)?;
    let header = Header {
        format: FORMAT,
        network: network.name().into(),
        recipe: *recipe,
        history,
        provenance,
        tool_version: env!("CARGO_PKG_VERSION").into(),
    };
    Ok(CapacityNetwork { network, header: Some(header) })
}

/// The benchmark's score; an estimate that no container has scores nothing.
fn score_of(estimate: f64, millilitres: f64) -> f64 {
    if estimate > 0.0 { (-(estimate - millilitres).abs() / millilitres).exp() } else { 0.0 }
}

fn refuse(examples: &[Example<'_>], train: usize, watched: usize, recipe: &Recipe) -> Result<()> {
    let refuse = |text: String| Err(NetError::Targets(text));
    let sound = |e: &&Example<'_>| !(e.millilitres.is_finite() && e.millilitres > 0.0);
    if let Some(bad) = examples.iter().find(sound) {
        return refuse(format!("a capacity of {} mL: expected more than 0", bad.millilitres));
    }
    if train < 2 {
        return refuse(format!("{} regions: training needs at least 2", examples.len()));
    }
    if recipe.drop_last && train < recipe.batch {
        let batch = recipe.batch;
        return refuse(format!("{train} items do not fill a batch of {batch} (drop_last)"));
    }
    if recipe.select != Select::Last && watched == 0 {
        return refuse(format!(
            "{} regions: choosing an epoch needs at least 7, of which 15 % are held out",
            examples.len()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::estimate::SIDE;
    use super::*;

    /// Images whose depth says the capacity.
    fn images() -> Vec<(Vec<f32>, f64)> {
        let image = |i: usize| vec![0.2 + 0.1 * (i % 8) as f32; SIDE * SIDE];
        (0..8).map(|i| (image(i), 200.0 + 300.0 * (i % 8) as f64)).collect()
    }

    fn examples(images: &[(Vec<f32>, f64)]) -> Vec<Example<'_>> {
        let mut examples = Vec::new();
        for (depth, millilitres) in images {
            examples.push(Example { depth, size: [0.3, 0.1], millilitres: *millilitres });
        }
        examples
    }

    fn with(text: serde_json::Value) -> Result<Recipe> {
        recipe(text.as_object().unwrap())
    }

    #[test]
    fn impossible_estimates_score_nothing() {
        assert_eq!((score_of(300.0, 300.0), score_of(600.0, 300.0)), (1.0, (-1.0f64).exp()));
        assert_eq!((score_of(-5.8, 3209.0), score_of(0.0, 300.0)), (0.0, 0.0));
    }

    #[test]
    fn the_loss_falls_and_threads_change_nothing() {
        let images = images();
        let recipe = |epochs: usize| {
            with(json!({"epochs": epochs, "batch": 4, "lr": 0.004, "seed": 3})).unwrap()
        };
        let run = |threads: usize, epochs: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let made = json!({"from": "a test"});
                train(&examples(&images), &recipe(epochs), made, None, |_| true).unwrap()
            })
        };
        let trained = run(1, 6);
        let epochs = &trained.header.as_ref().unwrap().history.epochs;
        assert!(epochs[5].loss < 0.5 * epochs[0].loss, "{epochs:?}");
        assert!(epochs.iter().all(|e| e.score.is_some_and(|s| (0.0..=1.0).contains(&s))));
        let bytes = trained.to_bytes().unwrap();
        let [one, two] = [1, 2].map(|threads| run(threads, 1).to_bytes().unwrap());
        assert!(one == two);
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("m2.capacity");
        std::fs::write(&file, &bytes).unwrap();
        // As a model, and as whatever the file is.
        let model = CapacityNetwork::read_model(&file).unwrap();
        let weights = CapacityNetwork::read(&file).unwrap();
        assert_eq!([&model.header, &weights.header], [&trained.header; 2]);
        let of = |n: &CapacityNetwork| n.millilitres(&images[2].0, [0.3, 0.1]).unwrap();
        assert_eq!([of(&model), of(&weights)], [of(&trained); 2]);
        let mut damaged = bytes.clone();
        damaged[bytes.len() - 9] ^= 1;
        std::fs::write(&file, &damaged).unwrap();
        for read in [CapacityNetwork::read_model, CapacityNetwork::read] {
            let text = read(&file).unwrap_err().to_string();
            assert!(text.contains("damaged"), "{text}");
        }
    }

    #[test]
    fn what_cannot_be_learned_is_refused() {
        let images = images();
        let all = examples(&images);
        let quick = with(json!({"epochs": 1})).unwrap();
        let refusal = |examples: &[Example<'_>], recipe: &Recipe| {
            train(examples, recipe, json!(null), None, |_| true).unwrap_err().to_string()
        };
        assert!(refusal(&all[..1], &quick).contains("at least 2"));
        let odd = Example { millilitres: f64::NAN, ..all[0] };
        assert!(refusal(&[all[0], all[1], odd], &quick).contains("more than 0"));
        let short = Example { depth: &all[0].depth[1..], ..all[0] };
        assert!(refusal(&[all[0], short], &quick).contains("12543"));
        let full = with(json!({"drop_last": true, "batch": 16})).unwrap();
        assert!(refusal(&all, &full).contains("drop_last"));
        let choosing = with(json!({"select": "validation"})).unwrap();
        assert!(refusal(&all[..6], &choosing).contains("at least 7"));
        for useless in [json!({"dropout": false}), json!({"select": "published"})] {
            let message = with(useless.clone()).unwrap_err().to_string();
            let key = useless.as_object().unwrap().keys().next().unwrap();
            assert!(message.contains(key.as_str()), "{message}");
        }
        let stopped = train(&all, &quick, json!(null), None, |_| false).unwrap_err();
        assert!(matches!(stopped, NetError::Stopped { epochs: 0 }));
    }

    #[test]
    fn a_stopped_training_goes_on_from_its_checkpoint() {
        let images = images();
        let all = examples(&images);
        let recipe = with(json!({"epochs": 2, "batch": 4})).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("training.safetensors");
        let whole = train(&all, &recipe, json!(null), None, |_| true).unwrap();
        let one = |told: Progress<'_>| told.epochs.is_empty();
        train(&all, &recipe, json!(null), Some(&place), one).unwrap_err();
        let resumed = train(&all, &recipe, json!(null), Some(&place), |_| true).unwrap();
        assert_eq!(resumed.to_bytes().unwrap(), whole.to_bytes().unwrap());
    }
}
