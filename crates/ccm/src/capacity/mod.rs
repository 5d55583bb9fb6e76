//! Capacity of the containers from the data set's views: M2, M3, M4, M5 and a fused estimate.
//!
//! `docs/vision.md` says what is published, what is corrected and what is our reading.

mod checks;
mod colours;
mod combine;
mod frames;
mod methods;
mod model;
mod options;
mod problem;
mod regions;
mod seen;
mod table;
mod views;

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use corsmal_vision::fused::PRIOR;
use rayon::prelude::*;

use crate::dataset::{Container, DataSet, Recording, Subset};
use crate::error::{CcmError, Result};
use crate::submission::RowKey;

pub(crate) use checks::require_own_tables;
pub use checks::without_tables;
pub use checks::{doubtful_colours, require_colours};
pub use colours::{Colours, Reader};
pub use combine::combine_files;
pub use frames::{Frame, Kind};
pub use methods::{Estimate, M5_FROM_END, RegionNetwork, Sizes};
use model::Sample;
pub use model::{CapacityModel, HeldOut};
pub use options::{CapacityOptions, Method};
pub use problem::Problem;
pub use regions::{LabelledRegion, Regions, regions};
pub(crate) use table::methods_of;
pub use table::{Measured, PRIOR_MASS_G, Row, read, write};
pub use views::Views;

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
    if options.method == Method::M2 && options.network.is_none() {
        return Err(CcmError::Request("method m2 needs its network: a model of `corsmal-feat capacity train --method m2`, or weights".into()));
    }
    let set = DataSet::open(&options.data)?;
    require_own_tables(&set.recordings, options.detections.as_deref())?;
    each(&set.recordings, options.jobs, progress, interrupted, |recording| {
        let started = Instant::now();
        let views = Views::of(recording, options.detections.as_deref());
        let estimate = estimate(&views, options).and_then(sound);
        Row {
            key: key(recording),
            part: recording.part,
            estimate,
            execution_ms: started.elapsed().as_secs_f64() * 1000.0,
        }
    })
}

/// Work on all recordings in parallel; results in their order.
pub(crate) fn each<T: Send>(
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

/// An estimate that can be a capacity; -1 stands for none in tables.
fn sound(estimate: Estimate) -> std::result::Result<Estimate, Problem> {
    let Estimate { capacity, .. } = estimate;
    if capacity.is_finite() && capacity > 0.0 {
        return Ok(estimate);
    }
    Err(Problem::Missing(format!(
        "an estimate of {capacity} mL, which is impossible for a container"
    )))
}

fn estimate(views: &Views, options: &CapacityOptions) -> std::result::Result<Estimate, Problem> {
    let without_model = || Problem::Missing("no model".into());
    // M2 needs no detections: a damaged table is none of its business.
    let detections = match options.method {
        Method::M2 => Vec::new(),
        _ => methods::table(views)?,
    };
    match options.method {
        Method::M2 => {
            let network = options.network.as_deref().ok_or_else(without_model)?;
            methods::m2(views, network, options.variant)
        }
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
            let (mut estimates, sizes, mut frames) = (found.estimates, found.sizes, found.frames);
            if let Ok(normal) = model.m3.predict(&vote) {
                estimates.insert("m3".into(), normal.mean.exp());
                frames.insert("m3".into(), vote.frames);
            }
            let fused = fusion.estimate(vote.category, &estimates).ok_or_else(|| {
                Problem::Missing(format!("the model has learned no {}", vote.category.name()))
            })?;
            let factor = fused.deviation.exp();
            let measured = fused.methods.iter().any(|method| method != PRIOR);
            let frames = fused.methods.iter().filter_map(|method| frames.get(method)).max();
            let category = vote.category.name();
            let substitute = (!measured).then(|| {
                format!(
                    "prior: no method that the model has learned for a {category} has an estimate"
                )
            });
            Ok(Estimate {
                capacity: fused.capacity,
                band: Some([fused.capacity / factor, fused.capacity * factor]),
                frames: frames.copied().unwrap_or(0),
                sizes,
                substitute,
            })
        }
    }
}

/// What was learned, and from what.
#[derive(Debug)]
pub struct Learned {
    /// The model.
    pub model: CapacityModel,
    /// Scores of all methods on containers that nothing was learned from, for the fused estimate.
    pub held_out: Option<HeldOut>,
    /// Training recordings of the data set.
    pub recordings: usize,
    /// Those with damaged files, which were left out, and the fault.
    pub failed: Vec<(RowKey, String)>,
}

/// Learns from the training recordings of a data set. One with damaged files is left out and named.
///
/// # Errors
/// [`CcmError`] when the data set cannot be opened, nothing can be learned, or the work is stopped.
pub fn train(
    options: &CapacityOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
    interrupted: &AtomicBool,
) -> Result<Learned> {
    let fused = options.method == Method::Fused;
    let set = DataSet::open(&options.data)?;
    let recordings = training(&set);
    require_own_tables(&recordings, options.detections.as_deref())?;
    let results = each(&recordings, options.jobs, progress, interrupted, |recording| {
        sample(&set, recording, options).transpose().map(|result| (key(recording), result))
    })?;
    let (mut samples, mut failed) = (Vec::new(), Vec::new());
    for (key, result) in results.into_iter().flatten() {
        match result {
            Ok(sample) => samples.push(sample),
            Err(Problem::Missing(reason) | Problem::Damaged(reason)) => failed.push((key, reason)),
        }
    }
    let mut containers: Vec<u8> = samples.iter().map(|s| s.container).collect();
    containers.sort_unstable();
    containers.dedup();
    if let (true, Some((key, reason))) = (samples.is_empty(), failed.first()) {
        return Err(CcmError::Request(format!(
            "{} of {} training recordings have damaged files, and none is left; the first, {key}: {reason}",
            failed.len(),
            recordings.len()
        )));
    }
    let provenance = serde_json::json!({
        "method": options.method.name(),
        "data": options.data.display().to_string(),
        "synthetic": set.synthetic,
        "recordings": recordings.len(),
        "failed": failed.len(),
        "with_container": samples.iter().filter(|s| s.vote.is_some()).count(),
        "containers": containers,
        "seed": options.seed,
    });
    let model = CapacityModel::fit(&samples, fused, provenance)?;
    let held_out = fused.then(|| model::held_out(&samples));
    Ok(Learned { model, held_out, recordings: recordings.len(), failed })
}

/// The training recordings.
pub(crate) fn training(set: &DataSet) -> Vec<Recording> {
    set.recordings.iter().filter(|r| r.part == Subset::Training).cloned().collect()
}

/// Container and capacity in mL, where both are known.
fn labelled(set: &DataSet, recording: &Recording) -> Option<(Container, f64)> {
    let annotated = set.annotation(recording).map(|a| a.capacity_ml).filter(|c| *c > 0.0);
    let container = recording.container?;
    Some((container, annotated.or(container.capacity_ml())?))
}

/// What a training recording teaches; `None` where its container or capacity is not known.
fn sample(
    set: &DataSet,
    recording: &Recording,
    options: &CapacityOptions,
) -> std::result::Result<Option<Sample>, Problem> {
    let Some((container, capacity)) = labelled(set, recording) else { return Ok(None) };
    let views = Views::of(recording, options.detections.as_deref());
    let detections = methods::table(&views)?;
    let estimates = match options.method {
        Method::Fused => methods::geometry(&views, &detections, options.seed)?.estimates,
        _ => Default::default(),
    };
    Ok(Some(Sample {
        container: container.number(),
        category: container.category(),
        capacity,
        vote: methods::vote(&detections, options.seed).ok(),
        estimates,
    }))
}

/// How a recording is named in tables: by container and sequence where they are known.
pub(crate) fn key(recording: &Recording) -> RowKey {
    match (recording.container, recording.sequence, recording.id) {
        (Some(container), Some(sequence), _) => RowKey::Sequence(container.number(), sequence),
        (_, _, id) => RowKey::Id(id.unwrap_or_default()),
    }
}
