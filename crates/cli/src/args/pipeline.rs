//! Which classifier is trained, with which steps before it.

use corsmal_models::params::key_values;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::request::PipelineRequest;
use serde_json::{Map, Value};

use crate::failure::Failure;

/// Steps and classifier.
#[derive(clap::Args)]
pub struct PipelineArgs {
    /// Classifier: knn, svm, tree, rf, et or logistic; `corsmal-feat classifiers` explains them.
    #[arg(long, value_name = "NAME", default_value = "rf")]
    classifier: String,
    /// A parameter of the classifier, such as trees=500 or C=10. scikit-learn's names work, too.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    parameters: Vec<String>,
    /// Scale every feature to zero mean and unit variance on the training rows.
    #[arg(long)]
    standardize: bool,
    /// Principal components to keep: how many, or a share of the variance below 1.0.
    #[arg(long, value_name = "N")]
    pca: Option<String>,
    /// Try these values, such as C=0.1,1,10; repeat the option to try every combination. The choice
    /// is made on folds inside the training rows.
    #[arg(long, value_name = "KEY=V1,V2")]
    tune: Vec<String>,
    /// Seed of the classifier or network and of shuffled folds; by default 0, or that of the network's
    /// recipe.
    #[arg(long, value_name = "N")]
    seed: Option<u32>,
}

impl PipelineArgs {
    /// The seed.
    pub fn seed(&self) -> u32 {
        self.seed.unwrap_or(0)
    }

    /// What --set and --seed say of a network's recipe, key by key.
    #[cfg_attr(not(feature = "nets"), expect(dead_code, reason = "for networks"))]
    pub fn changes(&self) -> Result<Map<String, Value>, Failure> {
        let mut changes = key_values(&self.parameters)?;
        if let Some(seed) = self.seed
            && changes.insert("seed".into(), seed.into()).is_some()
        {
            return Err(Failure::new("--seed and --set seed=… set the same value: give one"));
        }
        Ok(changes)
    }

    /// The pipelines to choose from: one, unless something is tuned.
    pub fn candidates(&self) -> Result<Vec<PipelineSpec>, Failure> {
        self.candidates_with(self.seed())
    }

    /// The same with another seed.
    pub fn candidates_with(&self, seed: u32) -> Result<Vec<PipelineSpec>, Failure> {
        let recipe = PipelineRequest {
            classifier: self.classifier.clone(),
            parameters: self.parameters.clone(),
            standardize: self.standardize,
            pca: self.pca.clone(),
            tune: self.tune.clone(),
            seed,
        };
        Ok(recipe.candidates()?)
    }
}
