//! What holds for every classifier in the table.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::clouds;
use corsmal_models::ModelError;
use corsmal_models::classifiers::{
    CLASSIFIERS, ClassifierSpec, KNearestParams, Predicted, SvmKernel, SvmParams, Weights,
};
use corsmal_models::params::key_values;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::targets::Classes;
use linfa::traits::{Fit, Predict};
use linfa::{Dataset, DatasetBase};
use ndarray::{Array1, Axis, s};

fn all() -> impl Iterator<Item = ClassifierSpec> {
    CLASSIFIERS.iter().map(|(name, _)| ClassifierSpec::named(name).unwrap())
}

#[test]
fn learns_clouds_and_gives_probabilities() {
    let (x, y) = clouds(300, 8, 3, 1);
    for spec in all() {
        let model = spec.train(x.slice(s![..200, ..]), &y[..200], 3).unwrap();
        let test = x.slice(s![200.., ..]);
        let labels = model.predict(test).unwrap();
        let right = labels.iter().zip(&y[200..]).filter(|(a, b)| a == b).count();
        assert!(right > 70, "{}: {right} of 100", spec.name());
        let proba = model.predict_proba(test).unwrap();
        assert_eq!(proba.dim(), (100, 3));
        assert!(proba.iter().all(|p| (0.0..=1.0).contains(p)), "{}", spec.name());
        for sum in proba.sum_axis(Axis(1)) {
            assert!((sum - 1.0).abs() < 1e-9, "{}: {sum}", spec.name());
        }
    }
}

#[test]
fn same_result_for_any_number_of_threads() {
    let (x, y) = clouds(240, 12, 4, 2);
    let run = |spec: &ClassifierSpec, threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let model = spec.train(x.view(), &y, 4).unwrap();
            model.predict_proba(x.view()).unwrap()
        })
    };
    for spec in all() {
        assert_eq!(run(&spec, 1), run(&spec, 3), "{}", spec.name());
    }
}

#[test]
fn a_row_gets_the_same_alone_and_among_others() {
    let (x, y) = clouds(83, 7, 3, 8);
    for spec in all() {
        let model = spec.train(x.view(), &y, 3).unwrap();
        let together = model.predict_proba(x.view()).unwrap();
        for (row, expected) in x.axis_chunks_iter(Axis(0), 1).zip(together.outer_iter()) {
            let alone = model.predict_proba(row).unwrap();
            for (a, b) in alone.row(0).iter().zip(expected) {
                assert!((a - b).abs() < 1e-12, "{}: {a} and {b}", spec.name());
            }
        }
    }
}

#[test]
fn classes_without_rows_get_probability_zero() {
    let (x, mut y) = clouds(120, 5, 2, 3);
    y.iter_mut().for_each(|c| *c = 1 + 2 * *c);
    for spec in all() {
        let model = spec.train(x.view(), &y, 5).unwrap();
        assert!(model.predict(x.view()).unwrap().iter().all(|c| [1, 3].contains(c)));
        let proba = model.predict_proba(x.view()).unwrap();
        for absent in [0, 2, 4] {
            assert!(proba.column(absent).iter().all(|&p| p == 0.0), "{}", spec.name());
        }
    }
}

#[test]
fn bad_input_is_refused_with_its_place() {
    let (mut x, y) = clouds(60, 4, 3, 4);
    for spec in all() {
        let model = spec.train(x.view(), &y, 3).unwrap();
        let narrow = model.predict(x.slice(s![.., ..3])).unwrap_err();
        assert!(matches!(narrow, ModelError::Length { expected: 4, actual: 3, .. }), "{narrow}");
        let few = spec.train(x.view(), &y[..59], 3).unwrap_err();
        assert!(matches!(few, ModelError::Length { expected: 60, actual: 59, .. }), "{few}");
        let outside = spec.train(x.view(), &y, 2).unwrap_err();
        assert!(
            matches!(outside, ModelError::ClassOutOfRange { row: 2, class: 2, .. }),
            "{outside}"
        );
        let empty = spec.train(x.slice(s![..0, ..]), &[], 3).unwrap_err();
        assert!(matches!(empty, ModelError::Empty { rows: 0, features: 4 }), "{empty}");
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let good = std::mem::replace(&mut x[[7, 2]], bad);
            for error in [
                spec.train(x.view(), &y, 3).unwrap_err(),
                model.predict(x.view()).unwrap_err(),
                model.predict_proba(x.view()).unwrap_err(),
            ] {
                assert!(
                    matches!(error, ModelError::NonFinite { row: 7, feature: 2, .. }),
                    "{}: {error}",
                    spec.name()
                );
            }
            x[[7, 2]] = good;
        }
    }
}

#[test]
fn huge_values_are_an_error_or_a_finite_answer() {
    let (x, y) = clouds(60, 4, 3, 5);
    // 1e20: products overflow in single precision only.
    for factor in [1e20, 1e30, 1e150, 1e300] {
        let x = &x * factor;
        for spec in all() {
            let Ok(model) = spec.train(x.view(), &y, 3) else { continue };
            for queries in [x.clone(), -&x] {
                if let Ok(proba) = model.predict_proba(queries.view()) {
                    assert!(proba.iter().all(|p| p.is_finite()), "{} x{factor}", spec.name());
                }
            }
        }
    }
}

/// Of lengths and products of rows no digits were left: kNN missed its own rows, the linear SVM was at chance.
#[test]
fn features_far_from_zero_are_told_apart() {
    let (x, y) = clouds(200, 6, 3, 9);
    // Multiples of 1/1024, to which numbers are added exactly.
    let x = x.mapv(|v| (v * 1024.0).round() / 1024.0);
    let linear = SvmParams { kernel: SvmKernel::Linear, ..Default::default() };
    let nearest = KNearestParams { weights: Weights::Distance, ..Default::default() };
    for spec in all().chain([linear.into(), nearest.into()]) {
        // Trees compare in single precision.
        let is_tree = ["tree", "rf", "et"].contains(&spec.name());
        let [near, far] = [0.0, if is_tree { 1024.0 } else { 2f64.powi(30) }].map(|offset| {
            let x = &x + offset;
            spec.train(x.view(), &y, 3).unwrap().predict_proba(x.view()).unwrap()
        });
        let most = (near - far).iter().fold(0.0, |most: f64, d| most.max(d.abs()));
        // A solver stops anywhere within its tolerance.
        let allowed = if spec.name() == "svm" { 1e-3 } else { 1e-6 };
        assert!(most < allowed, "{spec:?}: {most}");
    }
}

#[test]
fn one_class_is_refused_where_a_boundary_is_needed() {
    let (x, _) = clouds(20, 3, 2, 6);
    for name in ["svm", "logistic"] {
        let error = ClassifierSpec::named(name).unwrap().train(x.view(), &[0; 20], 2).unwrap_err();
        assert!(matches!(error, ModelError::TooFewClasses { classes: 1, rows: 20, .. }), "{error}");
    }
}

#[test]
fn constant_features_do_no_harm() {
    let (mut x, y) = clouds(90, 4, 3, 7);
    x.column_mut(1).fill(3.5);
    for spec in all() {
        let model = spec.train(x.view(), &y, 3).unwrap();
        assert_eq!(model.predict(x.view()).unwrap().len(), 90);
        x.fill(1.0);
        let model = spec.train(x.view(), &y, 3);
        assert!(model.is_err() || model.unwrap().predict(x.view()).is_ok(), "{}", spec.name());
        x = clouds(90, 4, 3, 7).0;
    }
}

/// Rows that are all the same cannot be told apart, one row alone is not such a table.
#[test]
fn tables_without_any_variation_are_refused() {
    for spec in all() {
        let x = ndarray::Array2::from_elem((6, 3), 0.5);
        let error = spec.train(x.view(), &[0, 1, 0, 1, 0, 1], 2).unwrap_err().to_string();
        assert!(error.contains("same value in all 6 rows (so do 3 of 3"), "{error}");
    }
    for name in ["rf", "et"] {
        let table = corsmal_models::params::key_values(&["trees=1000000000000"]).unwrap();
        let error = ClassifierSpec::new(name, &table).unwrap_err().to_string();
        assert!(error.contains("1 to 100000"), "{error}");
    }
}

#[test]
fn linfa_users_are_at_home() {
    let (x, y) = clouds(90, 4, 3, 8);
    let dataset = Dataset::new(x.clone(), Array1::from(y.clone()));
    for spec in all() {
        let model = spec.fit(&dataset).unwrap();
        let predicted: Result<Predicted, ModelError> = Predict::predict(&model, &dataset);
        let expected = spec.train(x.view(), &y, 3).unwrap();
        assert_eq!(predicted.unwrap().classes, expected.predict(x.view()).unwrap());
        let narrow = x.slice(s![.., ..3]).to_owned();
        let refused: Result<Predicted, ModelError> = Predict::predict(&model, &narrow);
        assert!(matches!(refused, Err(ModelError::Length { expected: 4, actual: 3, .. })));
    }
}

#[test]
fn pipelines_fit_data_sets_whose_classes_may_lack_rows() {
    let (x, y) = clouds(60, 4, 2, 8);
    let dataset = DatasetBase::new(x.view(), Classes::new(y.clone(), 3).unwrap());
    let spec = PipelineSpec::standardized(ClassifierSpec::named("rf").unwrap());
    let fitted = spec.fit(&dataset).unwrap();
    assert_eq!(fitted.n_classes(), 3);
    let predicted: Result<Predicted, ModelError> = Predict::predict(&fitted, &dataset);
    let proba = predicted.unwrap().proba.unwrap();
    assert!(proba.column(2).iter().all(|p| *p == 0.0));
    assert!(Classes::new(y, 1).is_err());
}

#[test]
fn names_of_scikit_learn_are_understood() {
    let spec = |name: &str, texts: &[&str]| ClassifierSpec::new(name, &key_values(texts).unwrap());
    let forest = spec("rf", &["n_estimators=7", "random_state=3"]).unwrap();
    assert_eq!(
        (&forest.parameters()["trees"], &forest.parameters()["seed"]),
        (&7.into(), &3.into())
    );
    assert_eq!(spec("knn", &["n_neighbors=2"]).unwrap().parameters()["k"], 2);
    assert_eq!(forest.key("n_estimators"), "trees");
    let twice = spec("rf", &["trees=3", "n_estimators=4"]).unwrap_err().to_string();
    assert!(twice.contains("trees is given twice"), "{twice}");
    assert!(spec("knn", &["n_estimators=4"]).is_err(), "kNN has no trees");
}

#[test]
fn parameters_are_checked_by_name() {
    let refuse = |name: &str, texts: &[&str]| {
        let object = key_values(texts).unwrap();
        ClassifierSpec::new(name, &object).unwrap_err().to_string()
    };
    assert_eq!(
        refuse("knn", &["neighbours=3"]),
        "knn has no parameter neighbours: it has k, weights, metric, p, algorithm"
    );
    assert_eq!(
        refuse("knn", &["k=0"]),
        "knn: k must be a whole number from 1 to the number of training rows, not 0"
    );
    assert_eq!(
        refuse("svm", &["C=1", "gamma=wide"]),
        "svm: gamma must be scale, auto or a positive number, not \"wide\""
    );
    assert!(refuse("rf", &["max_features=0.0"]).contains("max_features"));
    assert!(refuse("forest", &[]).contains("knn, svm, tree, rf, et, logistic"));
    assert!(key_values(&["k"]).is_err());
    let twice = key_values(&["C=1", "gamma=2", " C = 100"]).unwrap_err().to_string();
    assert_eq!(twice, "C is given twice, as 1 and as 100: keep one of them");
    let spec = ClassifierSpec::new(
        "svm",
        &key_values(&["C=20", "gamma=1e-5", "kernel=linear", "class_weight=1,2,3"]).unwrap(),
    );
    let parameters = spec.unwrap().parameters();
    assert_eq!(parameters["class_weight"], serde_json::json!([1.0, 2.0, 3.0]));
    assert_eq!(parameters["C"], 20.0);
}

#[test]
fn too_many_neighbours_are_refused() {
    let (x, y) = clouds(6, 2, 2, 9);
    let spec = ClassifierSpec::new("knn", &key_values(&["k=7"]).unwrap()).unwrap();
    assert!(spec.train(x.view(), &y, 2).unwrap_err().to_string().contains("training rows (6)"));
}

#[test]
fn class_weights_pull_towards_their_class() {
    let (x, y) = clouds(300, 2, 2, 10);
    for name in ["svm", "logistic", "rf", "tree", "et"] {
        let count = |weights: &str| {
            let mut texts = vec![format!("class_weight={weights}")];
            if name == "svm" {
                texts.push("C=0.01".into());
            }
            if ["rf", "tree", "et"].contains(&name) {
                texts.push("max_depth=2".into());
            }
            let spec = ClassifierSpec::new(name, &key_values(&texts).unwrap()).unwrap();
            let model = spec.train(x.view(), &y, 2).unwrap();
            model.predict(x.view()).unwrap().iter().filter(|&&c| c == 1).count()
        };
        assert!(count("1,20") > count("20,1"), "{name}");
        let wrong = key_values(&["class_weight=1,2,3"]).unwrap();
        assert!(ClassifierSpec::new(name, &wrong).unwrap().train(x.view(), &y, 2).is_err());
    }
}
