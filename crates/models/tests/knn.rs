//! The screen in single precision changes nothing: rows asked for together (screened) get what each
//! gets alone (compared with every training row).

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::clouds;
use corsmal_models::classifiers::{ClassifierSpec, KNearestParams, Metric, Weights};
use ndarray::{Array2, Axis};

fn same_together_and_alone(x: &Array2<f64>, y: &[usize], what: &str) {
    for metric in [Metric::Euclidean, Metric::Cosine] {
        for k in [1, 5, 20] {
            let weights = if k == 5 { Weights::Uniform } else { Weights::Distance };
            let spec =
                ClassifierSpec::from(KNearestParams { k, metric, weights, ..Default::default() });
            let model = spec.train(x.view(), y, 3).unwrap();
            let together = model.predict_proba(x.view()).unwrap();
            for (row, expected) in x.axis_chunks_iter(Axis(0), 1).zip(together.outer_iter()) {
                let alone = model.predict_proba(row).unwrap();
                assert_eq!(alone.row(0), expected, "{what}, {metric:?}, k = {k}");
            }
        }
    }
}

#[test]
fn rows_of_different_lengths() {
    let (x, y) = clouds(700, 30, 3, 1);
    same_together_and_alone(&x, &y, "clouds");
    same_together_and_alone(&(&x + 1e6), &y, "far from zero");
}

#[test]
fn rows_at_equal_distances_and_doubled_rows() {
    let (x, y) = clouds(600, 3, 3, 2);
    same_together_and_alone(&x.mapv(f64::round), &y, "grid");
    let mut alike = Array2::zeros((600, 4));
    alike[[599, 0]] = 1.0;
    same_together_and_alone(&alike, &y, "all but one alike");
}

#[test]
fn values_beyond_single_precision() {
    let (mut x, y) = clouds(600, 6, 3, 3);
    same_together_and_alone(&(&x * 1e30), &y, "large");
    same_together_and_alone(&(&x * 1e-30), &y, "small");
    x.row_mut(7).fill(1e60);
    x.row_mut(8).fill(-1e150);
    same_together_and_alone(&x, &y, "two outliers");
}

/// `p=1` without `metric=minkowski`, scikit-learn's default, had no effect in silence.
#[test]
fn an_exponent_without_the_metric_that_has_one_is_refused() {
    let (x, y) = clouds(30, 4, 3, 4);
    let train = |metric, p| {
        ClassifierSpec::from(KNearestParams { metric, p, ..Default::default() })
            .train(x.view(), &y, 3)
            .map_err(|e| e.to_string())
    };
    let refused = train(Metric::Euclidean, 1.0).unwrap_err();
    assert!(refused.contains("knn: p must be left out with metric=euclidean"), "{refused}");
    assert!(refused.ends_with("(metric=minkowski has one), not 1"), "{refused}");
    for (metric, p) in [(Metric::Cosine, 3.0), (Metric::Chebyshev, 1.0), (Metric::Manhattan, 3.0)] {
        assert!(train(metric, p).is_err(), "{metric:?}");
    }
    for (metric, p) in [(Metric::Minkowski, 1.0), (Metric::Manhattan, 1.0), (Metric::Cosine, 2.0)] {
        assert!(train(metric, p).is_ok(), "{metric:?}");
    }
}

#[test]
fn rows_that_are_shared_give_what_copies_give() {
    let (x, y) = clouds(300, 20, 3, 4);
    let across = x.t().as_standard_layout().into_owned().reversed_axes();
    for metric in [Metric::Euclidean, Metric::Cosine, Metric::Manhattan] {
        let spec = ClassifierSpec::from(KNearestParams { metric, ..Default::default() });
        let copied = spec.train(x.view(), &y, 3).unwrap();
        let expected = copied.predict_proba(x.view()).unwrap();
        for rows in [x.to_shared(), across.to_shared()] {
            let mut rows = rows;
            let shared = spec.train_shared(&rows, &y, 3).unwrap();
            // Who goes on to change the rows changes a copy.
            rows.fill(0.0);
            assert_eq!(shared.predict_proba(x.view()).unwrap(), expected, "{metric:?}");
        }
    }
}
