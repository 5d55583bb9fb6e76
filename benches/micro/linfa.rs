//! Our solvers beside linfa's: why ours are the defaults. `cargo bench -p corsmal-benches --bench linfa`
//!
//! The tables have the size of real ones: 684 recordings of the benchmark with 136 statistics, and 2,000
//! rows of 193.

use corsmal_models::classifiers::{Classifier, ClassifierSpec};
use corsmal_models::params::key_values;
use divan::{Bencher, black_box};
use ndarray::Array2;

fn main() {
    divan::main();
}

/// Rows x features.
const TABLES: [(usize, usize); 2] = [(684, 136), (2000, 193)];
const CLASSES: usize = 4;

/// Classes whose features overlap, without any generator of random numbers.
fn table((rows, features): (usize, usize)) -> (Array2<f64>, Vec<usize>) {
    let y: Vec<usize> = (0..rows).map(|row| row % CLASSES).collect();
    let x = Array2::from_shape_fn((rows, features), |(row, f)| {
        let noise = ((row * 7919 + f * 104_729 + row * f * 31) % 1009) as f64 / 1009.0;
        noise + 0.3 * ((y[row] * (f + 1)) % 5) as f64
    });
    (x, y)
}

fn train(name: &str, texts: &[&str], size: (usize, usize)) -> Classifier {
    let (x, y) = table(size);
    let parameters = key_values(texts).expect("parameters as written here");
    let spec = ClassifierSpec::new(name, &parameters).expect("a known classifier");
    spec.train(x.view(), &y, CLASSES).expect("a table that can be learned")
}

#[divan::bench(args = TABLES, sample_count = 5)]
fn svm_fit_own(bencher: Bencher, size: (usize, usize)) {
    bencher.bench(|| black_box(train("svm", &["probability=false"], size)));
}

#[divan::bench(args = TABLES, sample_count = 5)]
fn svm_fit_linfa(bencher: Bencher, size: (usize, usize)) {
    bencher.bench(|| black_box(train("svm", &["solver=linfa"], size)));
}

#[divan::bench(args = TABLES, sample_count = 5)]
fn tree_fit_own(bencher: Bencher, size: (usize, usize)) {
    bencher.bench(|| black_box(train("tree", &[], size)));
}

#[divan::bench(args = TABLES, sample_count = 5)]
fn tree_fit_linfa(bencher: Bencher, size: (usize, usize)) {
    bencher.bench(|| black_box(train("tree", &["solver=linfa"], size)));
}

#[divan::bench(args = TABLES, sample_count = 5)]
fn knn_predict_own(bencher: Bencher, size: (usize, usize)) {
    let (model, (x, _)) = (train("knn", &[], size), table(size));
    bencher.bench_local(|| black_box(model.predict(x.view())));
}

#[divan::bench(args = TABLES, sample_count = 5)]
fn knn_predict_linfa(bencher: Bencher, size: (usize, usize)) {
    let (model, (x, _)) = (train("knn", &["algorithm=linfa"], size), table(size));
    bencher.bench_local(|| black_box(model.predict(x.view())));
}
