//! What a user asks to be trained: a classifier by name, its parameters as text, steps before it, and
//! values to try.

use serde_json::{Map, Value};

use crate::classifiers::ClassifierSpec;
use crate::error::{ModelError, Result};
use crate::grid;
use crate::params::key_values;
use crate::pipeline::PipelineSpec;
use crate::steps::StepSpec;

/// A request for one pipeline, or for several to choose from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PipelineRequest {
    /// name of the classifier
    pub classifier: String,
    /// its parameters as `key=value`
    pub parameters: Vec<String>,
    /// whether features are scaled first
    pub standardize: bool,
    /// principal components to keep: a number of them, or a part of the variance
    pub pca: Option<String>,
    /// values to try as `key=v1,v2`
    pub tune: Vec<String>,
    /// seed of the classifier, unless a parameter says otherwise
    pub seed: u32,
}

impl Default for PipelineRequest {
    fn default() -> Self {
        Self {
            classifier: "rf".into(),
            parameters: Vec::new(),
            standardize: false,
            pca: None,
            tune: Vec::new(),
            seed: 0,
        }
    }
}

impl PipelineRequest {
    /// The pipelines to choose from: one, unless something is tuned.
    ///
    /// # Errors
    /// Unknown names, impossible values, parameters given twice.
    pub fn candidates(&self) -> Result<Vec<PipelineSpec>> {
        let named = ClassifierSpec::named(&self.classifier)?;
        let mut parameters = Map::new();
        for (word, value) in key_values(&self.parameters)? {
            let key = named.key(&word).to_string();
            if parameters.contains_key(&key) {
                return Err(twice(&named, key, value.to_string()));
            }
            parameters.insert(key, value);
        }
        let given: Vec<String> = parameters.keys().cloned().collect();
        if named.table().iter().any(|p| p.key == "seed") {
            parameters.entry("seed").or_insert_with(|| self.seed.into());
        }
        let base = ClassifierSpec::new(&self.classifier, &parameters)?;
        let mut grid: Vec<(String, Vec<Value>)> = Vec::new();
        for text in &self.tune {
            for (word, values) in key_values(std::slice::from_ref(text))? {
                let key = base.key(&word).to_string();
                if grid.iter().any(|(k, _)| *k == key) || given.contains(&key) {
                    return Err(twice(&base, key, text.clone()));
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

    fn steps(&self) -> Result<Vec<StepSpec>> {
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

fn twice(classifier: &ClassifierSpec, key: String, value: String) -> ModelError {
    let remedy = format!("once as {value}; either set it or tune it");
    ModelError::GivenTwice { owner: classifier.name(), key, remedy }
}

impl PipelineSpec {
    /// The pipeline in a line, with the parameters that are not the classifier's defaults.
    pub fn describe(&self) -> String {
        self.describe_among(&[])
    }

    /// The same with the parameters in which candidates differ, default or not.
    pub fn describe_among(&self, candidates: &[Self]) -> String {
        let all: Vec<_> = candidates.iter().map(|c| c.classifier.parameters()).collect();
        let defaults = ClassifierSpec::named(self.classifier.name()).map(|c| c.parameters());
        let defaults = defaults.unwrap_or_default();
        let parameters = self.classifier.parameters();
        let changed: Vec<String> = parameters
            .iter()
            .filter(|(key, value)| {
                let tuned = all.iter().any(|other| other.get(*key) != Some(value));
                tuned || defaults.get(*key) != Some(value)
            })
            .map(|(key, value)| format!("{key}={value}"))
            .collect();
        let mut parts: Vec<String> = self.steps.iter().map(|s| s.name().to_string()).collect();
        let classifier = format!("{} {}", self.classifier.name(), changed.join(" "));
        parts.push(classifier.trim_end().to_string());
        parts.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_tuned_is_told_even_where_it_is_the_default() {
        let tune = vec!["k=1,5".to_string()];
        let request = PipelineRequest { classifier: "knn".into(), tune, ..Default::default() };
        let all = request.candidates().unwrap();
        let told: Vec<String> = all.iter().map(|spec| spec.describe_among(&all)).collect();
        assert_eq!(told, ["knn k=1", "knn k=5"]);
        assert_eq!(all[1].describe(), "knn");
    }
}
