//! All combinations of listed parameter values.

use serde_json::{Map, Value};

use crate::classifiers::ClassifierSpec;
use crate::error::{ModelError, Result};

/// Most combinations of one grid.
pub const MOST_COMBINATIONS: usize = 10_000;

/// Every combination of `grid` (parameter → values to try) over `base`, the last key varying
/// fastest; none twice.
///
/// # Errors
/// A parameter without values, too many combinations, unknown parameters or impossible values.
pub fn combinations(
    base: &ClassifierSpec,
    grid: &[(String, Vec<Value>)],
) -> Result<Vec<ClassifierSpec>> {
    let refuse = |reason: String| Err(ModelError::Folds { reason });
    let mut parameters: Vec<Map<String, Value>> = vec![base.parameters()];
    for (key, values) in grid {
        if values.is_empty() {
            return refuse(format!("no values to try for {key}"));
        }
        if parameters.len().saturating_mul(values.len()) > MOST_COMBINATIONS {
            return refuse(format!("more than {MOST_COMBINATIONS} combinations to try"));
        }
        let with = |p: &Map<String, Value>, value: &Value| {
            let mut p = p.clone();
            p.insert(key.clone(), value.clone());
            p
        };
        parameters =
            parameters.iter().flat_map(|p| values.iter().map(move |v| with(p, v))).collect();
    }
    let mut found: Vec<ClassifierSpec> = Vec::new();
    for parameters in &parameters {
        let spec = ClassifierSpec::new(base.name(), parameters)?;
        // Values that were listed twice would be trained twice.
        if !found.contains(&spec) {
            found.push(spec);
        }
    }
    Ok(found)
}
