//! Which epoch is kept, by M6's published choice.

use corsmal_nets::NetError;
use corsmal_nets::cross_validation::{Data, FoldItems, cross_validate, watched};
use corsmal_nets::device::Device;
use corsmal_nets::fit::{Task, fit, probabilities};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::networks;
use corsmal_nets::random::Stream;
use corsmal_nets::recipe::{Recipe, Select};

const NUMBERS: usize = 2050;

/// Vectors of noise, so that a network soon learns them by heart, of three classes in turn.
fn noise(count: usize) -> (Items, Vec<usize>) {
    let stream = Stream::new(1, "noise");
    let values = (0..count * NUMBERS).map(|i| stream.uniform(i as u64) - 0.5).collect();
    let offsets = (0..=count).map(|i| i * NUMBERS).collect();
    (Items { columns: vec![Column { values, offsets }] }, (0..count).map(|i| i % 3).collect())
}

/// Items of three classes.
fn data<'a>(items: &'a Items, classes: &'a [usize], groups: Option<&'a [String]>) -> Data<'a> {
    Data { items, classes, n_classes: 3, groups, weights: None, device: &Device::Cpu }
}

/// A training on all of them.
fn all(count: usize) -> FoldItems {
    FoldItems { name: "all".into(), train: (0..count).collect(), test: vec![] }
}

fn recipe(epochs: usize, select: Select) -> Recipe {
    let usual = networks::named("m1").unwrap().recipe;
    Recipe { epochs, batch: 8, lr: 3e-3, select, seed: 4, ..usual }
}

#[test]
fn the_lowest_loss_on_a_fifth_of_the_training_rows_chooses_the_epoch() {
    let (items, classes) = noise(36);
    let definition = networks::named("m1").unwrap();
    let data = data(&items, &classes, None);
    let fold = FoldItems { name: "f".into(), train: (0..30).collect(), test: (30..36).collect() };
    let recipes = |epochs| recipe(epochs, Select::Split);
    let (train, held, group) = watched(data, &fold, &recipes(5)).unwrap();
    let of_class = |class: usize| held.iter().filter(|&&i| classes[i] == class).count();
    assert_eq!([0, 1, 2].map(of_class), [2, 2, 2]);
    let mut all = [&train[..], &held[..]].concat();
    all.sort_unstable();
    assert_eq!((all, group), (fold.train.clone(), None));

    let score = |_: &[usize], _: &[usize]| 0.5; // equal in every epoch: only the loss tells
    let found = cross_validate(
        definition,
        data,
        std::slice::from_ref(&fold),
        &recipes(5),
        None,
        score,
        |_, _| true,
    );
    let kept = found.unwrap()[0].history.kept;
    let losses: Vec<f64> = (1..=5)
        .map(|epochs| {
            let mut network = definition.build(Some(3), 4).unwrap();
            let task = Task { items: &items, classes: &classes, train: &train, watched: &[] };
            let recipe = recipe(epochs, Select::Last);
            fit(&mut network, task, &recipe, None, score, |_| true).unwrap();
            let proba = probabilities(&network, &items, &held, &recipe).unwrap();
            -held.iter().zip(&proba).map(|(&i, p)| p[classes[i]].ln()).sum::<f64>()
        })
        .collect();
    assert!(losses.iter().all(|loss| *loss >= losses[kept]), "{kept}: {losses:?}");
    assert!(kept < 4, "the last epoch would have been kept anyhow: {losses:?}");
}

#[test]
fn a_fifth_of_too_few_rows_is_refused() {
    let (items, classes) = noise(6);
    let data = data(&items, &classes, None);
    let error = watched(data, &all(6), &recipe(1, Select::Split)).unwrap_err();
    assert!(matches!(&error, NetError::Targets(text) if text.contains("must have 3")), "{error}");
}

/// The epoch was chosen by a class that the network had never seen.
#[test]
fn a_validation_group_leaves_items_of_every_class() {
    let (items, classes) = noise(12);
    let watch = |groups: &[String], seed: u32| {
        let data = data(&items, &classes, Some(groups));
        watched(data, &all(12), &Recipe { seed: seed.into(), ..recipe(1, Select::Validation) })
    };
    // All of the third class is in one group.
    let group = |i: usize| if i % 3 == 2 { "whole".into() } else { format!("g{}", i / 3) };
    let mixed: Vec<String> = (0..12).map(group).collect();
    let chosen: Vec<String> = (0..40).map(|seed| watch(&mixed, seed).unwrap().2.unwrap()).collect();
    assert!(chosen.iter().all(|group| group != "whole"));
    assert!((0..4).all(|g| chosen.contains(&format!("g{g}"))), "{chosen:?}");
    let one_each: Vec<String> = classes.iter().map(|class| format!("g{class}")).collect();
    let error = watch(&one_each, 1).unwrap_err().to_string();
    assert!(error.contains("each of the 3 groups") && error.contains("--groups"), "{error}");
}

#[test]
fn an_epoch_chosen_as_published_needs_a_fold() {
    let (items, classes) = noise(6);
    let data = data(&items, &classes, None);
    let error = watched(data, &all(6), &recipe(1, Select::Published)).unwrap_err();
    assert!(error.to_string().contains("only cross-validation has"), "{error}");
}
