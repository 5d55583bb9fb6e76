//! The training loop, recipes and model files.

use std::collections::HashMap;
use std::time::Duration;

use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzWriter};
use corsmal_nets::NetError;
use corsmal_nets::cross_validation::{Data, FoldItems, cross_validate};
use corsmal_nets::dataset::Dataset;
use corsmal_nets::device::Device;
use corsmal_nets::fit::{History, Task, fit, labels, probabilities};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::loss::{Loss, Targets};
use corsmal_nets::model::{self, NetModel};
use corsmal_nets::network::Network;
use corsmal_nets::networks;
use corsmal_nets::random::Stream;
use corsmal_nets::recipe::{Recipe, Schedule};
use corsmal_nets::trainer::{StepSettings, Trainer};
use serde_json::{Value, json};

/// Part of the classes that is right.
pub(super) fn accuracy(truth: &[usize], found: &[usize]) -> f64 {
    let right = truth.iter().zip(found).filter(|(t, f)| t == f).count();
    right as f64 / truth.len() as f64
}

/// Vectors of M3's length that a few numbers tell apart, a class each third.
pub(super) fn vectors(count: usize) -> (Items, Vec<usize>) {
    let stream = Stream::new(1, "vectors");
    let classes: Vec<usize> = (0..count).map(|i| i % 3).collect();
    let n = 6193;
    let values = (0..count * n).map(|i| {
        let (item, k) = (i / n, i % n);
        let signal = if k % 3 == classes[item] { 0.3 } else { 0.0 };
        stream.uniform(i as u64) - 0.5 + signal
    });
    let values = values.collect();
    (
        Items { columns: vec![Column { values, offsets: (0..=count).map(|i| i * n).collect() }] },
        classes,
    )
}

pub(super) fn recipe(changes: Value) -> Recipe {
    let changes = changes.as_object().unwrap().clone();
    networks::named("m3_mlp").unwrap().recipe.with(&changes).unwrap()
}

fn run(items: &Items, classes: &[usize], recipe: &Recipe) -> (Network, History) {
    let rows: Vec<usize> = (0..items.len()).collect();
    let (train, watched) = rows.split_at(rows.len() * 2 / 3);
    let mut network = networks::named("m3_mlp").unwrap().build(None, 0).unwrap();
    let task = Task { items, classes, train, watched };
    let history = fit(&mut network, task, recipe, None, accuracy, |_| true).unwrap();
    (network, history)
}

#[test]
fn a_network_learns_what_tells_classes_apart() {
    let (items, classes) = vectors(36);
    let recipe = recipe(json!({"epochs": 4, "batch": 6, "lr": 1e-4}));
    let (network, history) = run(&items, &classes, &recipe);
    assert_eq!(history.epochs.len(), 4);
    assert!(history.epochs[3].loss < history.epochs[0].loss / 2.0, "{history:?}");
    let rows: Vec<usize> = (24..36).collect();
    let proba = probabilities(&network, &items, &rows, &recipe).unwrap();
    assert!(proba.iter().all(|p| (p.iter().sum::<f64>() - 1.0).abs() < 1e-5));
    assert!(accuracy(&classes[24..], &labels(&proba)) > 0.9);

    // The same again, the same bits; another seed, others.
    let (again, same) = run(&items, &classes, &recipe);
    let first = |n: &Network| n.parameters().iter().next().unwrap().1.to_vec();
    assert!(first(&again) == first(&network) && same == history);
    let other = Recipe { seed: 9, ..recipe };
    assert!(first(&run(&items, &classes, &other).0) != first(&network));
}

#[test]
fn a_learning_rate_falls_along_a_cosine() {
    let shares = [0, 2, 4].map(|done| Schedule::Cosine.share(done, 4));
    let near = shares.iter().zip([1.0, 0.5, 0.0]).all(|(got, want)| (got - want).abs() < 1e-12);
    assert!(near, "{shares:?}");
    assert_eq!(Schedule::Constant.share(3, 4), 1.0);
    let (items, classes) = vectors(12);
    let with = |schedule: &str| {
        let recipe = recipe(json!({"epochs": 2, "batch": 4, "lr": 1e-4, "schedule": schedule}));
        run(&items, &classes, &recipe).1.epochs
    };
    let (constant, cosine) = (with("constant"), with("cosine"));
    assert_ne!(constant[1].loss, cosine[1].loss);

    // Recipes of before there were schedules.
    let mut old = serde_json::to_value(recipe(json!({}))).unwrap();
    old.as_object_mut().unwrap().remove("schedule");
    assert_eq!(serde_json::from_value::<Recipe>(old).unwrap(), recipe(json!({})));
}

#[test]
fn the_epoch_that_did_best_is_kept_where_the_recipe_says_so() {
    let (items, classes) = vectors(12);
    let changes = json!({"epochs": 3, "batch": 4, "lr": 1e-4, "select": "validation"});
    let (_, history) = run(&items, &classes, &recipe(changes));
    let scores: Vec<f64> = history.epochs.iter().map(|e| e.score.unwrap()).collect();
    assert!(scores.iter().all(|s| *s <= scores[history.kept]), "{history:?}");
}

#[test]
fn progress_tells_the_time_and_can_end_the_training() {
    let (items, classes) = vectors(6);
    let mut network = networks::named("m3_mlp").unwrap().build(None, 0).unwrap();
    let train: Vec<usize> = (0..6).collect();
    let task = Task { items: &items, classes: &classes, train: &train, watched: &[] };
    let mut told = Vec::new();
    let error =
        fit(&mut network, task, &recipe(json!({"epochs": 5})), None, accuracy, |progress| {
            told.push((progress.epochs.len(), progress.step, progress.left));
            progress.epochs.len() < 2
        });
    assert!(matches!(error, Err(NetError::Stopped { epochs: 2 })), "{error:?}");
    let places: Vec<_> = told.iter().map(|t| (t.0, t.1)).collect();
    assert_eq!(places, [(0, None), (0, Some(0)), (1, None), (1, Some(0)), (2, None)]);
    assert!(told[0].2 > Duration::ZERO, "the duration is predicted before the first epoch");
    // Between two steps of an epoch, too.
    let recipe = recipe(json!({"epochs": 5, "batch": 2}));
    let error = fit(&mut network, task, &recipe, None, accuracy, |p| p.step != Some(1));
    assert!(matches!(error, Err(NetError::Stopped { epochs: 0 })), "{error:?}");
}

#[test]
fn folds_are_scored_on_what_they_hold_out() {
    let (items, classes) = vectors(12);
    let groups: Vec<String> = (0..12).map(|i| format!("g{}", i / 3)).collect();
    let folds: Vec<FoldItems> = [(0, 6), (6, 12)]
        .map(|(from, to)| FoldItems {
            name: format!("{from}"),
            train: (0..12).filter(|i| !(from..to).contains(i)).collect(),
            test: (from..to).collect(),
        })
        .to_vec();
    let definition = networks::named("m3_mlp").unwrap();
    let run = |select: &str, groups: Option<&[String]>| {
        let recipe = recipe(json!({"epochs": 2, "batch": 3, "lr": 1e-4, "select": select}));
        let data = Data {
            items: &items,
            classes: &classes,
            n_classes: 3,
            groups,
            weights: None,
            device: &Device::Cpu,
        };
        cross_validate(definition, data, &folds, &recipe, None, accuracy, |_, _| true)
    };
    let found = run("validation", Some(&groups)).unwrap();
    for (result, fold) in found.iter().zip(&folds) {
        assert_eq!((&result.test, result.probabilities.len()), (&fold.test, 6));
        let group = result.validation.as_ref().unwrap();
        assert!(fold.train.iter().any(|&i| groups[i] == *group), "{group} is a training group");
        assert!(result.history.epochs.iter().all(|e| e.score.is_some()));
    }
    let last = run("last", None).unwrap();
    assert!(last.iter().all(|r| r.history.kept == 1 && r.validation.is_none()));
    assert!(run("validation", None).unwrap_err().to_string().contains("needs groups"));
}

#[test]
fn impossible_recipes_and_tasks_are_refused() {
    let base = networks::named("m4_level").unwrap().recipe;
    for (key, value, expected) in [
        ("lr", json!(0.0), "above 0"),
        ("batch", json!(0), "1 to"),
        ("padding", json!("zeros"), "masked"),
        ("epoch", json!(3), "epochs"),
    ] {
        let changes = json!({key: value}).as_object().unwrap().clone();
        let text = base.with(&changes).unwrap_err().to_string();
        assert!(text.contains(key) && text.contains(expected), "{text}");
    }
    let (mut items, classes) = vectors(6);
    let mut network = networks::named("m3_mlp").unwrap().build(None, 0).unwrap();
    let mut refuse = |items: &Items, classes: &[usize], train: &[usize], expected: &str| {
        let task = Task { items, classes, train, watched: &[] };
        let error = fit(&mut network, task, &recipe(json!({})), None, accuracy, |_| true);
        let text = error.unwrap_err().to_string();
        assert!(text.contains(expected), "{text}");
    };
    refuse(&items, &classes, &[0, 3], "2 classes");
    refuse(&items, &classes, &[0, 7], "item 7 of 6");
    refuse(&items, &classes[1..], &[0, 1], "5 classes for 6 items");
    refuse(&items, &[0, 1, 2, 3, 0, 1], &[0, 1], "class 3 for a network of 3");
    items.columns[0].values[6193 + 5] = f32::NAN;
    refuse(&items, &classes, &[0, 1], "item 1: NaN");
    items.columns[0].values[6193 + 5] = 0.0;
    items.columns[0].offsets[6] -= 1;
    refuse(&items, &classes, &[0, 1], "6192 numbers (item 5)");
}

#[test]
fn a_model_file_gives_back_the_network() {
    let (items, classes) = vectors(6);
    let recipe = recipe(json!({"epochs": 1}));
    let (network, history) = run(&items, &classes, &recipe);
    let header = model::Header {
        format: 0,
        network: "m3_mlp".into(),
        labels: vec!["a".into(), "b".into(), "c".into()],
        target: "level".into(),
        recipe,
        gpu: None,
        history,
        feature_config: Value::Null,
        provenance: json!({"rows": 6}),
        tool_version: "0".into(),
    };
    let model = NetModel::new(header, network).unwrap();
    let bytes = model.to_bytes().unwrap();
    assert!(bytes == model.to_bytes().unwrap(), "the same model is the same bytes");
    let back = NetModel::from_bytes(&bytes).unwrap();
    assert_eq!(back.header, model.header);
    assert_eq!(back.predict_proba(&items).unwrap(), model.predict_proba(&items).unwrap());
    for cut in [0, 7, 300, bytes.len() - 1] {
        assert!(NetModel::from_bytes(&bytes[..cut]).is_err());
    }
    let mut damaged = bytes.clone();
    damaged[bytes.len() - 9] ^= 1;
    let text = NetModel::from_bytes(&damaged).unwrap_err();
    assert!(text.contains("damaged: its content does not match the hash"), "{text}");
    // Networks of version 0.1.0 have none.
    let state = corsmal_nets::weights::from_safetensors(&bytes).unwrap();
    let text = serde_json::to_string(&model.header).unwrap();
    let texts = HashMap::from([("corsmal-feat".to_owned(), text)]);
    let old = corsmal_nets::weights::to_safetensors(&state, Some(texts)).unwrap();
    assert_eq!(NetModel::from_bytes(&old).unwrap().header, model.header);
    // As many outputs as labels: told before numbers are made for them.
    for (network, labels, expected) in [
        ("m3_mlp", 1 << 16, "is missing"),
        ("m3_mlp", 1 << 20, "65536"),
        ("m2_capacity", 1, "numbers, not classes"),
    ] {
        let labels = (0..labels).map(|i| i.to_string()).collect();
        let header = model::Header { network: network.into(), labels, ..model.header.clone() };
        let text = serde_json::to_string(&header).unwrap();
        let texts = HashMap::from([("corsmal-feat".to_owned(), text)]);
        let bytes = corsmal_nets::weights::to_safetensors(&Vec::new(), Some(texts)).unwrap();
        let text = NetModel::from_bytes(&bytes).unwrap_err();
        assert!(text.contains(expected), "{text}");
    }
    let plain = corsmal_nets::weights::to_safetensors(&Vec::new(), None).unwrap();
    let text = NetModel::from_bytes(&plain).unwrap_err();
    assert!(text.contains("weights only"), "{text}");
}

#[test]
fn four_views_are_joined_to_recordings() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("views.npz");
    let mut npz = NpzWriter::create(&path, Compression::Stored).unwrap();
    // Two recordings, views out of order, view v of recording r filled with 10 r + v.
    let order: [(i64, i64); 8] = [(0, 2), (1, 1), (0, 1), (0, 4), (1, 3), (1, 4), (0, 3), (1, 2)];
    let (mut x, mut offsets) = (Vec::new(), vec![0i64]);
    for (r, v) in order {
        x.extend(vec![(10 * r + v) as f32; (r as usize + 1) * 512]);
        offsets.push(x.len() as i64 / 512);
    }
    npz.floats("X", &[x.len() / 512, 512], &x).unwrap();
    let ints = |npz: &mut NpzWriter, name: &str, values: &[i64]| {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let header = Header::new(DType::parse("<i8").unwrap(), &[values.len()]);
        npz.array(name, &header, &bytes).unwrap();
    };
    ints(&mut npz, "offsets", &offsets);
    ints(&mut npz, "view", &order.map(|(_, v)| v));
    ints(&mut npz, "container", &order.map(|(r, _)| r + 1));
    npz.finish().unwrap();
    let network = networks::named("m5_r21d_type").unwrap().build(None, 0).unwrap();
    let data = Dataset::read(&path, &network).unwrap();
    assert_eq!(data.column("container").unwrap(), ["1", "2"]);
    assert_eq!(data.ids, ["0", "1"]);
    for (view, column) in data.items.columns.iter().enumerate() {
        assert_eq!(column.offsets, [0, 512, 3 * 512]);
        assert_eq!(column.values[0], view as f32 + 1.0);
        assert_eq!(column.values[512], view as f32 + 11.0);
    }
    let other = networks::named("m5_vggish_level").unwrap().build(None, 0).unwrap();
    let text = Dataset::read(&path, &other).unwrap_err().to_string();
    assert!(text.contains("views.npz") && text.contains("512 numbers per row"), "{text}");
}

#[test]
fn numbers_that_are_not_finite_end_the_training_or_the_prediction() {
    let (mut items, classes) = vectors(6);
    let mut network = networks::named("m3_mlp").unwrap().build(None, 0).unwrap();
    let rows: Vec<usize> = (0..6).collect();
    let task = Task { items: &items, classes: &classes, train: &rows, watched: &[] };
    // The first step's loss and gradients are fine, what it makes of the parameters is not.
    let recipe = recipe(json!({"epochs": 1, "lr": 1e39}));
    let error = fit(&mut network, task, &recipe, None, accuracy, |_| true).unwrap_err();
    let NetError::Diverged { step: 1, what, .. } = &error else { panic!("{error}") };
    assert!(what.ends_with(".weight"), "{error}");

    network.start(0);
    let n = 6193;
    items.columns[0].values[n..2 * n].fill(3e38);
    let error = probabilities(&network, &items, &rows, &recipe).unwrap_err();
    assert!(matches!(error, NetError::Output { item: 1, .. }), "{error}");

    // Large inputs: the loss is as always after a normalisation, whose running variance is not.
    let definition = networks::named("m4_type").unwrap();
    let mut network = definition.build(None, 0).unwrap();
    let before: Vec<f32> = network.parameters().iter().flat_map(|(_, v)| v.to_vec()).collect();
    let values: Vec<f32> = (0..2 * 8 * 64 * 64).map(|i| (i % 7) as f32 * 1e24).collect();
    let items = Items { columns: vec![Column::of(values.chunks(8 * 64 * 64))] };
    let settings = StepSettings {
        optimiser: definition.recipe.optimiser(),
        clip_grad_norm: None,
        loss: Loss::CrossEntropy,
        class_weights: Vec::new(),
        dropout: None,
    };
    let inputs = items.batch(&network, &[0, 1], definition.recipe.padding);
    let mut trainer = Trainer::new(&mut network, settings);
    let error = trainer.step(&inputs, &Targets::Classes(vec![0, 1])).unwrap_err();
    assert!(error.to_string().contains("running_var is inf"), "{error}");
    let after: Vec<f32> = network.parameters().iter().flat_map(|(_, v)| v.to_vec()).collect();
    assert!(after == before, "as it was");
}

/// They were taken, and recorded in the model.
#[test]
fn settings_without_effect_are_refused() {
    let refused = |name: &str, changes: Value| {
        let definition = networks::named(name).unwrap();
        definition.recipe_with(changes.as_object().unwrap()).map_err(|e| e.to_string())
    };
    let both = json!({"padding": "published", "offset": "random"});
    let reason = refused("attention_gru", both).unwrap_err();
    assert!(reason.contains("padding"), "{reason}");
    assert!(refused("attention_gru", json!({"padding": "published"})).is_ok());
    assert!(refused("attention_gru", json!({"offset": "random"})).is_ok());
    for name in ["m5_vggish_level", "m3_mlp", "m6_action"] {
        let reason = refused(name, json!({"dropout": false})).unwrap_err();
        assert!(reason.contains("the network has no dropout"), "{reason}");
    }
    for name in ["m1", "m4_level"] {
        assert!(refused(name, json!({"dropout": false})).is_ok(), "{name}");
    }
}
