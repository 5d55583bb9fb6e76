//! Feature matrices of a data set: outputs of `extract`, kept below `features/`.
//!
//! `features/<set>-<configuration>-<part>.npz` is used again when it holds the same recordings by the
//! same configuration, continued where a run was interrupted, and replaced otherwise. Label columns
//! make it a training file for `train` and `cross-validate`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_extract::config::Config;
use corsmal_extract::inputs::{Input, InputSource};
use corsmal_extract::run::{self, Quiet, RunError};
use corsmal_files::layout;
use corsmal_files::npz::{Compression, NpzFile};
use corsmal_files::shard::Shard;
use corsmal_models::model_file::TrainedOn;
use ndarray::Array2;

use super::features::FeatureSet;
use super::results::{Rows, Target};
use crate::dataset::{Actions, DataSet, Filling};
use crate::error::{CcmError, Result};

/// Features of the training recordings and of each test part, `[recordings, values]`.
pub(super) struct Matrices {
    pub(super) training: Array2<f64>,
    pub(super) tests: Vec<Array2<f64>>,
    /// Name of each value.
    pub(super) names: Vec<String>,
    /// By which they were computed.
    pub(super) config: Arc<Config>,
    /// Formats of the training recordings.
    pub(super) trained_on: Option<TrainedOn>,
}

/// Where features are kept and how they are computed.
pub(super) struct Store<'a> {
    pub(super) folder: PathBuf,
    pub(super) jobs: usize,
    pub(super) stop: &'a Arc<AtomicBool>,
}

impl Store<'_> {
    /// The features of every part, computed where they are not there yet.
    pub(super) fn load(
        &self,
        set: &DataSet,
        rows: &Rows,
        features: FeatureSet,
    ) -> Result<Matrices> {
        let config = features.config().map_err(|e| CcmError::Request(e.to_string()))?;
        let config = Arc::new(config);
        let actions = if features.cropped() { set.actions()? } else { Actions::new() };
        let name = |part: &str| {
            format!("{}-{:.12}-{}.npz", features.slug(), config.hash(), part.replace(' ', "-"))
        };
        let training = inputs(&set.root, &rows.training, &actions);
        let (training, names, trained_on) = self.part(&name("training"), &training, &config)?;
        let mut tests = Vec::with_capacity(rows.tests.len());
        for test in &rows.tests {
            let inputs = inputs(&set.root, &test.rows, &Actions::new());
            let (values, own, _) = self.part(&name(test.subset.name()), &inputs, &config)?;
            if own != names {
                return Err(CcmError::Request(format!(
                    "{}: {} recordings have other features than those of training: another number \
                     of channels?",
                    set.root.display(),
                    test.subset.name()
                )));
            }
            tests.push(values);
        }
        Ok(Matrices { training, tests, names, config, trained_on })
    }

    fn part(
        &self,
        name: &str,
        inputs: &[Input],
        config: &Arc<Config>,
    ) -> Result<(Array2<f64>, Vec<String>, Option<TrainedOn>)> {
        let path = self.folder.join(name);
        let fault = |e: &dyn std::fmt::Display| CcmError::Request(e.to_string());
        let extract = |overwrite: bool| {
            let options = run::RunOptions {
                out: path.clone(),
                work: None,
                partition_by: None,
                compression: Compression::Stored,
                jobs: self.jobs,
                shard: Shard::default(),
                resume: !overwrite,
                overwrite,
                max_errors: None,
            };
            run::run(inputs, config, &options, &Quiet, self.stop)
        };
        let report = match extract(false) {
            Err(RunError::Interrupted) => return Err(CcmError::Interrupted),
            // Kept features of other recordings, or of an earlier version, are of no use.
            Err(RunError::Exists { .. } | RunError::Ledger(_)) => extract(true),
            done => done,
        };
        let report = match report {
            Err(RunError::Interrupted) => return Err(CcmError::Interrupted),
            report => report.map_err(|e| fault(&e))?,
        };
        if let Some(bad) = report.outcomes.iter().find(|o| !o.status.has_features()) {
            return Err(CcmError::Request(format!(
                "{}: {}: {} ({} recordings have no features)",
                bad.path,
                bad.status,
                bad.reason,
                report.failed()
            )));
        }
        let mut npz = NpzFile::open(&path).map_err(|e| fault(&e))?;
        let (table, _) = layout::read_table(&mut npz).map_err(|e| fault(&e))?;
        let trained_on =
            TrainedOn::of(table.outcomes().iter().map(|o| (o.sample_rate, o.channels)));
        Ok((table.values().mapv(f64::from), table.feature_names().to_vec(), trained_on))
    }
}

/// Recordings with their labels, cropped to their action where one is annotated.
pub(super) fn inputs(root: &Path, targets: &[Target], actions: &Actions) -> Vec<Input> {
    let input = |target: &Target| {
        let recording = &target.recording;
        let action = recording.container.zip(recording.name).and_then(|k| actions.get(&k).copied());
        // An annotation beyond the end leaves nothing: then the whole recording counts.
        let crop = action.flatten().filter(|&(start, _)| begins_inside(&recording.path, start));
        let relative = recording.path.strip_prefix(root).unwrap_or(&recording.path);
        let text = |value: Option<String>| value.unwrap_or_default();
        let filling = target.filling;
        let labels = [
            ("container", text(recording.container.map(|c| c.number().to_string()))),
            ("scenario", text(recording.name.map(|n| n.scenario.to_string()))),
            ("type", text(filling.map(|f| f.kind().name().to_string()))),
            ("level", text(filling.map(|f| f.level().name().to_string()))),
            ("joint", text(filling.map(Filling::name))),
        ];
        Input {
            id: relative.with_extension("").to_string_lossy().replace('\\', "/"),
            source: InputSource::File(recording.path.clone()),
            start: crop.map(|(start, _)| start),
            end: crop.map(|(_, end)| end),
            labels: labels.map(|(name, value)| (name.to_string(), value)).to_vec(),
        }
    };
    targets.iter().map(input).collect()
}

/// Whether a second lies in a recording; what cannot be read is for the extraction to tell.
fn begins_inside(path: &Path, start: f64) -> bool {
    corsmal_audio::open(path).is_ok_and(|source| {
        let spec = source.spec();
        let seconds = |frames: u64| frames as f64 / f64::from(spec.sample_rate);
        spec.declared_frames.is_none_or(|frames| start < seconds(frames))
    })
}
