//! What M2's network learns from: regions of interest with the capacities of their containers.

use std::sync::atomic::AtomicBool;

use corsmal_vision::region::Region;
use serde_json::{Value, json};

use super::problem::Problem;
use super::views::Views;
use super::{CapacityOptions, each, key, labelled, methods, require_own_tables, training};
use crate::dataset::DataSet;
use crate::error::{CcmError, Result};
use crate::submission::RowKey;

/// The region of a training recording.
#[derive(Clone, Debug)]
pub struct LabelledRegion {
    /// Number of the container.
    pub container: u8,
    /// Capacity in mL.
    pub capacity: f64,
    /// The region.
    pub region: Region,
}

/// The regions of a data set's training recordings.
#[derive(Debug)]
pub struct Regions {
    /// One for each recording whose region was found and whose capacity is known, in the data set's order.
    pub regions: Vec<LabelledRegion>,
    /// What they were taken from, and a hash of them and their capacities.
    pub provenance: Value,
    /// Training recordings.
    pub recordings: usize,
    /// Whether they are synthetic.
    pub synthetic: bool,
    /// Recordings with damaged files, and the fault.
    pub failed: Vec<(RowKey, String)>,
}

/// Finds the regions of all training recordings as M2 does. One with damaged files is left out and named.
///
/// # Errors
/// [`CcmError`] when the data set cannot be opened, has no region, or the work is stopped.
pub fn regions(
    options: &CapacityOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
    interrupted: &AtomicBool,
) -> Result<Regions> {
    let set = DataSet::open(&options.data)?;
    let recordings = training(&set);
    require_own_tables(&recordings, options.detections.as_deref())?;
    let results = each(&recordings, options.jobs, progress, interrupted, |recording| {
        let (container, capacity) = labelled(&set, recording)?;
        let views = Views::of(recording, options.detections.as_deref());
        let found = methods::m2_region(&views, options.variant);
        let region = |region| LabelledRegion { container: container.number(), capacity, region };
        Some((key(recording), found.map(region)))
    })?;
    let (mut regions, mut failed, mut missing) = (Vec::new(), Vec::new(), None);
    for (key, result) in results.into_iter().flatten() {
        match result {
            Ok(region) => regions.push(region),
            Err(Problem::Damaged(reason)) => failed.push((key, reason)),
            Err(Problem::Missing(reason)) => missing = missing.or(Some((key, reason))),
        }
    }
    if regions.is_empty() {
        let first = failed.first().or(missing.as_ref());
        let first = first.map(|(key, reason)| format!("; the first, {key}: {reason}"));
        return Err(CcmError::Request(format!(
            "none of {} training recordings has a region of interest and a known capacity{}",
            recordings.len(),
            first.unwrap_or_default()
        )));
    }
    let mut containers: Vec<u8> = regions.iter().map(|r| r.container).collect();
    containers.sort_unstable();
    containers.dedup();
    let provenance = json!({
        "method": options.method.name(),
        "data": options.data.display().to_string(),
        "synthetic": set.synthetic,
        "recordings": recordings.len(),
        "failed": failed.len(),
        "with_region": regions.len(),
        "containers": containers,
        "variant": format!("{:?}", options.variant),
        "regions_hash": hash(&regions),
    });
    let (recordings, synthetic) = (recordings.len(), set.synthetic);
    Ok(Regions { regions, provenance, recordings, synthetic, failed })
}

/// Hash of everything that is learned from.
fn hash(regions: &[LabelledRegion]) -> String {
    let mut hash = blake3::Hasher::new();
    for LabelledRegion { capacity, region, .. } in regions {
        hash.update(&capacity.to_le_bytes());
        let numbers = region.image.iter().chain(&region.size);
        let bytes: Vec<u8> = numbers.flat_map(|v| v.to_le_bytes()).collect();
        hash.update(&bytes);
    }
    hash.finalize().to_hex().to_string()
}
