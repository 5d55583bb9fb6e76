//! linfa's own algorithms after `solver = "linfa"` and `algorithm = "linfa"`.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::clouds;
use corsmal_models::ModelError;
use corsmal_models::classifiers::{Classifier, ClassifierSpec};
use corsmal_models::params::key_values;
use linfa::Dataset;
use linfa::traits::{Fit, Predict};
use ndarray::{Array1, Array2, s};

fn spec(name: &str, texts: &[&str]) -> ClassifierSpec {
    ClassifierSpec::new(name, &key_values(texts).unwrap()).unwrap()
}

fn train(name: &str, texts: &[&str], x: &Array2<f64>, y: &[usize], n: usize) -> Classifier {
    spec(name, texts).train(x.view(), y, n).unwrap()
}

fn differing(a: &[usize], b: &[usize]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

#[test]
fn the_svm_of_linfa_gives_the_labels_of_ours() {
    let (x, y) = clouds(500, 6, 4, 31);
    let (learned, asked) = (x.slice(s![..300, ..]).to_owned(), x.slice(s![300.., ..]));
    for texts in [["C=1", "kernel=rbf", "gamma=scale"], ["C=10", "kernel=linear", "gamma=auto"]] {
        let ours = train("svm", &texts, &learned, &y[..300], 4);
        let theirs = [&texts[..], &["solver=linfa"]].concat();
        let theirs = train("svm", &theirs, &learned, &y[..300], 4);
        let different = differing(&ours.predict(asked).unwrap(), &theirs.predict(asked).unwrap());
        assert!(different <= 3, "{texts:?}: {different} of 200 labels differ");
        let refusal = theirs.predict_proba(asked).unwrap_err();
        assert!(matches!(refusal, ModelError::NoProbability { owner: "svm", .. }), "{refusal}");
    }
}

#[test]
fn the_svm_of_linfa_is_refused_where_its_kernel_matrix_would_not_fit() {
    let (x, y) = clouds(12_000, 1, 2, 32);
    let refusal = spec("svm", &["solver=linfa"]).train(x.view(), &y, 2).unwrap_err().to_string();
    assert!(refusal.contains("12000 rows") && refusal.contains("use solver = own"), "{refusal}");
}

/// A pair of classes is what linfa-svm itself solves.
#[test]
fn one_pair_is_predicted_as_linfa_svm_predicts_it() {
    let (x, y) = clouds(400, 5, 2, 33);
    let (learned, asked) = (x.slice(s![..200, ..]).to_owned(), x.slice(s![200.., ..]).to_owned());
    let positive: Array1<bool> = y[..200].iter().map(|&class| class == 0).collect();
    let direct = linfa_svm::Svm::<f64, bool>::params()
        .pos_neg_weights(2.0, 2.0)
        .eps(1e-3)
        .gaussian_kernel(1.0 / 0.2)
        .fit(&Dataset::new(learned.clone(), positive))
        .unwrap();
    let direct: Array1<bool> = direct.predict(&asked);
    let ours = train("svm", &["C=2", "gamma=0.2", "solver=linfa"], &learned, &y[..200], 2);
    for (class, positive) in ours.predict(asked.view()).unwrap().iter().zip(direct) {
        assert_eq!(*class == 0, positive);
    }
}

#[test]
fn the_tree_of_linfa_is_the_one_that_linfa_trees_walks() {
    let (x, y) = clouds(300, 5, 3, 34);
    let (learned, asked) = (x.slice(s![..200, ..]).to_owned(), x.slice(s![200.., ..]).to_owned());
    for (criterion, quality) in
        [("gini", linfa_trees::SplitQuality::Gini), ("entropy", linfa_trees::SplitQuality::Entropy)]
    {
        let direct = linfa_trees::DecisionTree::params()
            .split_quality(quality)
            .max_depth(Some(6))
            .min_weight_leaf(2.0)
            .fit(&Dataset::new(learned.clone(), Array1::from(y[..200].to_vec())))
            .unwrap();
        let direct: Array1<usize> = direct.predict(&asked);
        let criterion = format!("criterion={criterion}");
        let texts = [criterion.as_str(), "max_depth=6", "min_samples_leaf=2", "solver=linfa"];
        let ours = train("tree", &texts, &learned, &y[..200], 3);
        let different = differing(&ours.predict(asked.view()).unwrap(), direct.as_slice().unwrap());
        // It sums in the order of hash tables: equally good splits, and equally common classes of a
        // leaf, differ from one fit to the next.
        assert!(different <= 4, "{criterion}: {different} of 100 labels differ");
        let refusal = ours.predict_proba(asked.view()).unwrap_err();
        assert!(matches!(refusal, ModelError::NoProbability { owner: "tree", .. }), "{refusal}");
    }
}

#[test]
fn neighbours_of_linfa_vote_as_ours_do() {
    for features in [4, 30] {
        let (x, y) = clouds(300, features, 3, 35);
        for metric in ["euclidean", "manhattan", "chebyshev"] {
            for weights in ["uniform", "distance"] {
                let texts =
                    [format!("metric={metric}"), format!("weights={weights}"), "k=7".into()];
                let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
                let ours = train("knn", &texts, &x, &y, 3);
                let theirs = train("knn", &[&texts[..], &["algorithm=linfa"]].concat(), &x, &y, 3);
                let (a, b) = (ours.predict_proba(x.view()), theirs.predict_proba(x.view()));
                let worst = (a.unwrap() - b.unwrap()).iter().fold(0.0f64, |m, d| m.max(d.abs()));
                assert!(worst < 1e-9, "{metric}, {weights}, {features} features: {worst}");
            }
        }
    }
}

#[test]
fn rows_that_are_all_alike_but_one_are_searched() {
    let mut x = Array2::zeros((5000, 3));
    x[[4999, 0]] = 1.0;
    let y: Vec<usize> = (0..5000).map(|row| row % 2).collect();
    let model = train("knn", &["algorithm=linfa", "k=3"], &x, &y, 2);
    assert_eq!(model.predict_proba(x.slice(s![..20, ..])).unwrap().nrows(), 20);
}

#[test]
fn what_linfa_lacks_is_refused_by_name() {
    let refuse = |name: &str, texts: &[&str]| {
        ClassifierSpec::new(name, &key_values(texts).unwrap()).unwrap_err().to_string()
    };
    assert!(refuse("knn", &["algorithm=linfa", "metric=cosine"]).contains("euclidean, manhattan"));
    assert!(refuse("tree", &["solver=linfa", "class_weight=balanced"]).contains("class_weight"));
    assert!(
        refuse("tree", &["solver=linfa", "max_features=sqrt"])
            .contains("must be all with solver=linfa")
    );
    assert!(refuse("svm", &["solver=fast"]).contains("own or linfa"));
    let (x, y) = clouds(30, 2, 2, 36);
    let huge = spec("knn", &["algorithm=linfa"]).train((&x * 1e145).view(), &y, 2).unwrap_err();
    assert!(huge.to_string().contains("too large for algorithm = linfa"), "{huge}");
}
