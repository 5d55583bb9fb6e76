//! Features of recordings, as the front ends of networks take them.
//!
//! They come one recording after another, straight from the engine; [`extract`] keeps them in a file,
//! for work that goes over them many times and may be continued, as a benchmark does.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_ccm::{CcmError, Result};
use corsmal_extract::config::{Config, ConfigError, Preset};
use corsmal_extract::engine::{FeatureArray, Features};
use corsmal_extract::inputs::Input;
use corsmal_extract::run::{self, Quiet, RunError, RunOptions};
use corsmal_files::layout;
use corsmal_files::npz::{Compression, NpzFile};
use corsmal_files::outcome::Outcome;
use corsmal_files::shard::Shard;
use corsmal_nets::front_end::{FrontEnd, Tensor};
use corsmal_nets::networks::Definition;
use ndarray::Ix3;

use crate::error::SystemError;

/// How the input of a network comes from recordings.
///
/// # Errors
/// [`SystemError::TakesNoRecordings`].
pub fn front_end(definition: &Definition) -> std::result::Result<FrontEnd, SystemError> {
    definition
        .front_end
        .ok_or(SystemError::TakesNoRecordings { network: definition.name, takes: definition.takes })
}

/// The configuration of a front end.
///
/// # Errors
/// None in practice; presets and changes are part of the tool.
pub fn configuration(front_end: &FrontEnd) -> std::result::Result<Config, ConfigError> {
    let preset = Preset::find(front_end.preset)?;
    let changes: Vec<String> = front_end.set.iter().map(|s| s.to_string()).collect();
    Config::with_overrides(preset.toml, preset.name, &changes)
}

/// Features computed from a signal as a front end takes them.
///
/// # Errors
/// A text, where a temporary file cannot be read.
pub fn tensor(features: Features) -> std::result::Result<Tensor, String> {
    match features {
        Features::Summary(values) => Ok(Tensor::vector(values)),
        Features::Frames(arrays) => {
            let Some(array) = arrays.into_iter().next() else { return Ok(Tensor::default()) };
            let FeatureArray { coefficients, frames, values, .. } = array;
            let values = values.into_vec().map_err(|e| e.to_string())?;
            let channels = values.len() / (coefficients * frames).max(1);
            Ok(Tensor { channels, coefficients, frames, values })
        }
    }
}

/// The label columns of recordings, by name.
pub fn labels(inputs: &[&Input]) -> Vec<(String, Vec<String>)> {
    let names = inputs.first().into_iter().flat_map(|input| &input.labels);
    let column = |(at, (name, _)): (usize, &(String, String))| {
        let value = |input: &&Input| input.labels.get(at).map_or(String::new(), |l| l.1.clone());
        (name.clone(), inputs.iter().map(value).collect())
    };
    names.enumerate().map(column).collect()
}

/// Features of recordings in a file that is made where it is not there yet.
pub struct Kept {
    npz: NpzFile,
    rows: Option<corsmal_files::table::Table>,
    /// What became of each recording.
    outcomes: Vec<Outcome>,
}

/// Extracts the features of `inputs` into `path`, or takes them from there.
///
/// # Errors
/// [`CcmError::Interrupted`]; [`CcmError::Request`] where the file cannot be written or read.
pub fn extract(
    inputs: &[Input],
    config: &Arc<Config>,
    path: &Path,
    jobs: usize,
    stop: &Arc<AtomicBool>,
) -> Result<Kept> {
    let fault = |e: &dyn std::fmt::Display| CcmError::Request(e.to_string());
    let extract = |overwrite: bool| {
        let options = RunOptions {
            out: path.to_path_buf(),
            work: None,
            partition_by: None,
            compression: Compression::Stored,
            jobs,
            shard: Shard::default(),
            resume: !overwrite,
            overwrite,
            max_errors: None,
        };
        run::run(inputs, config, &options, &Quiet, stop)
    };
    let report = match extract(false) {
        // Kept features of other recordings, or of an earlier version, are of no use.
        Err(RunError::Exists { .. } | RunError::Ledger(_)) => extract(true),
        done => done,
    };
    let report = match report {
        Err(RunError::Interrupted) => return Err(CcmError::Interrupted),
        report => report.map_err(|e| fault(&e))?,
    };
    let mut npz = NpzFile::open(path).map_err(|e| fault(&e))?;
    let rows = match config.summary {
        Some(_) => Some(layout::read_table(&mut npz).map_err(|e| fault(&e))?.0),
        None => None,
    };
    Ok(Kept { npz, rows, outcomes: report.outcomes })
}

impl Kept {
    /// The first recording without features, if there is one.
    ///
    /// # Errors
    /// [`CcmError::Request`] names it and says why.
    pub fn require_all(&self) -> Result<()> {
        let mut failed = self.outcomes.iter().filter(|o| !o.status.has_features());
        match failed.next() {
            None => Ok(()),
            Some(first) => Err(CcmError::Request(format!(
                "{}: {}: {} ({} recordings have no features)",
                first.path,
                first.status,
                first.reason,
                1 + failed.count()
            ))),
        }
    }

    /// The features of a recording by its id.
    ///
    /// # Errors
    /// [`CcmError::Request`] where there are none.
    pub fn tensor(&mut self, id: &str) -> Result<Tensor> {
        let fault = |e: &dyn std::fmt::Display| CcmError::Request(e.to_string());
        if let Some(table) = &self.rows {
            let row = table.ids().iter().position(|other| other == id);
            let row = row.ok_or_else(|| fault(&format!("{id}: has no features")))?;
            return Ok(Tensor::vector(table.values().row(row).to_vec()));
        }
        let array = self.npz.f32(&layout::frames_name(id, None)).map_err(|e| fault(&e))?;
        let array = array.into_dimensionality::<Ix3>().map_err(|e| fault(&format!("{id}: {e}")))?;
        let (channels, coefficients, frames) = array.dim();
        // Frames outermost, channels innermost: as they lie in the file.
        let values = array.reversed_axes().as_standard_layout().iter().copied().collect();
        Ok(Tensor { channels, coefficients, frames, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use corsmal_nets::networks::NETWORKS;

    #[test]
    fn every_front_end_has_its_configuration() {
        for front_end in NETWORKS.iter().filter_map(|d| d.front_end) {
            let config = configuration(&front_end).unwrap();
            assert_eq!(config.features.len(), 1, "{}", front_end.preset);
        }
    }

    /// Times of windows are computed from it.
    #[test]
    fn the_hop_of_windows_is_that_of_the_preset() {
        let mut checked = 0;
        for front_end in NETWORKS.iter().filter_map(|d| d.front_end) {
            let config = configuration(&front_end).unwrap().to_value();
            let rate = config["signal"]["sample_rate"].as_f64().unwrap();
            let hop = config["features"]["melspectrogram"]["hop_length"].as_f64();
            if let (Some(hop), Some(windows)) = (hop, front_end.windows) {
                assert_eq!(windows.hop, hop / rate, "{}", front_end.preset);
                checked += 1;
            }
        }
        assert_eq!(checked, 1, "mel-cnn");
    }
}
