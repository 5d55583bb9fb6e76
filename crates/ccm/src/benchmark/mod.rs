//! The benchmark: the twelve audio baselines of the paper on a CCM data set, as their published
//! code runs them and corrected, and the paper's systems that other crates bring; scored and put
//! beside the paper's figures.

mod added;
mod baselines;
mod features;
mod files;
mod interval;
mod made;
mod matrix;
mod method;
mod names;
mod predicted;
mod protocols;
mod remaining;
mod report;
mod results;
mod system;

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

pub use added::Added;
pub use baselines::{Baseline, Learner, Variant};
pub use features::FeatureSet;
pub use made::Made;
pub use results::Estimate;
pub use system::{Prepared, Subject, System, Work};

use corsmal_models::pipeline::{Pipeline, PipelineSpec};
use corsmal_report::Report;
use rayon::prelude::*;

use crate::capacity::{require_own_tables, without_tables};
use crate::dataset::{Container, DataSet, Subset};
use crate::error::{CcmError, Result};
use baselines::BaselineResult;
use matrix::{Matrices, Store, uncropped};
use names::file_name;
use predicted::Predicted;
use protocols::{Setting, Unit};
use results::Rows;

/// Capacities of a method.
#[derive(Clone, Debug)]
pub struct CapacityTable {
    /// Name in the tables.
    pub name: String,
    /// A table of `corsmal-feat capacity`, or another with `fileName` and `capacity[mL]`.
    pub path: PathBuf,
    /// What a method that was run on these recordings takes, such as `rgb1+rgb2`; `None` for a table that was given.
    pub own: Option<&'static str>,
    /// Containers that its model learned from, where that is known.
    pub learned_from: Vec<u8>,
}

impl CapacityTable {
    /// What makes the training scores too good.
    fn caution(&self) -> Result<Option<String>> {
        let trained = self.learned_from.iter().copied().filter_map(Container::new);
        let methods = match self.own {
            None => crate::capacity::methods_of(&self.path, Some(Subset::Training))?,
            Some(_) => Vec::new(),
        };
        if let Some(method) = methods.into_iter().find(|method| method.learns()) {
            return Ok(Some(format!(
                "{} was made by `{}`, a trained method: if its model was trained on containers of the training \
                 part, its scores on them are too good. Scores on the test parts are not affected.",
                self.name,
                method.name()
            )));
        }
        let trained: Vec<String> = trained
            .filter(|container| container.subset() == Subset::Training)
            .map(|container| format!("C{}", container.number()))
            .collect();
        Ok((!trained.is_empty()).then(|| {
            format!(
                "The model of {} was trained on {}: its scores on them are too good. Scores on the \
                 test parts are not affected.",
                self.name,
                trained.join(", ")
            )
        }))
    }
}

/// What to run.
pub struct BenchmarkOptions {
    /// Folder of the data set.
    pub data: PathBuf,
    /// Folder for everything that is written.
    pub out: PathBuf,
    /// The baselines to run.
    pub baselines: Vec<Baseline>,
    /// The systems to run.
    pub systems: Vec<Box<dyn System>>,
    /// Prediction files of other methods that join the tables, by name.
    pub added: Vec<(String, PathBuf)>,
    /// Tables of capacities: each has its rows, and completes the baselines and systems.
    pub capacities: Vec<CapacityTable>,
    /// Folder of tables of detections, for systems that see; `None` for those beside the recordings.
    pub detections: Option<PathBuf>,
    /// Recordings that are extracted at a time, at least 1.
    pub jobs: usize,
    /// Seed of the forests and of the pseudo-random estimates.
    pub seed: u64,
    /// When and how this run was started, for the report.
    pub made: Made,
}

/// What a benchmark came to.
#[derive(Debug)]
pub struct Finished {
    /// The report.
    pub report: Report,
    /// Why systems are not in it.
    pub failed: Vec<String>,
}

/// Runs the benchmark and writes `report.html`, `report.json`, `tables/`, `figures/`,
/// `submissions/`, `models/` and `features/` below the output folder.
///
/// Baselines run side by side, on the threads of the pool. `progress` is told each step, and each
/// baseline that is done, of how many. Features already in `features/` are reused when their
/// configuration and the recordings are the same. `stop` ends the work at the next recording or
/// baseline.
///
/// # Errors
/// [`crate::CcmError`] when the data set has no labelled training recordings, when a file to add is
/// unusable or covers a part of the data set only partly, when annotation files contradict each other,
/// when a recording of a baseline cannot be read, when no system can be trained and nothing else is
/// asked for, when something cannot be written, and when stopped.
pub fn run(
    options: &BenchmarkOptions,
    progress: &(dyn Fn(&str) + Sync),
    stop: &Arc<AtomicBool>,
) -> Result<Finished> {
    require_names(options)?;
    let mut slugs = HashSet::new();
    if let Some(twice) = options.baselines.iter().find(|b| !slugs.insert(b.slug())) {
        return Err(CcmError::Request(format!("baseline {} is given twice", twice.slug())));
    }
    let mut systems = HashSet::new();
    if let Some(twice) = options.systems.iter().find(|s| !systems.insert(s.name())) {
        return Err(CcmError::Request(format!("{} is given twice", twice.name())));
    }
    let added = options
        .added
        .iter()
        .map(|(name, path)| Added::read(name, path))
        .collect::<Result<Vec<_>>>()?;
    let tables = options.capacities.iter();
    let tables: Vec<Added> =
        tables.map(|t| Added::capacities(&t.name, &t.path)).collect::<Result<_>>()?;
    let set = DataSet::open(&options.data)?;
    let rows = Rows::of(&set)?;
    require_own_tables(&set.recordings, options.detections.as_deref())?;
    let added = added.iter().map(|a| a.place(&rows)).collect::<Result<Vec<_>>>()?;
    let tables = tables.iter().zip(&options.capacities);
    let capacities =
        tables.map(|(table, of)| Ok((table.place(&rows)?, of.own))).collect::<Result<Vec<_>>>()?;
    let given = added.iter().chain(capacities.iter().map(|(table, _)| table));
    for nowhere in given.filter(|a| !a.is_any()) {
        progress(&format!("warning: {}: has no recording of this data set", nowhere.name));
    }
    let cautions = options.capacities.iter().map(CapacityTable::caution);
    let mut cautions: Vec<String> =
        cautions.filter_map(Result::transpose).collect::<Result<_>>()?;
    cautions.iter().for_each(|caution| progress(caution));
    if let Some(without) = without_tables(&set.recordings, options.detections.as_deref()) {
        progress(&format!("warning: {without}"));
        cautions.push(format!("{without}."));
    }
    if options.baselines.iter().any(|baseline| baseline.features.cropped()) {
        for caution in uncropped(&rows.training, &set.actions()?) {
            progress(&format!("warning: {caution}"));
            cautions.push(caution);
        }
    }
    for caution in rows.tests.iter().filter_map(results::TestPart::unscored) {
        progress(&format!("warning: {caution}"));
        cautions.push(caution);
    }
    let estimating = added.iter().filter(|a| a.has_capacities());
    for table in estimating.chain(capacities.iter().map(|(table, _)| table)) {
        if let Some(caution) = table.unmeasured() {
            progress(&format!("warning: {caution}"));
            cautions.push(caution);
        }
    }
    let earlier = files::prepare(&options.out)?;
    let jobs = options.jobs;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build();
    let pool = pool.map_err(|e| CcmError::Request(format!("{jobs} threads: {e}")))?;
    let outcomes = baselines(options, (&set, &rows), &pool, progress, stop)?;
    let (mut runs, mut failed) = (Vec::new(), Vec::new());
    if !options.systems.is_empty() {
        let (folder, how) = (options.out.join("features"), (options.jobs, options.seed));
        let tables = options.detections.as_deref();
        let work = Work::new(&set, &rows, &folder, tables, how, progress, stop)?;
        for system in &options.systems {
            match system::run(system.as_ref(), &work, &rows) {
                Ok(found) => {
                    for run in found {
                        files::write_run(&options.out, &run, &rows)?;
                        runs.push(run);
                    }
                }
                Err(CcmError::Request(reason)) => {
                    let name = system.name();
                    let reason = reason.strip_prefix(&format!("{name}: ")).unwrap_or(&reason);
                    progress(&format!("warning: {name} is left out: {reason}"));
                    failed.push(format!("{name}: {reason}"));
                }
                Err(error) => return Err(error),
            }
        }
    }
    let is_empty = outcomes.is_empty() && runs.is_empty() && added.is_empty();
    if let (Some(first), true) = (failed.first(), is_empty && capacities.is_empty()) {
        return Err(CcmError::Request(first.clone()));
    }
    cautions.extend(failed.iter().map(|reason| format!("Left out: {reason}.")));
    files::write_random(&options.out, &rows, options.seed)?;
    let made = &options.made;
    let predicted = Predicted {
        outcomes: &outcomes,
        runs: &runs,
        added: &added,
        capacities: &capacities,
        cautions: &cautions,
    };
    files::write_completed(&options.out, &rows, &predicted, options.seed)?;
    let seed = options.seed;
    let (more, report) = pool.install(|| {
        let report = report::report(&set, &rows, &predicted, seed, made)?;
        Ok::<_, CcmError>((report::figures(&rows, &predicted, seed)?, report))
    })?;
    report.write(&options.out, &more)?;
    if let Some(caution) = earlier.caution(&options.out) {
        progress(&format!("warning: {}: {caution}", options.out.display()));
    }
    Ok(Finished { report, failed })
}

/// Refuses names of what is added whose files would replace each other.
fn require_names(options: &BenchmarkOptions) -> Result<()> {
    let added = options.added.iter().map(|(name, _)| name.as_str());
    let capacities = options.capacities.iter().map(|table| table.name.as_str());
    let same = |name: &str, other: &str| {
        Err(CcmError::Request(match name == other {
            true => format!("{name}: given twice; names must differ"),
            false => format!(
                "{name}: its files would overwrite those of {other}; names must differ in a letter (a to z) or a digit"
            ),
        }))
    };
    let mut seen = HashMap::new();
    for name in added.clone().chain(capacities) {
        let file = file_name(name);
        if file.is_empty() {
            return Err(CcmError::Request(format!(
                "{name}: files are named after it, so it must contain a letter (a to z) or a digit"
            )));
        }
        if let Some(other) = seen.insert(file, name) {
            return same(name, other);
        }
    }
    for name in added {
        let mut systems = options.systems.iter().map(|system| system.name());
        let file = file_name(name);
        if let Some(system) = systems.find(|system| file_name(system) == file) {
            return same(name, system);
        }
    }
    Ok(())
}

/// The outcomes of all baselines, in the order of their feature sets.
fn baselines(
    options: &BenchmarkOptions,
    (set, rows): (&DataSet, &Rows),
    pool: &rayon::ThreadPool,
    progress: &(dyn Fn(&str) + Sync),
    stop: &Arc<AtomicBool>,
) -> Result<Vec<BaselineResult>> {
    let BenchmarkOptions { out, baselines, jobs, seed, .. } = options;
    let (jobs, seed) = (*jobs, *seed);
    let of = |set: FeatureSet| -> Vec<Baseline> {
        baselines.iter().filter(|b| b.features == set).copied().collect()
    };
    let sets: Vec<FeatureSet> =
        FeatureSet::ALL.into_iter().filter(|s| !of(*s).is_empty()).collect();
    if sets.is_empty() {
        return Ok(Vec::new());
    }
    let names: Vec<&str> = sets.iter().map(|features| features.name()).collect();
    progress(&format!("features: {}", names.join(", ")));
    let store = Store { folder: out.join("features"), jobs, progress, stop };
    let matrices = store.load(set, rows, &sets)?;
    let (done, total) = (AtomicUsize::new(0), baselines.len() * Variant::ALL.len());
    let finish = |matrices: &Matrices, outcome: &BaselineResult, made: (PipelineSpec, Pipeline)| {
        files::write_outcome(out, outcome, rows)?;
        files::write_model(out, outcome, made, matrices, rows)?;
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        let name = outcome.baseline.name();
        progress(&format!("{done} of {total}: {name}, {}", outcome.variant.name()));
        Ok(())
    };
    let setting = |matrices| Setting { rows, matrices, seed, stop, finish: &finish };
    // The widest tables take longest: what is short fills the gaps after them.
    let units: Vec<(Setting<'_>, Unit)> = sets
        .iter()
        .zip(&matrices)
        .rev()
        .flat_map(|(set, matrices)| {
            Unit::all(&of(*set)).into_iter().map(|u| (setting(matrices), u))
        })
        .collect();
    let made: Vec<Result<Vec<BaselineResult>>> =
        pool.install(|| units.par_iter().map(|(setting, unit)| unit.run(setting)).collect());
    let made = made.into_iter().collect::<Result<Vec<_>>>()?;
    let mut made: Vec<BaselineResult> = made.into_iter().flatten().collect();
    // As they were asked for, whatever was finished first.
    let place = |b: &Baseline| (b.features, baselines.iter().position(|other| other == b));
    made.sort_by_key(|outcome| (place(&outcome.baseline), outcome.variant));
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same model given as a table lost the caution.
    #[test]
    fn a_table_of_a_method_that_learns_is_doubted() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let caution = |rows: &str, own: Option<&'static str>| {
            let text = format!("fileName,capacity[mL],method,part\n{rows}\n");
            std::fs::write(file.path(), text).unwrap();
            let (name, path) = ("E".into(), file.path().into());
            CapacityTable { name, path, own, learned_from: Vec::new() }.caution().unwrap()
        };
        let training = "id1_0001.png,300,fused,";
        assert!(caution(training, None).unwrap().contains("E was made by `fused`, a trained"));
        for (rows, own) in [
            ("id1_0001.png,300,m5,", None),
            (training, Some("rgb1")),
            ("id10_0001.png,300,fused,", None),
            ("id000001.png,300,fused,public test", None),
        ] {
            assert_eq!(caution(rows, own), None, "{rows}");
        }
        // Whichever row says so.
        let later = format!("id10_0001.png,300,m5,\n{}", training.replace("fused", "m5+fused"));
        assert!(caution(&later, None).is_some());
        assert!(caution("id000001.png,300,fused,", None).is_some());
    }
}
