//! Which classifier is trained, with which steps before it.

use corsmal_models::classifiers::ClassifierSpec;
use corsmal_models::grid;
use corsmal_models::params::key_values;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_models::steps::StepSpec;
use serde_json::{Map, Value};

use crate::failure::Failure;

/// Steps and classifier.
#[derive(clap::Args)]
pub struct PipelineArgs {
    /// knn, svm, tree, rf, et or logistic.
    #[arg(long, value_name = "NAME")]
    classifier: String,
    /// A parameter of the classifier, such as trees=500 or C=10.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    parameters: Vec<String>,
    /// Scale every feature to zero mean and unit variance on the training rows.
    #[arg(long)]
    standardize: bool,
    /// Principal components to keep: a number of them, or a part of the variance below 1.0.
    #[arg(long, value_name = "N")]
    pca: Option<String>,
    /// Try these values, such as C=0.1,1,10; repeated, every combination. The choice is made on
    /// folds inside the training rows.
    #[arg(long, value_name = "KEY=V1,V2")]
    tune: Vec<String>,
    /// Seed of the classifier and of shuffled folds.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
}

impl PipelineArgs {
    /// The pipelines to choose from: one, unless something is tuned.
    pub fn candidates(&self) -> Result<Vec<PipelineSpec>, Failure> {
        let mut parameters = key_values(&self.parameters)?;
        let seeded =
            ClassifierSpec::named(&self.classifier)?.table().iter().any(|p| p.key == "seed");
        if seeded {
            parameters.entry("seed").or_insert_with(|| self.seed.into());
        }
        let base = ClassifierSpec::new(&self.classifier, &parameters)?;
        let mut grid: Vec<(String, Vec<Value>)> = Vec::new();
        for text in &self.tune {
            for (key, values) in key_values(std::slice::from_ref(text))? {
                if grid.iter().any(|(k, _)| *k == key) || self.sets(&key)? {
                    return Err(Failure::new(format!("--tune {text}: {key} is given twice")));
                }
                let values = match values {
                    Value::Array(values) => values,
                    single => vec![single],
                };
                grid.push((key, values));
            }
        }
        let steps = self.steps()?;
        let with_steps = |classifier| PipelineSpec { steps: steps.clone(), classifier };
        Ok(grid::combinations(&base, &grid)?.into_iter().map(with_steps).collect())
    }

    fn sets(&self, key: &str) -> Result<bool, Failure> {
        Ok(key_values(&self.parameters)?.contains_key(key))
    }

    fn steps(&self) -> Result<Vec<StepSpec>, Failure> {
        let mut steps = Vec::new();
        if self.standardize {
            steps.push(StepSpec::new("standardize", &Map::new())?);
        }
        if let Some(components) = &self.pca {
            let parameters = key_values(&[format!("n_components={components}")])?;
            steps.push(StepSpec::new("pca", &parameters)?);
        }
        Ok(steps)
    }
}

/// A pipeline in a line, with the parameters that are not the classifier's defaults.
pub fn describe(spec: &PipelineSpec) -> String {
    let defaults = ClassifierSpec::named(spec.classifier.name()).map(|c| c.parameters());
    let defaults = defaults.unwrap_or_default();
    let parameters = spec.classifier.parameters();
    let changed: Vec<String> = parameters
        .iter()
        .filter(|(key, value)| defaults.get(*key) != Some(value))
        .map(|(key, value)| format!("{key}={value}"))
        .collect();
    let mut parts: Vec<String> = spec.steps.iter().map(|s| s.name().to_string()).collect();
    parts.push(format!("{} {}", spec.classifier.name(), changed.join(" ")).trim_end().to_string());
    parts.join(", ")
}
