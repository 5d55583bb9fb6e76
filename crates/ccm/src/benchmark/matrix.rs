//! Feature matrices of a data set: outputs of `extract`, kept below `features/`.
//!
//! `features/<set>-<configuration>-<part>.npz` is used again when it holds the same recordings by the
//! same configuration, continued where a run was interrupted, and replaced otherwise. Label columns
//! make it a training file for `train` and `cross-validate`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_extract::config::{Config, ConfigError};
use corsmal_extract::inputs::{Input, InputSource};
use corsmal_extract::run::{self, Begun, RunError, RunReport};
use corsmal_files::layout;
use corsmal_files::npz::{Compression, NpzFile};
use corsmal_files::shard::Shard;
use corsmal_models::model_file::TrainedOn;
use ndarray::Array2;

use super::features::FeatureSet;
use super::remaining::Told;
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
    pub(super) progress: &'a (dyn Fn(&str) + Sync),
    pub(super) stop: &'a Arc<AtomicBool>,
}

/// Features of a part by one set.
struct Part {
    values: Array2<f64>,
    names: Vec<String>,
    trained_on: Option<TrainedOn>,
}

/// A file of features: where it is, of what, and by which configuration.
struct Kept {
    path: PathBuf,
    inputs: Vec<Input>,
    config: Arc<Config>,
}

impl Store<'_> {
    /// The features of every part by each of `sets`, computed where they are not there yet. A recording is read
    /// once for all sets.
    pub(super) fn load(
        &self,
        set: &DataSet,
        rows: &Rows,
        sets: &[FeatureSet],
    ) -> Result<Vec<Matrices>> {
        let fault = |e: ConfigError| CcmError::Request(e.to_string());
        let configs: Vec<Arc<Config>> =
            sets.iter().map(|s| s.config().map(Arc::new).map_err(fault)).collect::<Result<_>>()?;
        let kept = |part: &str, targets: &[Target], actions: &Actions| -> Vec<Kept> {
            let none = Actions::new();
            let each = sets.iter().zip(&configs).map(|(features, config)| {
                let actions = if features.cropped() { actions } else { &none };
                let (slug, hash, part) = (features.slug(), config.hash(), part.replace(' ', "-"));
                Kept {
                    path: self.folder.join(format!("{slug}-{hash:.12}-{part}.npz")),
                    inputs: inputs(&set.root, targets, actions),
                    config: config.clone(),
                }
            });
            each.collect()
        };
        let cropped = sets.iter().any(|features| features.cropped());
        let actions = if cropped { set.actions()? } else { Actions::new() };
        let all = rows.training.len() + rows.tests.iter().map(|t| t.rows.len()).sum::<usize>();
        let told = Told::new(all, self.progress);
        let training = self.parts(&kept("training", &rows.training, &actions), &told)?;
        let matrices = configs.iter().cloned().zip(training).map(|(config, part)| Matrices {
            training: part.values,
            tests: Vec::with_capacity(rows.tests.len()),
            names: part.names,
            config,
            trained_on: part.trained_on,
        });
        let mut matrices: Vec<Matrices> = matrices.collect();
        for test in &rows.tests {
            let part = kept(test.subset.name(), &test.rows, &Actions::new());
            for (matrices, part) in matrices.iter_mut().zip(self.parts(&part, &told)?) {
                if part.names != matrices.names {
                    return Err(CcmError::Request(format!(
                        "{}: {} recordings have other features than those of training: another \
                         number of channels?",
                        set.root.display(),
                        test.subset.name()
                    )));
                }
                matrices.tests.push(part.values);
            }
        }
        Ok(matrices)
    }

    /// The features of one part by each set.
    fn parts(&self, kept: &[Kept], told: &Told<'_>) -> Result<Vec<Part>> {
        let fault = |error: RunError| match error {
            RunError::Interrupted => CcmError::Interrupted,
            error => CcmError::Request(error.to_string()),
        };
        let options = |overwrite: bool| {
            let of = |kept: &Kept| run::RunOptions {
                out: kept.path.clone(),
                work: None,
                partition_by: None,
                compression: Compression::Stored,
                jobs: self.jobs,
                shard: Shard::default(),
                resume: !overwrite,
                overwrite,
                max_errors: None,
            };
            kept.iter().map(of).collect::<Vec<_>>()
        };
        let (keep, replace) = (options(false), options(true));
        let mut begun = Vec::with_capacity(kept.len());
        for (Kept { inputs, config, .. }, (keep, replace)) in
            kept.iter().zip(keep.iter().zip(&replace))
        {
            let begin = |options| Begun::new(inputs, config, options, told, self.stop);
            begun.push(match begin(keep) {
                // Kept features of other recordings, or of an earlier version, are of no use.
                Err(RunError::Exists { .. } | RunError::Ledger(_)) => {
                    begin(replace).map_err(fault)?
                }
                begun => begun.map_err(fault)?,
            });
        }
        let reports = run::together(begun, self.jobs, told, self.stop).map_err(fault)?;
        told.part(kept.first().map_or(0, |kept| kept.inputs.len()));
        kept.iter().zip(reports).map(|(kept, report)| kept.read(&report)).collect()
    }
}

impl Kept {
    /// The features, once they are there.
    fn read(&self, report: &RunReport) -> Result<Part> {
        let fault = |e: &dyn std::fmt::Display| CcmError::Request(e.to_string());
        if let Some(bad) = report.outcomes.iter().find(|o| !o.status.has_features()) {
            return Err(CcmError::Request(format!(
                "{}: {}: {} ({} recordings have no features)",
                bad.path,
                bad.status,
                bad.reason,
                report.failed()
            )));
        }
        let mut npz = NpzFile::open(&self.path).map_err(|e| fault(&e))?;
        let (table, _) = layout::read_table(&mut npz).map_err(|e| fault(&e))?;
        let trained_on = TrainedOn::of_outcomes(table.outcomes());
        let names = table.feature_names().to_vec();
        Ok(Part { values: table.values().mapv(f64::from), names, trained_on })
    }
}

/// How many training recordings have no annotation of their action, or one after their end, in words.
pub(super) fn uncropped(training: &[Target], actions: &Actions) -> Vec<String> {
    let action = |target: &&Target| {
        let key = target.recording.container.zip(target.recording.name);
        key.and_then(|key| actions.get(&key).copied())
    };
    let is_beyond = |target: &&Target| {
        action(target)
            .flatten()
            .is_some_and(|(start, _)| !begins_inside(&target.recording.path, start))
    };
    let lacking = training.iter().filter(|target| action(target).is_none()).count();
    let (beyond, all) = (training.iter().filter(is_beyond).count(), training.len());
    let told = |number: usize, what: &str| {
        (number > 0).then(|| {
            format!(
                "{number} of {all} training recordings have {what} (man_annotations.csv): the spectrogram baselines \
                 train on the whole recording, those of the paper on the action."
            )
        })
    };
    let beyond = told(beyond, "an annotated action that begins after their end, in seconds");
    told(lacking, "no annotated action").into_iter().chain(beyond).collect()
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
