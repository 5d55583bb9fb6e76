//! Cross-validation, choice of parameters, scores and steps.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::clouds;
use corsmal_models::ModelError;
use corsmal_models::classifiers::ClassifierSpec;
use corsmal_models::cross_validation::{Data, cross_validate, nested_cross_validate};
use corsmal_models::grid::combinations;
use corsmal_models::params::key_values;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::scores::Scores;
use corsmal_models::splits::{Fold, stratified_k_fold};
use corsmal_models::steps::StepSpec;
use corsmal_models::targets::Classes;
use linfa::DatasetBase;
use ndarray::{Array2, ArrayView2, array};
use serde_json::json;

fn labelled<'a>(
    x: &'a Array2<f64>,
    y: &[usize],
    n_classes: usize,
) -> DatasetBase<ArrayView2<'a, f64>, Classes> {
    DatasetBase::new(x.view(), Classes::new(y.to_vec(), n_classes).unwrap())
}

// scikit-learn 1.9.1
const TALL: &[[f64; 2]] = &[
    [2.26600645, -1.94085223],
    [2.051518729, 0.535345461],
    [-2.670824737, -2.303478799],
    [-2.972482834, 1.807655665],
    [1.325782393, 1.901329902],
];
const WIDE: &[[f64; 2]] =
    &[[-1.303594734, -1.81676657], [-2.149627195, 1.54243409], [3.453221929, 0.274332479]];
const WEIGHTED: f64 = 0.6666666666666666;
const MACRO: f64 = 0.6388888888888888;

#[test]
fn scores_are_those_of_scikit_learn() {
    let truth = [0, 0, 0, 1, 1, 2, 2, 2, 2];
    let predicted = [0, 0, 1, 1, 2, 2, 2, 0, 2];
    let scores = Scores::new(&truth, &predicted, 3).unwrap();
    assert!((scores.weighted_f1 - WEIGHTED).abs() < 1e-12, "{}", scores.weighted_f1);
    assert!((scores.macro_f1 - MACRO).abs() < 1e-12);
    assert!((scores.accuracy - 6.0 / 9.0).abs() < 1e-12);
    assert_eq!(scores.confusion, [[2, 1, 0], [0, 1, 1], [1, 0, 3]]);
    // A class that never occurs does not count.
    let wider = Scores::new(&truth, &predicted, 5).unwrap();
    assert_eq!((wider.macro_f1, wider.weighted_f1), (scores.macro_f1, scores.weighted_f1));
    assert!(Scores::new(&truth, &predicted[1..], 3).is_err());
}

#[test]
fn components_have_scikit_learns_signs() {
    let x = array![
        [1., 2., 0., 5.],
        [2., 1., 3., 4.],
        [0., 5., 1., 1.],
        [4., 4., 2., 0.],
        [3., 0., 1., 2.]
    ];
    let spec = StepSpec::new("pca", &key_values(&["n_components=2"]).unwrap()).unwrap();
    // scikit-learn 1.9.1: scores of PCA(2), five rows of four features, then three (wide)
    for (rows, expected) in [(5, TALL), (3, WIDE)] {
        let x = x.slice(ndarray::s![..rows, ..]);
        let scores = spec.fit(x).unwrap().transform(x).unwrap();
        for (row, values) in expected.iter().enumerate() {
            for (c, value) in values.iter().enumerate() {
                assert!((scores[[row, c]] - value).abs() < 1e-6, "{rows} rows: {scores}");
            }
        }
    }
    let too_many = StepSpec::new("pca", &key_values(&["n_components=9"]).unwrap()).unwrap();
    assert!(too_many.fit(x.view()).unwrap_err().to_string().contains("at most 4"));
    let flat = ndarray::Array2::from_elem((4, 3), 2.0);
    for name in ["pca", "standardize"] {
        let error =
            StepSpec::new(name, &key_values::<&str>(&[]).unwrap()).unwrap().fit(flat.view());
        assert!(matches!(error.unwrap_err(), ModelError::ConstantFeature { count: 3, .. }));
    }
}

#[test]
fn held_out_rows_are_predicted_once_by_a_pipeline_that_has_not_seen_them() {
    let (x, y) = clouds(90, 5, 3, 21);
    let folds = stratified_k_fold(&y, 3, Some(0)).unwrap();
    let spec = PipelineSpec::standardized(ClassifierSpec::named("knn").unwrap());
    let rows = labelled(&x, &y, 3);
    let data = Data { dataset: &rows, merge: None };
    let cv = cross_validate(&data, &folds, &spec).unwrap();
    let mut rows: Vec<usize> = cv.folds.iter().flat_map(|f| f.rows.clone()).collect();
    rows.sort_unstable();
    assert!(rows.into_iter().eq(0..90));
    assert!(cv.pooled.accuracy > 0.7 && cv.accuracy.low <= cv.accuracy.mean);
    // One nearest neighbour of itself would be always right: leakage would show.
    let one = ClassifierSpec::new("knn", &key_values(&["k=1"]).unwrap()).unwrap();
    let random: Vec<usize> = (0..90).map(|i| (i * i + i / 7) % 3).collect();
    let rows = labelled(&x, &random, 3);
    let data = Data { dataset: &rows, merge: None };
    let cv = cross_validate(&data, &folds, &PipelineSpec::plain(one)).unwrap();
    assert!(cv.pooled.accuracy < 0.6, "{}", cv.pooled.accuracy);
}

#[test]
fn merged_classes_are_scored() {
    let (x, y) = clouds(120, 5, 4, 22);
    let folds = stratified_k_fold(&y, 3, None).unwrap();
    let spec = PipelineSpec::plain(ClassifierSpec::named("logistic").unwrap());
    let rows = labelled(&x, &y, 4);
    let data = Data { dataset: &rows, merge: Some(&[0, 1, 0, 1]) };
    let cv = cross_validate(&data, &folds, &spec).unwrap();
    assert_eq!(cv.pooled.classes.len(), 2);
    assert_eq!(cv.folds[0].proba.as_ref().unwrap().ncols(), 2);
    let wrong = Data { merge: Some(&[0, 1]), ..data };
    assert!(cross_validate(&wrong, &folds, &spec).is_err());
}

#[test]
fn the_better_pipeline_is_chosen_inside() {
    let (x, y) = clouds(150, 5, 3, 23);
    let folds = stratified_k_fold(&y, 3, Some(1)).unwrap();
    let base = ClassifierSpec::named("knn").unwrap();
    let grid = [("k".to_string(), vec![json!(95), json!(5)])];
    let specs = combinations(&base, &grid).unwrap();
    let candidates: Vec<_> = specs.into_iter().map(PipelineSpec::plain).collect();
    let rows = labelled(&x, &y, 3);
    let data = Data { dataset: &rows, merge: None };
    let inner = |rows: &[usize]| {
        let y: Vec<usize> = rows.iter().map(|&r| y[r]).collect();
        stratified_k_fold(&y, 2, Some(2))
    };
    // k = 95 exceeds the 50 rows of an inner fold: refused, not silently left out.
    assert!(nested_cross_validate(&data, &folds, &candidates, inner).is_err());
    let specs = combinations(&base, &[("k".to_string(), vec![json!(49), json!(5)])]).unwrap();
    let candidates: Vec<_> = specs.into_iter().map(PipelineSpec::plain).collect();
    let cv = nested_cross_validate(&data, &folds, &candidates, inner).unwrap();
    assert!(cv.folds.iter().all(|f| f.chosen == 1 && f.inner[1] > f.inner[0]), "{:?}", cv.folds);
    assert!(nested_cross_validate(&data, &folds, &[], inner).is_err());
}

#[test]
fn grids_multiply_and_refuse() {
    let base = ClassifierSpec::named("svm").unwrap();
    let grid = [
        ("C".to_string(), vec![json!(1), json!(10)]),
        ("gamma".to_string(), vec![json!("scale"), json!(0.1), json!(0.01)]),
    ];
    let specs = combinations(&base, &grid).unwrap();
    assert_eq!(specs.len(), 6);
    assert_eq!(specs[1].parameters()["gamma"], 0.1);
    let repeated = [("C".into(), vec![json!(1), json!(10), json!(1.0)])];
    assert_eq!(combinations(&base, &repeated).unwrap(), combinations(&base, &grid[..1]).unwrap());
    assert!(combinations(&base, &[("C".into(), vec![])]).is_err());
    assert!(combinations(&base, &[("C".into(), vec![json!(-1)])]).is_err());
    assert!(combinations(&base, &[("tol".into(), vec![json!(1e-3); 10_001])]).is_err());
}

#[test]
fn overlapping_or_empty_folds_are_refused() {
    let (x, y) = clouds(12, 2, 2, 24);
    let rows = labelled(&x, &y, 2);
    let data = Data { dataset: &rows, merge: None };
    let spec =
        PipelineSpec::plain(ClassifierSpec::new("knn", &key_values(&["k=1"]).unwrap()).unwrap());
    let fold = |train: &[usize], test: &[usize]| Fold {
        name: "a".into(),
        train: train.to_vec(),
        test: test.to_vec(),
    };
    for folds in [
        vec![fold(&[0, 1], &[1, 2])],
        vec![fold(&[0, 1], &[])],
        vec![fold(&[], &[1])],
        vec![fold(&[0, 1], &[12])],
        vec![fold(&[0, 1], &[2]), fold(&[0, 1], &[2])],
    ] {
        assert!(matches!(cross_validate(&data, &folds, &spec), Err(ModelError::Folds { .. })));
    }
}
