//! Our SVM against linfa-svm's solver, which is an implementation of its own.

#![allow(clippy::unwrap_used, reason = "tests")]

mod common;

use common::clouds;
use corsmal_models::classifiers::ClassifierSpec;
use corsmal_models::params::key_values;
use linfa::Dataset;
use linfa::traits::{Fit, Predict};
use linfa_svm::Svm;
use ndarray::{Array1, s};

#[test]
fn two_classes_are_told_apart_as_by_linfa() {
    let (x, y) = clouds(600, 6, 2, 11);
    let (learned, asked) = (x.slice(s![..300, ..]), x.slice(s![300.., ..]));
    let is_one: Array1<bool> = y[..300].iter().map(|&c| c == 1).collect();
    let data = Dataset::new(learned.to_owned(), is_one);
    for (kernel, c) in [("rbf", 0.5), ("rbf", 20.0), ("linear", 1.0)] {
        let gamma = 0.3;
        let params = Svm::<f64, bool>::params().pos_neg_weights(c, c).eps(1e-3);
        // linfa's width is the reciprocal of gamma.
        let params = match kernel {
            "rbf" => params.gaussian_kernel(1.0 / gamma),
            _ => params.linear_kernel(),
        };
        let theirs: Array1<bool> = params.fit(&data).unwrap().predict(&asked.to_owned());
        let texts = [format!("C={c}"), format!("kernel={kernel}"), format!("gamma={gamma}")];
        let spec = ClassifierSpec::new("svm", &key_values(&texts).unwrap()).unwrap();
        let ours = spec.train(learned, &y[..300], 2).unwrap().predict(asked).unwrap();
        let different = ours.iter().zip(&theirs).filter(|(a, b)| (**a == 1) != **b).count();
        assert!(different <= 2, "{kernel}, C={c}: {different} of 300 labels differ");
        // Both answer: the classes overlap, and neither gives one class to all rows.
        let ones = ours.iter().sum::<usize>();
        assert!((60..240).contains(&ones), "{kernel}, C={c}: {ones}");
    }
}
