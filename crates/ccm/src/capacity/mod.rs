//! Capacity of the containers from the data set's views: M3, M4, M5 and a fused estimate.
//!
//! `docs/vision.md` says what is published, what is corrected and what is our reading.

mod combine;
mod methods;
mod model;
mod table;
mod views;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use corsmal_vision::cuboid::Outliers;
use corsmal_vision::lode::Variant;
use rayon::prelude::*;

use crate::dataset::{DataSet, Recording, Subset};
use crate::error::{CcmError, Result};
use crate::submission::RowKey;

pub use combine::combine_files;
pub use methods::{Estimate, Sizes};
use model::Sample;
pub use model::{CapacityModel, HeldOut};
pub use table::{Measured, PRIOR_MASS_G, Row, read, write};
pub use views::{Frame, Problem, Views};

/// A method of the paper, or the fused estimate beyond it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Gaussian processes on the sizes of detected regions.
    M3,
    /// Cuboid around the points of one depth image.
    M4,
    /// LoDE in two views.
    M5,
    /// All that there is, by measured reliability.
    Fused,
}

impl Method {
    /// Name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::M3 => "m3",
            Self::M4 => "m4",
            Self::M5 => "m5",
            Self::Fused => "fused",
        }
    }
}

/// What to estimate, and how.
#[derive(Clone, Debug)]
pub struct CapacityOptions {
    /// Folder of the data set.
    pub data: PathBuf,
    /// Folder of tables of detections; `None` for those beside the recordings.
    pub detections: Option<PathBuf>,
    /// The method.
    pub method: Method,
    /// How faithfully LoDE is followed.
    pub variant: Variant,
    /// How M4's outliers are dropped.
    pub outliers: Outliers,
    /// What M3 and the fused estimate have learned.
    pub model: Option<CapacityModel>,
    /// Recordings at a time.
    pub jobs: usize,
    /// Seed of votes and forests.
    pub seed: u64,
}

/// Estimates every recording of a data set, in its order. `progress` hears how many are done.
///
/// # Errors
/// [`CcmError`] when the data set cannot be opened, a model is missing, or the work is stopped.
pub fn run(
    options: &CapacityOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
    interrupted: &AtomicBool,
) -> Result<Vec<Row>> {
    let needs_model = matches!(options.method, Method::M3 | Method::Fused);
    let fusion = options.model.as_ref().is_some_and(|m| m.fusion.is_some());
    if needs_model && (options.model.is_none() || options.method == Method::Fused && !fusion) {
        return Err(CcmError::Request(format!(
            "method {0} needs --model, made by `corsmal-feat capacity train --method {0}`",
            options.method.name()
        )));
    }
    let set = DataSet::open(&options.data)?;
    each(&set.recordings, options.jobs, progress, interrupted, |recording| {
        let started = Instant::now();
        let views = Views::of(recording, options.detections.as_deref());
        let estimate = estimate(&views, options);
        Row {
            key: key(recording),
            estimate,
            execution_ms: started.elapsed().as_secs_f64() * 1000.0,
        }
    })
}

/// Work on all recordings in parallel; results in their order.
fn each<T: Send>(
    recordings: &[Recording],
    jobs: usize,
    progress: &(dyn Fn(usize, usize) + Sync),
    interrupted: &AtomicBool,
    work: impl Fn(&Recording) -> T + Sync,
) -> Result<Vec<T>> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|e| CcmError::Request(format!("no threads: {e}")))?;
    let done = AtomicUsize::new(0);
    pool.install(|| {
        let results = recordings.par_iter().map(|recording| {
            if interrupted.load(Ordering::Relaxed) {
                return Err(CcmError::Interrupted);
            }
            let result = work(recording);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1, recordings.len());
            Ok(result)
        });
        results.collect()
    })
}

fn estimate(views: &Views, options: &CapacityOptions) -> std::result::Result<Estimate, Problem> {
    let detections = methods::table(views)?;
    let without_model = || Problem::Missing("no model".into());
    match options.method {
        Method::M5 => methods::m5(views, &detections, options.variant),
        Method::M4 => methods::m4(views, &detections, options.outliers, options.seed),
        Method::M3 => {
            let model = options.model.as_ref().ok_or_else(without_model)?;
            model.m3.estimate(&methods::vote(&detections, options.seed)?)
        }
        Method::Fused => {
            let model = options.model.as_ref().ok_or_else(without_model)?;
            let fusion = model.fusion.as_ref().ok_or_else(without_model)?;
            let vote = methods::vote(&detections, options.seed)?;
            let found = methods::geometry(views, &detections, options.seed)?;
            let (mut estimates, sizes, frames) = (found.estimates, found.sizes, found.frames);
            if let Ok(normal) = model.m3.predict(&vote) {
                estimates.insert("m3".into(), normal.mean.exp());
            }
            let fused = fusion.estimate(vote.category, &estimates).ok_or_else(|| {
                Problem::Missing(format!("the model has learned no {}", vote.category.name()))
            })?;
            let factor = fused.deviation.exp();
            Ok(Estimate {
                capacity: fused.capacity,
                band: Some([fused.capacity / factor, fused.capacity * factor]),
                frames,
                sizes,
                substitute: None,
            })
        }
    }
}

/// Learns from the training recordings of a data set. For the fused estimate, also the scores of all
/// methods on containers that nothing was learned from.
///
/// # Errors
/// [`CcmError`] when the data set cannot be opened, nothing can be learned, or the work is stopped.
pub fn train(
    options: &CapacityOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
    interrupted: &AtomicBool,
) -> Result<(CapacityModel, Option<HeldOut>)> {
    let fused = options.method == Method::Fused;
    let set = DataSet::open(&options.data)?;
    let recordings: Vec<Recording> =
        set.recordings.iter().filter(|r| r.part == Subset::Training).cloned().collect();
    let samples = each(&recordings, options.jobs, progress, interrupted, |recording| {
        let container = recording.container?;
        let annotated = set.annotation(recording).map(|a| a.capacity_ml).filter(|c| *c > 0.0);
        let capacity = annotated.or(container.capacity_ml())?;
        let views = Views::of(recording, options.detections.as_deref());
        let detections = methods::table(&views).ok()?;
        let geometry = || methods::geometry(&views, &detections, options.seed).unwrap_or_default();
        let estimates = if fused { geometry().estimates } else { Default::default() };
        Some(Sample {
            container: container.number(),
            category: methods::category_of(container.category()),
            capacity,
            vote: methods::vote(&detections, options.seed).ok(),
            estimates,
        })
    })?;
    let samples: Vec<Sample> = samples.into_iter().flatten().collect();
    let mut containers: Vec<u8> = samples.iter().map(|s| s.container).collect();
    containers.sort_unstable();
    containers.dedup();
    let provenance = serde_json::json!({
        "method": options.method.name(),
        "data": options.data.display().to_string(),
        "synthetic": set.synthetic,
        "recordings": samples.len(),
        "with_container": samples.iter().filter(|s| s.vote.is_some()).count(),
        "containers": containers,
        "seed": options.seed,
    });
    let model = CapacityModel::fit(&samples, fused, provenance)?;
    Ok((model, fused.then(|| model::held_out(&samples))))
}

/// How a recording is named in tables: by container and sequence where they are known.
fn key(recording: &Recording) -> RowKey {
    match (recording.container, recording.sequence, recording.id) {
        (Some(container), Some(sequence), _) => RowKey::Sequence(container.number(), sequence),
        (_, _, id) => RowKey::Id(id.unwrap_or_default()),
    }
}
