//! An estimate from the methods at hand: the one that was near on known containers, or else several of them and
//! the category's prior, weighted by how well each did.
//!
//! This is beyond the paper. Every method's estimates are compared with known capacities, category by
//! category, in logarithms: the mean of the differences is its bias, their spread its uncertainty. Two or three
//! containers tell little about a bias, so a method that was near without a correction is taken as it is. Where none
//! is at hand, an estimate is the mean of the corrected ones, weighted by the inverse of their variances.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use crate::category::Category;

/// Smallest standard deviation of a method, in logarithms: no method is that exact on a new container.
const FLOOR: f64 = 0.03;
/// Largest error of a method that is taken as it is, in logarithms.
const NEAR: f64 = 0.15;
/// Largest logarithm of a capacity, and of an estimate over it, that a file may have.
const MAX_LOG: f64 = 30.0;

/// Bias and spread of a method in one category, in logarithms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodError {
    /// Mean of the logarithm of estimate over truth.
    pub bias: f64,
    /// Their root mean square about the bias, between containers and within.
    pub deviation: f64,
    /// Containers it was seen on.
    pub containers: usize,
    /// Root mean square of the logarithm as it is; none for a method that learned from the containers itself, and
    /// for one that was seen on a single container.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uncorrected: Option<f64>,
}

/// What is known of the methods and of the containers of a category.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fusion {
    /// By category and method.
    pub methods: BTreeMap<Category, BTreeMap<String, MethodError>>,
    /// Mean and standard deviation of the logarithm of the capacity in mL, by category.
    pub priors: BTreeMap<Category, [f64; 2]>,
}

/// One example to learn from.
#[derive(Clone, Debug)]
pub struct Example {
    /// Which container it is: examples of one container are not independent.
    pub container: u8,
    /// Its kind.
    pub category: Category,
    /// Its capacity in mL.
    pub capacity: f64,
    /// Estimates in mL by method.
    pub estimates: BTreeMap<String, f64>,
    /// Those of methods that learned from the other containers. Few of them may agree by chance, so these are never
    /// taken as they are.
    pub learned: BTreeMap<String, f64>,
}

/// What the mean of a category is called among methods.
pub const PRIOR: &str = "prior";

/// An estimate and its uncertainty.
#[derive(Clone, Debug, PartialEq)]
pub struct Fused {
    /// Capacity in mL.
    pub capacity: f64,
    /// Standard deviation of its logarithm.
    pub deviation: f64,
    /// Methods that had a part in it, perhaps the prior.
    pub methods: Vec<String>,
}

impl Fusion {
    /// Learns biases and spreads.
    pub fn fit(examples: &[Example]) -> Self {
        let mut fusion = Self::default();
        for category in Category::ALL {
            let of_category: Vec<_> = examples.iter().filter(|e| e.category == category).collect();
            let mut capacities: BTreeMap<u8, f64> = BTreeMap::new();
            let mut errors: BTreeMap<&str, BTreeMap<u8, Vec<f64>>> = BTreeMap::new();
            let mut learned: BTreeSet<&str> = BTreeSet::new();
            for example in of_category {
                let truth = example.capacity.ln();
                capacities.insert(example.container, truth);
                learned.extend(example.learned.keys().map(String::as_str));
                for (method, estimate) in example.estimates.iter().chain(&example.learned) {
                    let error = estimate.ln() - truth;
                    if error.is_finite() {
                        let of_method = errors.entry(method).or_default();
                        of_method.entry(example.container).or_default().push(error);
                    }
                }
            }
            if capacities.is_empty() {
                continue;
            }
            let logs: Vec<f64> = capacities.into_values().collect();
            let mean = mean(&logs);
            // A handful of containers says little about the next: the spread of their mean is added.
            let spread = variance(&logs).map_or(1.0, |v| v * (1.0 + 1.0 / logs.len() as f64));
            fusion.priors.insert(category, [mean, spread.sqrt().max(FLOOR)]);
            let methods = errors.into_iter().map(|(method, of)| {
                let mut error = reliability(&of);
                error.uncorrected = error.uncorrected.filter(|_| !learned.contains(method));
                (method.to_string(), error)
            });
            fusion.methods.insert(category, methods.collect());
        }
        fusion
    }

    /// Checks what comes from a file.
    ///
    /// # Errors
    /// A text that names category and method.
    pub fn check(&self) -> Result<(), String> {
        let sound = |mean: f64, deviation: f64| {
            mean.abs() <= MAX_LOG && (FLOOR..=MAX_LOG).contains(&deviation)
        };
        let methods = self.methods.iter().flat_map(|(category, of)| {
            of.iter().map(move |(name, r)| (category, name.as_str(), r.bias, r.deviation))
        });
        let priors = self.priors.iter().map(|(c, [mean, deviation])| (c, PRIOR, *mean, *deviation));
        for (category, of) in &self.methods {
            let odd = |e: &f64| !(0.0..=MAX_LOG).contains(e);
            let of = of.iter().find_map(|(name, r)| Some((name, r.uncorrected.filter(odd)?)));
            if let Some((name, error)) = of {
                return Err(format!(
                    "{name} of category {}: uncorrected {error}; expected a logarithm of 0 to {MAX_LOG}",
                    category.name()
                ));
            }
        }
        match methods.chain(priors).find(|(.., mean, deviation)| !sound(*mean, *deviation)) {
            None => Ok(()),
            Some((category, name, mean, deviation)) => Err(format!(
                "{name} of category {}: mean {mean} and deviation {deviation}; expected logarithms of at \
                 most {MAX_LOG}, and a deviation of at least {FLOOR}",
                category.name()
            )),
        }
    }

    /// The estimate for a container of a category; `None` where nothing is known of it.
    pub fn estimate(&self, category: Category, estimates: &BTreeMap<String, f64>) -> Option<Fused> {
        let known = self.methods.get(&category);
        let near = estimates.iter().filter_map(|(method, &estimate)| {
            let error = known?.get(method)?.uncorrected.filter(|error| *error <= NEAR)?;
            estimate.ln().is_finite().then_some((method, estimate, error))
        });
        if let Some((method, capacity, error)) = near.min_by(|a, b| a.2.total_cmp(&b.2)) {
            let methods = vec![method.clone()];
            return Some(Fused { capacity, deviation: error.max(FLOOR), methods });
        }
        let mut parts: Vec<(String, f64, f64)> = estimates
            .iter()
            .filter_map(|(method, estimate)| {
                let reliability = known?.get(method)?;
                let value = estimate.ln() - reliability.bias;
                value.is_finite().then(|| (method.clone(), value, reliability.deviation))
            })
            .collect();
        if let Some(&[mean, deviation]) = self.priors.get(&category) {
            parts.push((PRIOR.into(), mean, deviation));
        }
        let weight: f64 = parts.iter().map(|(_, _, d)| d.powi(-2)).sum();
        let sum: f64 = parts.iter().map(|(_, value, d)| value * d.powi(-2)).sum();
        (weight > 0.0).then(|| Fused {
            capacity: (sum / weight).exp(),
            deviation: weight.sqrt().recip(),
            methods: parts.into_iter().map(|(method, ..)| method).collect(),
        })
    }
}

/// Every container counts once: the bias is the mean of their means.
fn reliability(errors: &BTreeMap<u8, Vec<f64>>) -> MethodError {
    let means: Vec<f64> = errors.values().map(|e| mean(e)).collect();
    let bias = mean(&means);
    let n = means.len() as f64;
    let within = errors.values().map(|e| {
        let own = mean(e);
        e.iter().map(|v| (v - own).powi(2)).sum::<f64>() / e.len() as f64
    });
    let within = within.sum::<f64>() / n;
    // One container tells nothing about the spread between containers.
    let between = variance(&means).map_or(0.25, |v| v * (1.0 + 1.0 / n));
    let squares = errors.values().map(|e| e.iter().map(|v| v * v).sum::<f64>() / e.len() as f64);
    MethodError {
        bias,
        deviation: (within + between).sqrt().max(FLOOR),
        containers: means.len(),
        uncorrected: (means.len() > 1).then(|| (squares.sum::<f64>() / n).sqrt()),
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Unbiased; `None` for fewer than two values.
fn variance(values: &[f64]) -> Option<f64> {
    let mean = mean(values);
    let sum: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    (values.len() > 1).then(|| sum / (values.len() - 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example(container: u8, capacity: f64, good: f64, bad: f64) -> Example {
        let estimates = [("good".to_string(), good), ("bad".to_string(), bad)].into();
        let learned = BTreeMap::new();
        Example { container, category: Category::Cup, capacity, estimates, learned }
    }

    fn estimates<const N: usize>(of: [(&str, f64); N]) -> BTreeMap<String, f64> {
        of.map(|(method, capacity)| (method.to_string(), capacity)).into()
    }

    #[test]
    fn impossible_numbers_in_a_file_are_refused() {
        let mut fusion =
            Fusion::fit(&[example(1, 500.0, 600.0, 300.0), example(2, 200.0, 240.0, 400.0)]);
        assert_eq!(fusion.check(), Ok(()));
        let good = fusion.methods[&Category::Cup]["good"];
        for (bias, deviation) in
            [(f64::NAN, 0.1), (1e3, 0.1), (0.0, 0.0), (0.0, -1.0), (0.0, f64::INFINITY)]
        {
            let changed = MethodError { bias, deviation, ..good };
            let of = fusion.methods.get_mut(&Category::Cup).unwrap();
            of.insert("good".into(), changed);
            let error = fusion.check().unwrap_err();
            assert!(error.starts_with("good of category cup: "), "{error}");
        }
        for uncorrected in [f64::NAN, -0.1, 1e3] {
            let changed = MethodError { uncorrected: Some(uncorrected), ..good };
            let of = fusion.methods.get_mut(&Category::Cup).unwrap();
            of.insert("good".into(), changed);
            let error = fusion.check().unwrap_err();
            assert!(error.starts_with("good of category cup: uncorrected "), "{error}");
        }
        fusion.methods.clear();
        fusion.priors.insert(Category::Box, [1e9, 0.1]);
        assert!(fusion.check().unwrap_err().starts_with("prior of category box"));
    }

    #[test]
    fn a_method_that_was_near_is_taken_as_it_is() {
        // `good` is 10 % too low on one container and 10 % too high on the other.
        let mut examples = [example(1, 500.0, 450.0, 900.0), example(2, 200.0, 220.0, 30.0)];
        let fusion = Fusion::fit(&examples);
        let both = estimates([("good", 120.0), ("bad", 900.0)]);
        let found = fusion.estimate(Category::Cup, &both).unwrap();
        assert_eq!((found.capacity, &found.methods[..]), (120.0, &["good".to_string()][..]));
        assert!((0.09..0.11).contains(&found.deviation), "{found:?}");
        // Without it, the others and the prior do what they can.
        let found = fusion.estimate(Category::Cup, &estimates([("bad", 900.0)])).unwrap();
        assert_eq!(found.methods, ["bad", "prior"]);
        // One container tells nothing, and nor does what learned from the containers.
        let found = Fusion::fit(&examples[..1]).estimate(Category::Cup, &both).unwrap();
        assert_eq!(found.methods, ["bad", "good", "prior"]);
        for example in &mut examples {
            example.learned = std::mem::take(&mut example.estimates);
        }
        let found = Fusion::fit(&examples).estimate(Category::Cup, &both).unwrap();
        assert_eq!(found.methods, ["bad", "good", "prior"]);
    }

    #[test]
    fn files_without_uncorrected_errors_give_the_weighted_mean() {
        let examples = [example(1, 500.0, 450.0, 900.0), example(2, 200.0, 220.0, 30.0)];
        let mut value = serde_json::to_value(Fusion::fit(&examples)).unwrap();
        for error in value["methods"]["cup"].as_object_mut().unwrap().values_mut() {
            assert!(error.as_object_mut().unwrap().remove("uncorrected").is_some());
        }
        let fusion: Fusion = serde_json::from_value(value).unwrap();
        assert_eq!(fusion.check(), Ok(()));
        let both = estimates([("good", 120.0), ("bad", 900.0)]);
        assert_eq!(fusion.estimate(Category::Cup, &both).unwrap().methods.len(), 3);
    }

    #[test]
    fn the_reliable_method_decides_and_its_bias_is_removed() {
        let fusion = Fusion::fit(&[
            example(1, 500.0, 600.0, 300.0),
            example(2, 200.0, 240.0, 400.0),
            example(3, 300.0, 360.0, 100.0),
        ]);
        let both = [("good".to_string(), 120.0), ("bad".to_string(), 900.0)].into();
        let found = fusion.estimate(Category::Cup, &both).unwrap();
        assert!((found.capacity - 100.0).abs() < 3.0, "{found:?}");
        assert_eq!(found.methods, ["bad", "good", "prior"]);
        let none = fusion.estimate(Category::Cup, &BTreeMap::new()).unwrap();
        assert!((none.capacity - (500.0f64 * 200.0 * 300.0).cbrt()).abs() < 1e-9);
        assert!(none.deviation > 5.0 * found.deviation);
        assert_eq!(fusion.estimate(Category::Box, &both), None);
        let unusable = [("good".to_string(), 0.0), ("bad".to_string(), -1.0)].into();
        assert_eq!(fusion.estimate(Category::Cup, &unusable), Some(none));
    }
}
