//! Classifiers on 684 rows of 136 features in four classes, as the CCM training set has them.

use corsmal_benches::signal;
use corsmal_models::classifiers::ClassifierSpec;
use divan::Bencher;
use ndarray::Array2;

fn main() {
    divan::main();
}

const ROWS: usize = 684;
const FEATURES: usize = 136;
const CLASSES: usize = 4;
const NAMES: [&str; 3] = ["knn", "rf", "et"];

/// Noise around a mean that differs between classes.
fn rows() -> (Array2<f64>, Vec<usize>) {
    let noise = signal(3, 1);
    let class = |row: usize| row % CLASSES;
    let value = |(row, column): (usize, usize)| {
        let shift = if column % CLASSES == class(row) { 0.1 } else { 0.0 };
        f64::from(noise[row * FEATURES + column]) + shift
    };
    (Array2::from_shape_fn((ROWS, FEATURES), value), (0..ROWS).map(class).collect())
}

#[divan::bench(args = NAMES)]
fn train(bencher: Bencher, name: &str) {
    let (x, y) = rows();
    let spec = ClassifierSpec::named(name).unwrap();
    bencher.bench_local(|| spec.train(x.view(), &y, CLASSES).unwrap());
}

#[divan::bench(args = NAMES)]
fn predict(bencher: Bencher, name: &str) {
    let (x, y) = rows();
    let model = ClassifierSpec::named(name).unwrap().train(x.view(), &y, CLASSES).unwrap();
    bencher.bench_local(|| model.predict_proba(x.view()).unwrap());
}
