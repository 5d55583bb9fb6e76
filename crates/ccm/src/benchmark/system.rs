//! Systems of the paper that other crates bring, such as networks: what they are given and how they
//! are run. Whole containers are held out, and labels of test recordings are never shown.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::matrix::inputs;
use super::names::file_name;
use super::protocols::container_folds;
use super::results::{Estimate, Rows};
use crate::capacity::Views;
use crate::dataset::{DataSet, Filling, SequenceName};
use crate::error::{CcmError, Result};
use crate::paper;
use corsmal_extract::inputs::Input;

/// A recording as a system sees it.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The file, uncropped, with its id.
    pub input: Input,
    /// Number of the container, where known.
    pub container: Option<u8>,
    /// Settings and filling in the name, where known.
    pub name: Option<SequenceName>,
    /// Type and level; of training recordings only.
    pub filling: Option<Filling>,
    /// Seconds in which something is poured or shaken; `Some(None)` where nothing is.
    pub action: Option<Option<(f64, f64)>>,
    /// The files of its views.
    pub views: Views,
}

/// What a system works on.
pub struct Work<'a> {
    /// Training recordings, then those of the test parts.
    pub subjects: Vec<Subject>,
    /// How many of them are for training.
    pub training: usize,
    /// Folder in which features may be kept.
    pub features: PathBuf,
    /// Recordings that are extracted at a time.
    pub jobs: usize,
    /// Seed of what the published recipes leave to chance.
    pub seed: u64,
    /// Told each step.
    pub progress: &'a dyn Fn(&str),
    /// Set when the work is to end.
    pub stop: &'a Arc<AtomicBool>,
}

/// A system of the paper.
pub trait System {
    /// Its name in the paper's tables.
    fn name(&self) -> &'static str;

    /// Gets ready: features of all recordings.
    ///
    /// # Errors
    /// Recordings that it cannot take, inputs that are not there.
    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>>;
}

/// A system that has its features.
pub trait Prepared {
    /// What it hears and sees, joined by `+`. A system that answers by several inputs, each alone, has as
    /// many rows in the tables.
    fn inputs(&self) -> Vec<String> {
        vec!["audio".into()]
    }

    /// What differs from the published system, in sentences.
    fn notes(&self) -> Vec<String>;

    /// Estimates of the `wanted` subjects in their order, after training on the subjects `train`: a list for
    /// each of [`Prepared::inputs`].
    ///
    /// # Errors
    /// A training that fails or is interrupted.
    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>>;
}

/// What a system predicted by one kind of inputs.
pub(super) struct Run {
    /// Name of the system.
    pub(super) system: &'static str,
    /// Name in the tables: that of the system, and the inputs where it has several.
    pub(super) name: String,
    /// Name of its files.
    pub(super) slug: String,
    pub(super) inputs: String,
    pub(super) notes: Vec<String>,
    /// Training recordings, each by networks that never heard its container.
    pub(super) held_out: Vec<(usize, Estimate)>,
    /// Test parts, by networks trained on all training recordings.
    pub(super) tests: Vec<Vec<Estimate>>,
}

impl Run {
    /// Why the tables have no row of it, where it answers for no recording.
    fn silent(&self) -> Option<String> {
        let mut all = self.held_out.iter().map(|(_, e)| e).chain(self.tests.iter().flatten());
        let answers = |e: &Estimate| e.level.is_some() || e.kind.is_some();
        (!all.any(answers)).then(|| {
            format!("{}: no prediction for any recording, so the tables have no row", self.name)
        })
    }
}

impl<'a> Work<'a> {
    pub(super) fn new(
        set: &DataSet,
        rows: &Rows,
        features: &Path,
        detections: Option<&Path>,
        (jobs, seed): (usize, u64),
        progress: &'a dyn Fn(&str),
        stop: &'a Arc<AtomicBool>,
    ) -> Result<Self> {
        let actions = set.actions()?;
        let none = crate::dataset::Actions::new();
        let parts = std::iter::once((&rows.training, true))
            .chain(rows.tests.iter().map(|test| (&test.rows, false)));
        let mut subjects = Vec::new();
        for (targets, training) in parts {
            for (mut input, target) in inputs(&set.root, targets, &none).into_iter().zip(targets) {
                input.labels.clear();
                let recording = &target.recording;
                let key = recording.container.zip(recording.name);
                subjects.push(Subject {
                    input,
                    container: recording.container.map(|c| c.number()),
                    name: recording.name.filter(|_| training),
                    filling: target.filling.filter(|_| training),
                    action: key.filter(|_| training).and_then(|k| actions.get(&k).copied()),
                    views: Views::of(recording, detections),
                });
            }
        }
        let features = features.to_path_buf();
        let training = rows.training.len();
        Ok(Self { subjects, training, features, jobs, seed, progress, stop })
    }

    /// Fails once the work is to end.
    ///
    /// # Errors
    /// [`CcmError::Interrupted`].
    pub fn go_on(&self) -> Result<()> {
        if self.stop.load(Ordering::Relaxed) { Err(CcmError::Interrupted) } else { Ok(()) }
    }
}

/// Holds out containers in three folds; test parts are predicted after training on everything. The runs are
/// those by each of its inputs.
pub(super) fn run(system: &dyn System, work: &Work<'_>, rows: &Rows) -> Result<Vec<Run>> {
    let name = system.name();
    let fault = |e: corsmal_models::ModelError| CcmError::Request(format!("{name}: {e}"));
    (work.progress)(&format!("{name}: features"));
    let prepared = system.prepare(work)?;
    let inputs = prepared.inputs();
    let several = inputs.len() > 1;
    let of_inputs = |inputs: String| Run {
        system: name,
        name: if several { paper::named(name, &inputs) } else { name.into() },
        slug: file_name(&if several { format!("{name} {inputs}") } else { name.into() }),
        inputs,
        notes: Vec::new(),
        held_out: Vec::with_capacity(work.training),
        tests: Vec::with_capacity(rows.tests.len()),
    };
    let mut runs: Vec<Run> = inputs.into_iter().map(of_inputs).collect();
    let folds = container_folds(&rows.training).map_err(fault)?;
    for (number, fold) in folds.iter().enumerate() {
        work.go_on()?;
        (work.progress)(&format!("{name}: fold {} of {}", number + 1, folds.len()));
        let found = prepared.predict(&fold.train, &fold.test);
        let found = found.map_err(|error| match error {
            CcmError::Request(reason) => CcmError::Request(format!(
                "{reason} (fold {} of {}, trained on {} recordings)",
                number + 1,
                folds.len(),
                fold.train.len()
            )),
            other => other,
        })?;
        for (run, found) in runs.iter_mut().zip(found) {
            run.held_out.extend(fold.test.iter().copied().zip(found));
        }
    }
    runs.iter_mut().for_each(|run| run.held_out.sort_by_key(|(row, _)| *row));
    if !rows.tests.is_empty() {
        work.go_on()?;
        (work.progress)(&format!("{name}: all training recordings"));
        let all: Vec<usize> = (0..work.training).collect();
        let wanted: Vec<usize> = (work.training..work.subjects.len()).collect();
        let found = prepared.predict(&all, &wanted)?;
        for (run, found) in runs.iter_mut().zip(found) {
            let mut found = found.into_iter();
            let parts = rows.tests.iter();
            run.tests.extend(parts.map(|t| found.by_ref().take(t.rows.len()).collect()));
        }
    }
    // What is to be said is said once.
    if let Some(first) = runs.first_mut() {
        first.notes = prepared.notes();
    }
    for run in &mut runs {
        if let Some(silent) = run.silent() {
            (work.progress)(&silent);
            run.notes.push(silent);
        }
    }
    Ok(runs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_without_any_answer_is_told() {
        let mut run = Run {
            system: "mask-rn",
            name: "Mask + RN".into(),
            slug: "mask-rn".into(),
            inputs: String::new(),
            notes: Vec::new(),
            held_out: vec![(0, Estimate::default()), (1, Estimate::default())],
            tests: vec![vec![Estimate::default()]],
        };
        assert!(run.silent().unwrap().starts_with("Mask + RN: no prediction"));
        run.tests[0][0].level = Some(0);
        assert_eq!(run.silent(), None);
    }
}
