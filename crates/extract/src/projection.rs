//! A projection (principal components) fitted once on training features and then applied.
//!
//! Fitting reads a feature file and writes a projection file; extracting only ever reads one, so
//! that nothing can be fitted to the recordings that it is applied to. The file is an `.npz`:
//! `components [k, n]`, `mean [n]`, `explained_variance [k]`, `feature_names [n]` and `meta` (JSON).
//! It knows the configuration of its features and refuses any other.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use corsmal_dsp::DspError;
use corsmal_dsp::pca::Pca;
use ndarray::{ArrayD, ArrayView2, Dimension, Ix1, Ix2};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use thiserror::Error;

use crate::params::{ConfigError, typed};
use corsmal_files::draft::Draft;
use corsmal_files::feature_file::{FeatureFileError, FeatureTable};
use corsmal_files::identity;
use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, NpzError, NpzFile, NpzWriter};

/// Version of the file's members.
const VERSION: u32 = 1;

/// Why a projection could not be fitted, written or read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ProjectionError {
    /// The operating system refused; says which file.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// An archive cannot be read or written.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The file of features cannot be read.
    #[error(transparent)]
    Features(#[from] FeatureFileError),
    /// These features cannot be fitted.
    #[error("{path}: {source}")]
    Fit {
        /// The feature file.
        path: PathBuf,
        /// Why.
        source: DspError,
    },
    /// The file is not what it should be.
    #[error("{path}: {reason}")]
    Content {
        /// The file.
        path: PathBuf,
        /// In words.
        reason: String,
    },
}

/// What a projection file says about its training.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Meta {
    version: u32,
    tool_version: String,
    /// Hash of the configuration of the features.
    config_hash: String,
    /// Identity of the feature file.
    features: String,
    /// Its rows.
    rows: usize,
}

/// Most components that are kept unless the user says otherwise.
const COMPONENTS: usize = 128;

/// A fitted projection.
#[derive(Debug, Clone, PartialEq)]
pub struct Projection {
    pca: Pca,
    feature_names: Vec<String>,
    meta: Meta,
}

impl Projection {
    /// Fits principal components to the statistics in a feature file of `extract`: `n_components`, or
    /// as many as there can be, at most 128.
    ///
    /// # Errors
    /// A file that is none of `extract`'s or has no statistics, more components than rows or
    /// columns, values that are not finite.
    pub fn fit(features: &Path, n_components: Option<usize>) -> Result<Self, ProjectionError> {
        let FeatureTable { table, provenance, .. } = FeatureTable::open(features)?;
        if table.feature_names().is_empty() {
            let reason = "has no statistics: extract with a configuration that has a [summary]";
            return Err(content(features, reason));
        }
        let config: Value = serde_json::from_str(&provenance.config).unwrap_or_default();
        if config.get("projection").is_some_and(|p| !p.is_null()) {
            return Err(content(features, "holds values that are already projected"));
        }
        let (rows, columns) = table.values().dim();
        let n_components = n_components.unwrap_or(COMPONENTS.min(rows).min(columns));
        let pca = Pca::fit(table.values().mapv(f64::from).view(), n_components)
            .map_err(|source| ProjectionError::Fit { path: features.into(), source })?;
        let identity = identity::of_file(features).map_err(|e| NpzError::io(features, e))?;
        let meta = Meta {
            version: VERSION,
            tool_version: env!("CARGO_PKG_VERSION").to_string(),
            config_hash: provenance.config_hash,
            features: identity,
            rows: table.ids().len(),
        };
        Ok(Self { pca, feature_names: table.feature_names().to_vec(), meta })
    }

    /// Writes the file; it appears under its name only when it is whole.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), ProjectionError> {
        let draft = Draft::create(path)?;
        let mut npz = NpzWriter::over(draft.handle()?, path, Compression::Stored, Vec::new());
        let Pca { mean, components, explained_variance } = &self.pca;
        let mut doubles = |name: &str, shape: &[usize], values: Vec<f64>| {
            npz.array(name, &Header::new(DType::F64, shape), bytemuck::cast_slice(&values))
        };
        let (k, n) = components.dim();
        doubles("components", &[k, n], components.iter().copied().collect())?;
        doubles("mean", &[n], mean.to_vec())?;
        doubles("explained_variance", &[k], explained_variance.to_vec())?;
        npz.strings("feature_names", &self.feature_names)?;
        npz.text("meta", &serde_json::json!(self.meta).to_string())?;
        npz.finish()?;
        Ok(draft.publish()?)
    }

    /// Reads a file, whoever wrote it.
    ///
    /// # Errors
    /// It cannot be read, or its members do not fit one another.
    pub fn load(path: &Path) -> Result<Self, ProjectionError> {
        let mut npz = NpzFile::open(path)?;
        let meta: Meta = npz.json("meta")?;
        if meta.version != VERSION {
            let reason = format!("projection version {}, expected {VERSION}", meta.version);
            return Err(content(path, reason));
        }
        let components = shaped::<Ix2>(path, "components", npz.f64("components")?)?;
        let mean = shaped::<Ix1>(path, "mean", npz.f64("mean")?)?;
        let name = "explained_variance";
        let explained_variance = shaped::<Ix1>(path, name, npz.f64(name)?)?;
        let feature_names = npz.strings("feature_names")?;
        let (k, n) = components.dim();
        if k == 0 || mean.len() != n || feature_names.len() != n || explained_variance.len() != k {
            let reason = format!(
                "components are {k} x {n}, but there are {} means, {} names, {} variances",
                mean.len(),
                feature_names.len(),
                explained_variance.len()
            );
            return Err(content(path, reason));
        }
        let all = components.iter().chain(&mean).chain(&explained_variance);
        if !all.copied().all(f64::is_finite) {
            return Err(content(path, "has values that are not finite"));
        }
        Ok(Self { pca: Pca { mean, components, explained_variance }, feature_names, meta })
    }

    /// Hash of the configuration of the features that it was fitted on, and their number of rows.
    pub fn fitted_on(&self) -> (&str, usize) {
        (&self.meta.config_hash, self.meta.rows)
    }

    /// Values that it takes.
    pub fn n_inputs(&self) -> usize {
        self.feature_names.len()
    }

    /// Values that it gives.
    pub fn n_components(&self) -> usize {
        self.pca.components.nrows()
    }

    /// Part of the variance of the training features along each component, divisor rows - 1.
    pub fn explained_variance(&self) -> &[f64] {
        self.pca.explained_variance.as_slice().unwrap_or_default()
    }
}

/// A member of as many axes as it should have.
fn shaped<D: Dimension>(
    path: &Path,
    name: &str,
    array: ArrayD<f64>,
) -> Result<ndarray::Array<f64, D>, ProjectionError> {
    let shape = array.shape().to_vec();
    array.into_dimensionality::<D>().map_err(|_| {
        let expected = D::NDIM.unwrap_or_default();
        content(path, format!("member {name} has shape {shape:?}, expected {expected} axes"))
    })
}

fn content(path: &Path, reason: impl Into<String>) -> ProjectionError {
    ProjectionError::Content { path: path.into(), reason: reason.into() }
}

/// The table `[projection]` of a configuration.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(default)]
struct Keys {
    file: String,
    hash: String,
    whiten: bool,
}

/// A projection as a configuration has it: file, BLAKE3 of its content, and whether each component
/// is divided by its standard deviation.
#[derive(Debug, Clone)]
pub struct ProjectionConfig {
    keys: Keys,
    projection: Arc<Projection>,
}

impl ProjectionConfig {
    /// Reads the table and its file. A configuration out of an output names the content as well, and
    /// then the file must still be that one.
    ///
    /// `summarised` says whether the rest of the configuration has a summary, `hash` is its hash.
    pub(crate) fn parse(summarised: bool, hash: &str, value: Value) -> Result<Self, ConfigError> {
        let table: Map<String, Value> = match value {
            Value::Object(table) => table,
            other => {
                let message = format!("must be a table with the key file, not {other}");
                return Err(ConfigError::key("projection", message));
            }
        };
        let mut keys: Keys = typed("projection", &table)?;
        let refuse = |message: String| ConfigError::key("projection.file", message);
        if !summarised {
            let message = "needs a [summary], whose statistics it projects";
            return Err(ConfigError::key("projection", message));
        }
        let path = Path::new(&keys.file);
        let io = |e| refuse(format!("{}: {e}", keys.file));
        if !std::fs::metadata(path).map_err(io)?.is_file() {
            return Err(refuse(format!("{} is not a file", keys.file)));
        }
        let mut content = blake3::Hasher::new();
        File::open(path).and_then(|file| content.update_reader(file).map(drop)).map_err(io)?;
        let content = content.finalize().to_hex().to_string();
        if !keys.hash.is_empty() && keys.hash != content {
            let message = format!(
                "{} has changed: its hash is {content}, the configuration has {}",
                keys.file, keys.hash
            );
            return Err(refuse(message));
        }
        keys.hash = content;
        let projection = Projection::load(path).map_err(|e| refuse(e.to_string()))?;
        let fitted = &projection.meta.config_hash;
        if fitted != hash {
            return Err(refuse(format!(
                "{} was fitted on features of configuration {fitted}; these have {hash}",
                keys.file
            )));
        }
        Ok(Self { keys, projection: Arc::new(projection) })
    }

    pub(crate) fn to_value(&self) -> Value {
        serde_json::json!(self.keys)
    }

    /// Its file.
    pub(crate) fn file(&self) -> &Path {
        Path::new(&self.keys.file)
    }

    /// The projection.
    pub fn projection(&self) -> &Projection {
        &self.projection
    }

    /// Names of the values that it gives.
    pub fn names(&self) -> Vec<String> {
        (0..self.projection.n_components()).map(|k| format!("pca[{k}]")).collect()
    }

    /// Statistics of a recording in the coordinates of the projection.
    ///
    /// # Errors
    /// A sentence, where the number of values is another one than in training (a recording of
    /// another number of channels).
    pub fn apply(&self, row: &[f32]) -> Result<Vec<f32>, String> {
        let values: Vec<f64> = row.iter().map(|x| f64::from(*x)).collect();
        let view = ArrayView2::from_shape((1, row.len()), &values).expect("one row");
        let projected = self.projection.pca.project(view, self.keys.whiten);
        let projected = projected.map_err(|e| format!("projection {}: {e}", self.keys.file))?;
        Ok(projected.iter().map(|x| *x as f32).collect())
    }
}
