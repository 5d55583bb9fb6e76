//! Submissions, models and pictures beside the report.

use std::collections::BTreeMap;
use std::fs::{DirEntry, Metadata};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use corsmal_models::labels::Labels;
use corsmal_models::model_file::{Model, ModelHeader};
use corsmal_models::pipeline::{Pipeline, PipelineSpec};

use super::baselines::BaselineResult;
use super::matrix::Matrices;
use super::method::methods;
use super::predicted::Predicted;
use super::results::{Estimate, Rows, Target};
use super::system::Run;
use crate::dataset::{Filling, Subset};
use crate::error::{CcmError, Result};
use crate::submission::{Format, RowKey, Submission, pseudo_random};

/// Files of a run before, with the time at which each was written.
pub(super) struct Earlier(BTreeMap<PathBuf, SystemTime>);

/// Folders of results.
const RESULTS: [&str; 4] = ["submissions", "models", "figures", "tables"];

/// Makes the folders, so that a wrong path fails before the work, and notes what is in them.
pub(super) fn prepare(out: &Path) -> Result<Earlier> {
    for folder in ["features", "submissions", "models", "figures"] {
        let path = out.join(folder);
        std::fs::create_dir_all(&path).map_err(|e| CcmError::io(&path, e))?;
    }
    Ok(Earlier::of(out))
}

impl Earlier {
    fn of(out: &Path) -> Self {
        let folders = RESULTS.iter().filter_map(|folder| out.join(folder).read_dir().ok());
        let written = |file: DirEntry| {
            let about = file.metadata().ok().filter(Metadata::is_file)?;
            Some((file.path(), about.modified().ok()?))
        };
        Self(folders.flatten().flatten().filter_map(written).collect())
    }

    /// Says which of them this run has not written, as names below the output folder.
    pub(super) fn caution(&self, out: &Path) -> Option<String> {
        let now = Self::of(out);
        let same = |(path, written): &(&PathBuf, &SystemTime)| now.0.get(*path) == Some(*written);
        let left =
            self.0.iter().filter(same).map(|(path, _)| path.strip_prefix(out).unwrap_or(path));
        let left: Vec<String> = left.map(|path| path.display().to_string()).collect();
        let named = left.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ");
        match left.len() {
            0 => None,
            1 => Some(format!("1 file is not of this run: {named}")),
            count @ 2..=NAMED => Some(format!("{count} files are not of this run: {named}")),
            count => Some(format!("{count} files are not of this run: {named}, …")),
        }
    }
}

/// Most files that are named.
const NAMED: usize = 10;

/// Writes the submissions of a baseline.
pub(super) fn write_outcome(out: &Path, outcome: &BaselineResult, rows: &Rows) -> Result<()> {
    write_estimates(out, &name_of(outcome), rows, &outcome.held_out, &outcome.tests)
}

fn name_of(outcome: &BaselineResult) -> String {
    format!("{}-{}", outcome.baseline.slug(), outcome.variant.name())
}

/// Writes the model of a baseline, a pipeline and what it is.
pub(super) fn write_model(
    out: &Path,
    outcome: &BaselineResult,
    (spec, pipeline): (PipelineSpec, Pipeline),
    matrices: &Matrices,
    rows: &Rows,
) -> Result<()> {
    // Published PCA is fitted on what it reduces, so that there is no projection for recordings to
    // come.
    if pipeline.n_features() != matrices.names.len() {
        return Ok(());
    }
    let name = name_of(outcome);
    let fault = |e: &dyn std::fmt::Display| CcmError::Request(format!("model {name}: {e}"));
    let labels = Labels::new(Filling::all().map(Filling::name).collect()).map_err(|e| fault(&e))?;
    let header = ModelHeader {
        pipeline: spec,
        labels,
        target: "joint".into(),
        feature_names: matrices.names.clone(),
        feature_config: matrices.config.to_value(),
        feature_config_hash: matrices.config.hash(),
        provenance: serde_json::json!({
            "baseline": outcome.baseline.name(),
            "variant": outcome.variant.name(),
            "training_recordings": rows.training.len(),
        }),
        trained_on: matrices.trained_on.clone(),
        tool_version: env!("CARGO_PKG_VERSION").into(),
    };
    let model = Model::new(header, pipeline).map_err(|e| fault(&e))?;
    let path = out.join("models").join(format!("{name}.model"));
    model.save(&path).map_err(|e| fault(&e))
}

/// Writes the submissions of a system.
pub(super) fn write_run(out: &Path, run: &Run, rows: &Rows) -> Result<()> {
    write_estimates(out, &run.slug, rows, &run.held_out, &run.tests)
}

/// Writes the submissions of all methods that a table of capacities completes.
pub(super) fn write_completed(
    out: &Path,
    rows: &Rows,
    predicted: &Predicted<'_>,
    seed: u64,
) -> Result<()> {
    for method in methods(rows, predicted, seed).iter().filter(|m| m.completes()) {
        let Some(slug) = &method.slug else { continue };
        if !method.training().is_empty() {
            let held_out = method.training().iter().map(|(row, e)| (&rows.training[*row], e));
            let name = format!("{slug}-held-out");
            write_submissions(out, &name, &held_out.collect::<Vec<_>>())?;
        }
        for (part, estimates) in rows.tests.iter().zip(method.tests()) {
            let Some(estimates) = estimates else { continue };
            let pairs: Vec<_> = part.rows.iter().zip(estimates).collect();
            write_submissions(out, &format!("{slug}-{}", part.subset.slug()), &pairs)?;
        }
    }
    Ok(())
}

/// Writes estimates of held-out training recordings and of each test part.
fn write_estimates(
    out: &Path,
    name: &str,
    rows: &Rows,
    held_out: &[(usize, Estimate)],
    tests: &[Vec<Estimate>],
) -> Result<()> {
    let held_out = held_out.iter().map(|(row, e)| (&rows.training[*row], e));
    write_submissions(out, &format!("{name}-held-out"), &held_out.collect::<Vec<_>>())?;
    for (part, estimates) in rows.tests.iter().zip(tests) {
        let pairs: Vec<_> = part.rows.iter().zip(estimates).collect();
        write_submissions(out, &format!("{name}-{}", part.subset.slug()), &pairs)?;
    }
    Ok(())
}

/// Writes the pseudo-random estimates of every part as submissions.
pub(super) fn write_random(out: &Path, rows: &Rows, seed: u64) -> Result<()> {
    let parts = rows.tests.iter().map(|t| (t.subset, &t.rows));
    for (part, targets) in parts.chain([(Subset::Training, &rows.training)]) {
        let keys: Vec<_> = targets.iter().map(|t| t.key).collect();
        let estimates: Vec<_> =
            pseudo_random(&keys, seed).into_iter().map(Estimate::from).collect();
        let pairs: Vec<_> = targets.iter().zip(&estimates).collect();
        write_submissions(out, &format!("random-{}", part.slug()), &pairs)?;
    }
    Ok(())
}

/// Writes estimates in every official format that can name the recordings: of 2020 by container and
/// sequence, of 2022, with class probabilities, by id.
fn write_submissions(out: &Path, name: &str, pairs: &[(&Target, &Estimate)]) -> Result<()> {
    let key = |format: Format, t: &Target| match format {
        Format::Y2020 => matches!(t.key, RowKey::Sequence(..)).then_some(t.key),
        Format::Y2022 => t.recording.id.map(RowKey::Id),
    };
    for (format, suffix) in [(Format::Y2020, ""), (Format::Y2022, "-2022")] {
        let keys: Option<Vec<RowKey>> = pairs.iter().map(|(t, _)| key(format, t)).collect();
        let Some(mut keys) = keys else { continue };
        let predictions: Vec<_> =
            keys.iter().zip(pairs).map(|(key, (_, e))| e.prediction(*key)).collect();
        // By container and sequence, or by id, ascending: official scripts pair rows by position.
        keys.sort_unstable();
        let path = out.join("submissions").join(format!("{name}{suffix}.csv"));
        Submission::write(&path, format, &predictions, &keys)?;
    }
    Ok(())
}
