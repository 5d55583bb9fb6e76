//! What training takes and gives beside labels and probabilities: sample weights, decision values,
//! neighbours, importances, answers about rows that a tree has not seen.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::clouds;
use corsmal_models::classifiers::{Classifier, ClassifierSpec};
use corsmal_models::params::key_values;
use ndarray::{Array1, Array2, ArrayView1, Axis, s};

fn spec(name: &str, parameters: &[&str]) -> ClassifierSpec {
    ClassifierSpec::new(name, &key_values(parameters).unwrap()).unwrap()
}

/// Where the largest value is, the first among equals.
fn largest(values: &[f64]) -> usize {
    (0..values.len()).rev().max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap()
}

/// Those to which rows may count more or less.
const WEIGHTED: [&str; 5] = ["svm", "tree", "rf", "et", "logistic"];

#[test]
fn a_row_of_weight_zero_is_left_out() {
    let (x, y) = clouds(90, 5, 3, 1);
    let weights: Vec<f64> = (0..90).map(|row| if row % 4 == 0 { 0.0 } else { 1.0 }).collect();
    let kept: Vec<usize> = (0..90).filter(|row| row % 4 != 0).collect();
    let kept_y: Vec<usize> = kept.iter().map(|&row| y[row]).collect();
    for name in WEIGHTED {
        let spec = spec(name, &[]);
        let weighted = spec.train_weighted(x.view(), &y, 3, Some(&weights)).unwrap();
        let without = spec.train(x.select(Axis(0), &kept).view(), &kept_y, 3).unwrap();
        let [a, b] = [weighted, without].map(|model| model.predict_proba(x.view()).unwrap());
        assert_eq!(a, b, "{name}");
    }
}

#[test]
fn a_weight_of_two_is_the_row_twice() {
    let (x, y) = clouds(80, 4, 2, 2);
    let twice = |row: &usize| row.is_multiple_of(3);
    let weights: Vec<f64> = (0..80).map(|row| if twice(&row) { 2.0 } else { 1.0 }).collect();
    let rows: Vec<usize> = (0..80).chain((0..80).filter(twice)).collect();
    let repeated_y: Vec<usize> = rows.iter().map(|&row| y[row]).collect();
    let repeated = x.select(Axis(0), &rows);
    let cases = [
        spec("tree", &["max_depth=4"]),
        spec("tree", &["criterion=entropy", "max_depth=3"]),
        spec("et", &["trees=7", "max_depth=4"]),
        spec("svm", &["kernel=linear", "tol=1e-9", "probability=false"]),
        spec("logistic", &[]),
    ];
    for spec in cases {
        let weighted = spec.train_weighted(x.view(), &y, 2, Some(&weights)).unwrap();
        let twice = spec.train(repeated.view(), &repeated_y, 2).unwrap();
        let values = |model: &Classifier| match spec.name() {
            "svm" => model.decision_function(x.view()).unwrap(),
            _ => model.predict_proba(x.view()).unwrap(),
        };
        let differences = (values(&weighted) - values(&twice)).mapv(f64::abs);
        let most = differences.iter().copied().fold(0.0, f64::max);
        assert!(most < 1e-5, "{}: {most}", spec.name());
    }
}

/// Sums of large weights overflowed, so all probabilities were NaN; squares of small ones were zero.
#[test]
fn the_unit_of_weights_does_not_matter_to_trees() {
    let (x, y) = clouds(90, 5, 3, 5);
    let weights: Vec<f64> = (0..90).map(|row| 0.1 + f64::from(row % 7)).collect();
    for spec in [spec("tree", &["max_depth=4"]), spec("et", &["trees=7"]), spec("rf", &["trees=7"])]
    {
        let [plain, large, small] = [0, 1020, -1000].map(|exponent| {
            let scaled: Vec<f64> = weights.iter().map(|w| w * 2f64.powi(exponent)).collect();
            let model = spec.train_weighted(x.view(), &y, 3, Some(&scaled)).unwrap();
            model.predict_proba(x.view()).unwrap()
        });
        assert!(plain == large && plain == small, "{}", spec.name());
    }
}

#[test]
fn weights_that_are_none_are_refused() {
    let (x, y) = clouds(6, 2, 2, 3);
    let refusal = |name: &str, weights: &[f64]| {
        let refused = spec(name, &[]).train_weighted(x.view(), &y, 2, Some(weights));
        refused.unwrap_err().to_string()
    };
    assert!(refusal("rf", &[1.0; 5]).contains("sample weights"));
    let bad = [1.0, 1.0, -0.5, 1.0, 1.0, 1.0];
    assert!(refusal("svm", &bad).ends_with("at least 0, not -0.5"));
    assert!(refusal("svm", &[f64::NAN; 6]).ends_with("at least 0, not NaN"));
    // Only rows of one class count.
    let one: Vec<f64> = y.iter().map(|&class| class as f64).collect();
    assert!(refusal("logistic", &one).contains("at least 2 classes"));
    assert!(refusal("knn", &[1.0; 6]).contains("no sample weights"));
    let linfa = spec("tree", &["solver=linfa"]).train_weighted(x.view(), &y, 2, Some(&[1.0; 6]));
    assert!(linfa.unwrap_err().to_string().contains("solver=own"));
}

#[test]
fn the_largest_decision_value_is_the_label() {
    let (x, y) = clouds(120, 4, 4, 4);
    for name in ["svm", "logistic"] {
        let model = spec(name, &[]).train(x.view(), &y, 4).unwrap();
        let values = model.decision_function(x.view()).unwrap();
        assert_eq!(values.dim(), (120, 4));
        let best = |row: ArrayView1<'_, f64>| largest(row.as_slice().unwrap());
        let labels: Vec<usize> = values.outer_iter().map(best).collect();
        assert_eq!(labels, model.predict(x.view()).unwrap(), "{name}");

        // Class 1 has no rows: never the label, and no largest value.
        let y: Vec<usize> = y.iter().map(|&class| if class < 2 { 0 } else { 2 }).collect();
        let model = spec(name, &[]).train(x.view(), &y, 3).unwrap();
        let values = model.decision_function(x.view()).unwrap();
        assert_eq!(values.dim(), (120, 3));
        let labels: Vec<usize> = values.outer_iter().map(best).collect();
        assert_eq!(labels, model.predict(x.view()).unwrap(), "{name}");
        assert!(labels.iter().all(|&label| label != 1));
    }
    let forest = spec("rf", &["trees=3"]).train(x.view(), &y, 4).unwrap();
    let refusal = forest.decision_function(x.view()).unwrap_err().to_string();
    assert!(refusal.contains("svm and logistic have one"), "{refusal}");
}

#[test]
fn neighbours_are_those_of_a_plain_search() {
    // Two rows that are the same, and enough rows for the search by matrix products.
    let (mut x, y) = clouds(120, 5, 3, 5);
    let row = x.row(7).to_owned();
    x.row_mut(90).assign(&row);
    for metric in ["euclidean", "manhattan", "cosine", "chebyshev"] {
        let model = spec("knn", &["k=1", &format!("metric={metric}")]);
        let model = model.train(x.view(), &y, 3).unwrap();
        let distance = |a: usize, b: usize| {
            let (a, b) = (x.row(a), x.row(b));
            let d = (&a - &b).mapv(f64::abs);
            match metric {
                "euclidean" => d.dot(&d).sqrt(),
                "manhattan" => d.sum(),
                "cosine" => 1.0 - a.dot(&b) / (a.dot(&a) * b.dot(&b)).sqrt(),
                _ => d.iter().copied().fold(0.0, f64::max),
            }
        };
        for (query, others) in [(Some(x.slice(s![..40, ..])), false), (None, true)] {
            let found = model.neighbours(query, 6).unwrap();
            assert_eq!(found.rows.ncols(), 6);
            for (row, near) in found.rows.outer_iter().enumerate() {
                let mut all: Vec<(f64, usize)> = (0..120)
                    .filter(|&other| !(others && other == row))
                    .map(|other| (distance(row, other), other))
                    .collect();
                all.sort_by(|a, b| a.0.total_cmp(&b.0));
                for (rank, &other) in near.iter().enumerate() {
                    let (wanted, is) = (all[rank].0, found.distances[[row, rank]]);
                    assert!((wanted - is).abs() < 1e-6, "{metric} {row} {rank}: {wanted} {is}");
                    assert!((distance(row, other) - is).abs() < 1e-6, "{metric} {row} {rank}");
                    assert!(!others || other != row);
                }
            }
        }
        assert!(model.neighbours(None, 119).is_ok());
        let refusal = model.neighbours(None, 120).unwrap_err().to_string();
        assert!(refusal.contains("1 to 119"), "{refusal}");
        assert!(model.neighbours(Some(x.view()), 0).is_err());
    }
    let tree = spec("tree", &[]).train(x.view(), &y, 3).unwrap();
    assert!(tree.neighbours(None, 1).unwrap_err().to_string().contains("knn has them"));
}

#[test]
fn forests_know_what_they_split_on() {
    let (noise, _) = clouds(200, 6, 1, 6);
    let y: Vec<usize> = noise.column(2).iter().map(|&v| usize::from(v > 0.0)).collect();
    for name in ["tree", "rf", "et"] {
        let train =
            |parameters: &[&str]| spec(name, parameters).train(noise.view(), &y, 2).unwrap();
        for criterion in ["criterion=gini", "criterion=entropy"] {
            let model = train(&[criterion]);
            let importances = model.feature_importances().unwrap();
            assert!((importances.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{name}");
            let best = largest(importances);
            assert!(best == 2 && importances[2] > 0.5, "{name}: {importances:?}");
        }
        let stump = train(&["min_samples_split=1000"]);
        assert_eq!(
            stump.feature_importances().unwrap(),
            [0.0; 6],
            "{name}: no split, no importance"
        );
    }
    let linfa = spec("tree", &["solver=linfa"]).train(noise.view(), &y, 2).unwrap();
    assert!(linfa.feature_importances().is_none());
}

#[test]
fn trees_answer_for_rows_they_have_not_seen() {
    let (x, y) = clouds(150, 4, 3, 7);
    for name in ["rf", "et"] {
        // More trees than fit one word of marks.
        let asked = spec(name, &["trees=70", "bootstrap=true", "oob_score=true"]);
        let fractions = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let model = pool.install(|| asked.train(x.view(), &y, 3)).unwrap();
            model.out_of_bag().unwrap()
        };
        let known = fractions(1);
        assert_eq!(known, fractions(3), "{name}");
        assert!(known.sum_axis(Axis(1)).iter().all(|sum| (sum - 1.0).abs() < 1e-6));
        let seen = spec(name, &["trees=70", "bootstrap=true"]).train(x.view(), &y, 3).unwrap();
        assert!(seen.out_of_bag().is_none());
        let accuracy = |fractions: &Array2<f64>| {
            let right = fractions
                .outer_iter()
                .zip(&y)
                .filter(|(row, class)| largest(&row.to_vec()) == **class);
            right.count() as f64 / y.len() as f64
        };
        // Trained rows are known by heart; rows that were left out are not.
        let by_heart = accuracy(&seen.predict_proba(x.view()).unwrap());
        assert!(by_heart > 0.99 && accuracy(&known) < by_heart, "{name}");
        assert!(accuracy(&known) > 0.5, "{name}");
    }
    let one = spec("rf", &["trees=1", "oob_score=true"]).train(x.view(), &y, 3).unwrap();
    let (answered, seen): (Vec<f64>, Vec<f64>) =
        one.out_of_bag().unwrap().column(0).iter().partition(|value| !value.is_nan());
    assert!(!answered.is_empty() && !seen.is_empty());
    let refused = ClassifierSpec::new("et", &key_values(&["oob_score=true"]).unwrap());
    assert!(refused.unwrap_err().to_string().contains("bootstrap=true"));
}

#[test]
fn logistic_regression_finds_the_same_in_any_unit() {
    let (x, y) = clouds(90, 4, 3, 5);
    let of = |x: &Array2<f64>, settings: &[&str]| {
        let model = spec("logistic", settings).train(x.view(), &y, 3).unwrap();
        model.predict_proba(x.view()).unwrap()
    };
    // A weak penalty, so that units hardly matter to the minimum either.
    let expected = of(&x, &["C=1e16"]);
    let near = |other: &Array2<f64>, settings: &[&str], what: &str| {
        for (found, expected) in of(other, settings).iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-4, "{what}: {found} for {expected}");
        }
    };
    for (unit, shift) in [(1e4, 0.0), (1e-4, 0.0), (1e7, 3e9), (1e-2, 50.0), (1e-6, 0.0)] {
        let mut other = &x * unit + shift;
        other.column_mut(0).mapv_inplace(|v| v / unit);
        near(&other, &["C=1e20"], &format!("{unit}"));
    }
    // Slopes by the weights of small features are small from the start.
    near(&(&x * 1e-9), &["C=1e34"], "small");
    // A constant has no weight, also where it is another later, and sums of it are not exact.
    let (many, of_many) = clouds(1000, 3, 2, 4);
    for constant in [0.1, 440.1, 44100.0, 1e8] {
        let with = |constant: f64| {
            let mut more = Array2::from_elem((many.nrows(), 4), constant);
            more.slice_mut(s![.., ..3]).assign(&many);
            more
        };
        let model = spec("logistic", &["C=1e12"]).train(with(constant).view(), &of_many, 2);
        let model = model.unwrap();
        let found =
            [constant, 1.1 * constant].map(|c| model.predict_proba(with(c).view()).unwrap());
        assert_eq!(found[0], found[1], "{constant}");
    }
    // A wild row matters to nothing but itself.
    let wild = |size: f64| {
        let mut x = many.clone();
        x.row_mut(0).fill(size);
        let model = spec("logistic", &[]).train(x.view(), &of_many, 2).unwrap();
        model.predict_proba(x.slice(s![1.., ..])).unwrap()
    };
    let expected = wild(1e3);
    for size in [1e6, 1e7, 1e8, 1e10] {
        for (found, expected) in wild(size).iter().zip(&expected) {
            assert!((found - expected).abs() < 0.01, "{size}: {found} for {expected}");
        }
    }
    // Tails of many magnitudes: rounding ends the search near the minimum, which is not refused.
    let tails = many.mapv(|v| (5.0 * v).exp());
    let found = |unit: f64, settings: &str| {
        let x = &tails * unit;
        let model = spec("logistic", &[settings]).train(x.view(), &of_many, 2).unwrap();
        model.predict_proba(x.view()).unwrap()
    };
    for (one, other) in found(1.0, "C=1").iter().zip(&found(1e4, "C=1e-8")) {
        assert!((one - other).abs() < 1e-5, "{one} and {other}");
    }
    let heavy = ["class_weight=[1e308,1e308]"];
    let heavy = spec("logistic", &heavy).train(many.view(), &of_many, 2).unwrap();
    let plain = spec("logistic", &["C=1e16"]).train(many.view(), &of_many, 2).unwrap();
    assert_eq!(heavy.predict(many.view()).unwrap(), plain.predict(many.view()).unwrap());
    // More features than rows, as they come.
    let (wide, classes) = clouds(60, 400, 3, 7);
    let wide = &wide * &Array1::from_shape_fn(400, |f| f64::from(f as u32 % 7 + 1).powi(3)) + 90.0;
    for settings in [&["C=1e6"][..], &[]] {
        let model = spec("logistic", settings).train(wide.view(), &classes, 3).unwrap();
        assert_eq!(model.predict(wide.view()).unwrap(), classes);
    }
    // Large features leave no penalty to speak of: rows that can be told apart are.
    let mut apart = x.clone();
    apart.column_mut(1).iter_mut().zip(&y).for_each(|(v, &class)| *v += 9.0 * class as f64);
    for unit in [1.0, 1e7, 1e10, 1e100] {
        let x = &apart * unit;
        let model = spec("logistic", &[]).train(x.view(), &y, 3).unwrap();
        assert_eq!(model.predict(x.view()).unwrap(), y, "{unit}");
    }
}

#[test]
fn logistic_regression_that_finds_no_minimum_is_refused() {
    let (x, y) = clouds(90, 4, 3, 5);
    let refusal = |x: &Array2<f64>, settings: &[&str]| {
        let model = spec("logistic", settings).train(x.view(), &y, 3);
        model.map(|_| ()).unwrap_err().to_string()
    };
    let few = refusal(&x, &["max_iter=2"]);
    assert!(few.contains("no minimum found: the largest slope is"), "{few}");
    assert!(few.contains("after 2 steps, tol is 1e-8; standardise the features"), "{few}");
    assert!(spec("logistic", &["max_iter=2", "tol=1"]).train(x.view(), &y, 3).is_ok());
    let huge = refusal(&(&x * 1e300), &[]);
    assert!(huge.contains("standardise the features first"), "{huge}");
}
