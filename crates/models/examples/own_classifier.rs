//! A classifier of your own: registered, trained in a pipeline, kept in a model file, loaded again.
//!
//! `cargo run -p corsmal-models --example own_classifier`

use corsmal_models::classifiers::{ClassifierSpec, Classify, Train, register};
use corsmal_models::labels::Labels;
use corsmal_models::model_file::{Model, ModelHeader};
use corsmal_models::params::{key_values, parameters};
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::{ModelError, Result};
use ndarray::{Array2, ArrayView2, Axis, array};
use serde::{Deserialize, Serialize};

parameters! {
    /// Parameters of the nearest mean: a row belongs to the class whose mean it is nearest to.
    NearestMeanParams, "nearest-mean" {
        sharpness: f64 = 1.0, "a positive number", "how fast probabilities fall with distance";
    }
    check(this) {
        Self::require(this.sharpness > 0.0 && this.sharpness.is_finite(), "sharpness", this.sharpness)
    }
}

/// The mean of each class.
#[derive(Debug, Serialize, Deserialize)]
pub struct NearestMean {
    sharpness: f64,
    /// `[classes, features]`
    means: Array2<f64>,
}

impl Train for NearestMeanParams {
    type Fitted = NearestMean;
    const FEWEST_CLASSES: usize = 1;

    fn train(&self, x: ArrayView2<'_, f64>, y: &[usize], n_classes: usize) -> Result<NearestMean> {
        let mut means = Array2::zeros((n_classes, x.ncols()));
        let mut rows = vec![0.0; n_classes];
        for (row, &class) in x.outer_iter().zip(y) {
            let mut mean = means.row_mut(class);
            mean += &row;
            rows[class] += 1.0;
        }
        means.outer_iter_mut().zip(rows).for_each(|(mut mean, rows)| mean /= rows);
        Ok(NearestMean { sharpness: self.sharpness, means })
    }
}

impl Classify for NearestMean {
    fn n_features(&self) -> usize {
        self.means.ncols()
    }

    fn n_classes(&self) -> usize {
        self.means.nrows()
    }

    fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        let mut proba = Array2::zeros((x.nrows(), self.n_classes()));
        for (mut to, row) in proba.outer_iter_mut().zip(x.outer_iter()) {
            let distance = |mean| (&row - &mean).mapv(|d: f64| d * d).sum();
            let distances: Vec<f64> = self.means.axis_iter(Axis(0)).map(distance).collect();
            let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
            let weight = |d: &f64| (-self.sharpness * (d - nearest)).exp();
            to.iter_mut().zip(&distances).for_each(|(p, d)| *p = weight(d));
            let sum = to.sum();
            to /= sum;
        }
        Ok(proba)
    }

    fn validate(&self) -> Result<()> {
        let sound = self.sharpness > 0.0 && self.means.iter().all(|v| v.is_finite());
        if sound { Ok(()) } else { Err(ModelError::Inconsistent("means".into())) }
    }
}

/// Registers, trains, stores and asks.
///
/// # Errors
/// None is expected.
pub fn main() -> std::result::Result<(), Box<dyn std::error::Error>> {
    register::<NearestMeanParams>("nearest class mean")?;

    let x = array![[0.0, 0.1], [0.2, 0.0], [3.0, 3.1], [2.9, 3.0]];
    let y = [0, 0, 1, 1];
    let classifier = ClassifierSpec::new("nearest-mean", &key_values(&["sharpness=2"])?)?;
    let pipeline = PipelineSpec::standardized(classifier);
    let fitted = pipeline.train(x.view(), &y, 2)?;

    let header = ModelHeader::new(pipeline, Labels::new(vec!["rice".into(), "water".into()])?);
    let bytes = Model::new(header, fitted)?.to_bytes()?;
    let model = Model::from_bytes(&bytes)?;
    let classes = model.predict(array![[2.5, 2.5]].view())?;
    println!("{}", model.header().labels.names()[classes[0]]);
    assert_eq!(classes, [1]);
    Ok(())
}
