//! What M3 and the fused estimate learn, and their file.

use std::collections::BTreeMap;
use std::path::Path;

use corsmal_files::sealed::{self, Seal};
use corsmal_files::{content, draft};
use corsmal_vision::category::{Category, Vote};
use corsmal_vision::fused::{Example, Fusion};
use corsmal_vision::{GaussianProcess, Normal};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::methods::{Estimate, region_sizes};
use super::problem::Problem;
use crate::error::{CcmError, Result};

/// Version of the file format.
const FORMAT: u32 = 1;
/// Largest file that is read; three processes of their largest size take a quarter.
const MAX_BYTES: u64 = 8 << 20;
/// Sizes that a process takes: width and height in four views.
const SIZES: usize = 8;
/// Name of the file format.
const KIND: &str = "corsmal-feat capacity model";

/// M3: a Gaussian process for each category.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct M3 {
    processes: BTreeMap<Category, GaussianProcess>,
    /// What stands for a view without the container.
    means: BTreeMap<Category, Vec<f64>>,
}

/// Everything that was learned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CapacityModel {
    kind: String,
    format: u32,
    /// Version of the program that wrote it.
    pub tool_version: String,
    /// What it was learned from: folder, recordings, containers, seed.
    pub provenance: Value,
    /// M3's processes.
    pub m3: M3,
    /// Reliability of the methods; `None` where only M3 was learned.
    pub fusion: Option<Fusion>,
}

/// A recording to learn from.
pub(super) struct Sample {
    pub(super) container: u8,
    pub(super) category: Category,
    pub(super) capacity: f64,
    pub(super) vote: Option<Vote>,
    pub(super) estimates: BTreeMap<String, f64>,
}

impl M3 {
    /// Fits a process to each category that has two recordings or more.
    pub(super) fn fit(samples: &[&Sample]) -> Result<Self> {
        let mut model = Self::default();
        for category in Category::ALL {
            let rows: Vec<(Vec<Option<f64>>, f64)> = samples
                .iter()
                .filter(|s| s.category == category)
                .filter_map(|s| Some((region_sizes(s.vote.as_ref()?), s.capacity.ln())))
                .collect();
            if rows.len() < 2 {
                continue;
            }
            let width = rows[0].0.len();
            let means: Vec<f64> = (0..width)
                .map(|c| {
                    let known: Vec<f64> = rows.iter().filter_map(|(r, _)| r[c]).collect();
                    known.iter().sum::<f64>() / known.len().max(1) as f64
                })
                .collect();
            let inputs: Vec<Vec<f64>> = rows.iter().map(|(r, _)| filled(r, &means)).collect();
            let targets: Vec<f64> = rows.iter().map(|(_, t)| *t).collect();
            let process = GaussianProcess::fit(&inputs, &targets)
                .map_err(|e| CcmError::Request(format!("category {}: {e}", category.name())))?;
            model.processes.insert(category, process);
            model.means.insert(category, means);
        }
        if model.processes.is_empty() {
            return Err(CcmError::Request(
                "no category has two recordings with detections of their container".into(),
            ));
        }
        Ok(model)
    }

    /// Checks what comes from a file; the processes have been.
    fn check(&self) -> std::result::Result<(), String> {
        if self.processes.is_empty() {
            return Err("no process of any category".into());
        }
        for (category, process) in &self.processes {
            let means = self.means.get(category).map_or(0, Vec::len);
            if (process.inputs(), means) != (SIZES, SIZES) {
                return Err(format!(
                    "category {}: a process of {} sizes and {means} means; expected {SIZES} of each",
                    category.name(),
                    process.inputs()
                ));
            }
        }
        match self.means.values().flatten().find(|mean| !mean.is_finite()) {
            Some(mean) => Err(format!("a mean size of {mean}; expected a logarithm of px")),
            None => Ok(()),
        }
    }

    /// The logarithm of the capacity in mL.
    pub(super) fn predict(&self, vote: &Vote) -> std::result::Result<Normal, Problem> {
        let known = self.processes.get(&vote.category).zip(self.means.get(&vote.category));
        let (process, means) = known.ok_or_else(|| {
            Problem::Missing(format!("the model has learned no {}", vote.category.name()))
        })?;
        Ok(process.predict(&filled(&region_sizes(vote), means))?)
    }

    pub(super) fn estimate(&self, vote: &Vote) -> std::result::Result<Estimate, Problem> {
        let Normal { mean, deviation } = self.predict(vote)?;
        Ok(Estimate {
            capacity: mean.exp(),
            band: Some([(mean - deviation).exp(), (mean + deviation).exp()]),
            frames: vote.frames,
            ..Estimate::default()
        })
    }
}

fn filled(row: &[Option<f64>], means: &[f64]) -> Vec<f64> {
    row.iter().zip(means).map(|(value, mean)| value.unwrap_or(*mean)).collect()
}

/// Mean score of a method by category: of exp(-relative error), 0 without an estimate.
pub type HeldOut = BTreeMap<Category, BTreeMap<String, f64>>;

/// Examples for the fusion; M3's estimates come from processes that did not see the container.
fn examples(samples: &[&Sample]) -> Vec<Example> {
    let mut processes: BTreeMap<u8, Option<M3>> = BTreeMap::new();
    let mut examples = Vec::with_capacity(samples.len());
    for sample in samples {
        let m3 = processes.entry(sample.container).or_insert_with(|| {
            let others = samples.iter().filter(|s| s.container != sample.container);
            let others: Vec<_> =
                others.filter(|s| s.category == sample.category).copied().collect();
            M3::fit(&others).ok()
        });
        let both = m3.as_ref().zip(sample.vote.as_ref());
        let normal = both.and_then(|(m3, vote)| m3.predict(vote).ok());
        examples.push(Example {
            container: sample.container,
            category: sample.category,
            capacity: sample.capacity,
            estimates: sample.estimates.clone(),
            learned: normal.map(|normal| ("m3".into(), normal.mean.exp())).into_iter().collect(),
        });
    }
    examples
}

/// Every container estimated by what was learned from the others, and the methods that need no
/// learning as they are.
pub(super) fn held_out(samples: &[Sample]) -> HeldOut {
    let mut containers: Vec<u8> = samples.iter().map(|s| s.container).collect();
    containers.sort_unstable();
    containers.dedup();
    let mut sums: BTreeMap<Category, BTreeMap<String, (f64, usize)>> = BTreeMap::new();
    for container in containers {
        let others: Vec<&Sample> = samples.iter().filter(|s| s.container != container).collect();
        let fusion = Fusion::fit(&examples(&others));
        let own: Vec<&Sample> = samples.iter().filter(|s| s.container == container).collect();
        let category = own.first().map(|s| s.category);
        let same: Vec<&Sample> =
            others.iter().filter(|s| Some(s.category) == category).copied().collect();
        let m3 = M3::fit(&same).ok();
        for sample in own {
            let mut estimates = sample.estimates.clone();
            let vote = sample.vote.as_ref();
            if let Some(normal) = m3.as_ref().zip(vote).and_then(|(m3, vote)| m3.predict(vote).ok())
            {
                estimates.insert("m3".into(), normal.mean.exp());
            }
            // The prior is that of the voted category, too: what stands in one row knows equally much.
            let fused = vote.and_then(|vote| fusion.estimate(vote.category, &estimates));
            if let Some(&[mean, _]) = vote.and_then(|vote| fusion.priors.get(&vote.category)) {
                estimates.insert("prior".into(), mean.exp());
            }
            if let Some(fused) = fused {
                estimates.insert("fused".into(), fused.capacity);
            }
            let of = sums.entry(sample.category).or_default();
            for method in ["lode", "profile", "cuboid", "upright", "m3", "prior", "fused"] {
                let error = |e: &f64| (e - sample.capacity).abs() / sample.capacity;
                let score = estimates.get(method).map_or(0.0, |e| (-error(e)).exp());
                let (sum, count) = of.entry(method.into()).or_default();
                *sum += score;
                *count += 1;
            }
        }
    }
    let mean = |(method, (sum, count)): (String, (f64, usize))| (method, sum / count as f64);
    sums.into_iter().map(|(c, of)| (c, of.into_iter().map(mean).collect())).collect()
}

impl CapacityModel {
    /// Learns M3 and, where wanted, the reliability of all methods.
    pub(super) fn fit(samples: &[Sample], fused: bool, provenance: Value) -> Result<Self> {
        let all: Vec<&Sample> = samples.iter().collect();
        Ok(Self {
            kind: KIND.into(),
            format: FORMAT,
            tool_version: env!("CARGO_PKG_VERSION").into(),
            provenance,
            m3: M3::fit(&all)?,
            fusion: fused.then(|| Fusion::fit(&examples(&all))),
        })
    }

    /// Reads a model.
    ///
    /// # Errors
    /// [`CcmError`] for files that cannot be read, are none of these models or of another version.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = content::read(path, MAX_BYTES).map_err(|e| CcmError::io(path, e))?;
        let refuse = |e: serde_json::Error| {
            CcmError::Request(format!(
                "{}: not a model of `capacity train --method m3` or `fused`: {e}",
                path.display()
            ))
        };
        let mut value: Value = serde_json::from_slice(&bytes).map_err(refuse)?;
        let seal = Seal::take(&mut value);
        if value["kind"] == KIND {
            seal.check(|_| ())
                .map_err(|why| CcmError::Request(format!("{}: {why}", path.display())))?;
        }
        let model: Self = serde_json::from_value(value).map_err(refuse)?;
        if (model.kind.as_str(), model.format) != (KIND, FORMAT) {
            return Err(CcmError::Request(format!(
                "{}: '{}' of format {}; this program reads '{KIND}' of format {FORMAT}",
                path.display(),
                model.kind,
                model.format
            )));
        }
        let fusion = model.fusion.as_ref().map_or(Ok(()), Fusion::check);
        model
            .m3
            .check()
            .and(fusion)
            .map_err(|reason| CcmError::Request(format!("{}: {reason}", path.display())))?;
        Ok(model)
    }

    /// Writes the model; the file appears only when complete.
    ///
    /// # Errors
    /// [`CcmError`] when it cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        let refuse = |why: String| CcmError::Request(format!("{}: {why}", path.display()));
        let mut value = serde_json::to_value(self).map_err(|e| refuse(e.to_string()))?;
        sealed::seal(&mut value, |_| ()).map_err(refuse)?;
        draft::write(path, value.to_string().as_bytes()).map_err(CcmError::Write)
    }
}
