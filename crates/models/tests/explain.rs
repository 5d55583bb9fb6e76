//! What a classifier relies on, and learning curves.

#![allow(clippy::unwrap_used)]

use corsmal_models::classifiers::ClassifierSpec;
use corsmal_models::explain::{Family, Setting, families, learning_curve, permutation_importance};
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::splits::{Fold, stratified_k_fold};
use ndarray::Array2;

/// Two classes: the first two columns tell them apart, the third is noise.
fn table() -> (Array2<f64>, Vec<usize>) {
    let y: Vec<usize> = (0..120).map(|row| row % 2).collect();
    let noise = |row: usize, k: usize| ((row * 7919 + k * 104_729) % 1000) as f64 / 1000.0 - 0.5;
    let x = Array2::from_shape_fn((120, 3), |(row, column)| match column {
        2 => noise(row, 2),
        k => (row % 2) as f64 + 0.8 * noise(row, k),
    });
    (x, y)
}

fn forest() -> PipelineSpec {
    PipelineSpec::plain(ClassifierSpec::new("rf", &Default::default()).unwrap())
}

fn named(names: &[&str]) -> Vec<String> {
    names.iter().map(|n| n.to_string()).collect()
}

#[test]
fn families_are_named_by_their_feature() {
    let names = [
        "mfcc[0].mean",
        "zcr.mean",
        "mfcc[1].std",
        "x",
        "af193[chroma_2]",
        "af193[f_a]",
        "ch3/mfcc[0].mean",
        "mfcc_12_mean",
        "energy_entropy_mean",
    ];
    let found = families(&named(&names));
    let names: Vec<_> = found.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(names, ["mfcc", "zcr", "x", "chroma", "f_a", "energy_entropy_mean"]);
    assert_eq!(found[0].columns, [0, 2, 6, 7]);
}

#[test]
fn what_tells_the_classes_apart_is_important() {
    let (x, y) = table();
    let folds = stratified_k_fold(&y, 4, Some(1)).unwrap();
    let spec = forest();
    let setting =
        Setting { x: x.view(), y: &y, n_classes: 2, folds: &folds, groups: None, spec: &spec };
    let families = families(&named(&["good[0]", "good[1]", "noise[0]"]));
    let found = permutation_importance(&setting, &families, 3, 7).unwrap();
    assert!(found[0].mean > 0.3, "{found:?}");
    assert!(found[1].mean.abs() < 0.05, "{found:?}");
    assert!(found.iter().all(|i| i.low <= i.mean && i.mean <= i.high));
    assert_eq!((found[0].features, found[1].features), (2, 1));
    // The seed decides.
    assert_eq!(found, permutation_importance(&setting, &families, 3, 7).unwrap());
}

#[test]
fn more_rows_help_until_all_are_used() {
    let (x, y) = table();
    let folds = stratified_k_fold(&y, 4, Some(1)).unwrap();
    let spec = forest();
    let setting =
        Setting { x: x.view(), y: &y, n_classes: 2, folds: &folds, groups: None, spec: &spec };
    let curve = learning_curve(&setting, &[0.01, 0.5, 1.0], 3).unwrap().points;
    let rows: Vec<f64> = curve.iter().map(|p| p.rows).collect();
    assert_eq!((rows[0], rows[2]), (4.0, 90.0));
    assert!((44.0..=46.0).contains(&rows[1]), "{rows:?}");
    assert!(curve[2].mean > 0.85 && curve[2].mean >= curve[0].mean, "{curve:?}");
}

/// The report was lost when the smallest part was too small for the classifier.
#[test]
fn parts_that_are_too_small_have_no_point() {
    let (x, y) = table();
    let folds = stratified_k_fold(&y, 4, Some(1)).unwrap();
    let parameters = serde_json::json!({"k": 15});
    let knn = ClassifierSpec::new("knn", parameters.as_object().unwrap()).unwrap();
    let spec = PipelineSpec::plain(knn);
    let setting =
        Setting { x: x.view(), y: &y, n_classes: 2, folds: &folds, groups: None, spec: &spec };
    let curve = learning_curve(&setting, &[0.05, 0.1, 0.5, 1.0], 3).unwrap();
    assert_eq!(curve.points.len(), 2);
    let (share, reason) = curve.refused.unwrap();
    assert!(share == 0.1 && reason.contains("k must be at most"), "{reason}");
}

/// Parts of every recording tell nothing about more recordings.
#[test]
fn whole_groups_are_learned_from() {
    let (x, y) = table();
    // Ten rows of a class in a group.
    let mut seen = [0; 2];
    let group = |class: &usize| {
        seen[*class] += 1;
        format!("{class}-{}", (seen[*class] - 1) / 10)
    };
    let groups: Vec<String> = y.iter().map(group).collect();
    let all: Vec<usize> = (0..y.len()).collect();
    let folds = vec![Fold { name: "f".into(), train: all.clone(), test: all }];
    let spec = forest();
    let groups = Some(&groups[..]);
    let setting = Setting { x: x.view(), y: &y, n_classes: 2, folds: &folds, groups, spec: &spec };
    let curve = learning_curve(&setting, &[0.01, 1.0], 3).unwrap().points;
    assert_eq!((curve[0].rows, curve[1].rows), (40.0, y.len() as f64));
    // Two of six groups that hold both classes: the same two of each.
    let shared: Vec<String> = (0..y.len()).map(|row| (row / 20).to_string()).collect();
    let setting = Setting { groups: Some(&shared), ..setting };
    let curve = learning_curve(&setting, &[0.1, 0.3, 1.0], 3).unwrap().points;
    assert_eq!((curve.len(), curve[0].rows), (2, 40.0), "{curve:?}");
    // A nearest neighbour tells the classes apart in groups of which it learned both.
    let place = |row: usize| 10.0 * 3.0_f64.powi(row as i32 / 20);
    let x = Array2::from_shape_fn((120, 1), |(row, _)| place(row) + (row % 2) as f64);
    let one = serde_json::json!({"k": 1});
    let spec = PipelineSpec::plain(ClassifierSpec::new("knn", one.as_object().unwrap()).unwrap());
    let setting = Setting { x: x.view(), spec: &spec, ..setting };
    for seed in 0..8 {
        let curve = learning_curve(&setting, &[0.1], seed).unwrap().points;
        assert_eq!(curve[0].mean, 80.0 / 120.0, "{curve:?}");
    }
    assert!(learning_curve(&Setting { groups: Some(&[]), ..setting }, &[1.0], 3).is_err());
}

/// In folds of one row, or of one class, nothing was ever important.
#[test]
fn folds_of_one_class_show_what_is_important() {
    let (x, y) = table();
    let spec = forest();
    let fold = |class: usize, odd: usize| {
        let tests = |row: &usize| y[*row] == class && row % 4 / 2 == odd;
        let (test, train) = (0..y.len()).partition(tests);
        Fold { name: format!("{class}{odd}"), train, test }
    };
    let folds = [fold(0, 0), fold(0, 1), fold(1, 0), fold(1, 1)];
    let setting =
        Setting { x: x.view(), y: &y, n_classes: 2, folds: &folds, groups: None, spec: &spec };
    let families = families(&named(&["good[0]", "good[1]", "noise[0]"]));
    let found = permutation_importance(&setting, &families, 3, 7).unwrap();
    assert!(found[0].mean > 0.2 && found[1].mean.abs() < 0.1, "{found:?}");
}

#[test]
fn impossible_requests_are_refused() {
    let (x, y) = table();
    let spec = forest();
    let fold = |test: Vec<usize>| vec![Fold { name: "f".into(), train: (0..60).collect(), test }];
    let (good, empty, beyond) = (fold(vec![100]), fold(vec![]), fold(vec![999]));
    let setting =
        |folds| Setting { x: x.view(), y: &y, n_classes: 2, folds, groups: None, spec: &spec };
    assert!(learning_curve(&setting(&good), &[0.0], 0).is_err());
    assert!(learning_curve(&setting(&good), &[1.5], 0).is_err());
    assert!(learning_curve(&setting(&empty), &[1.0], 0).is_err());
    assert!(permutation_importance(&setting(&beyond), &[], 1, 0).is_err());
    assert!(permutation_importance(&setting(&good), &[], 0, 0).is_err());
    let family = Family { name: "x".into(), columns: vec![3] };
    assert!(permutation_importance(&setting(&good), &[family], 1, 0).is_err());
}
