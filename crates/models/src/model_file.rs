//! Trained models on disk.
//!
//! One file: magic, format version, lengths, a JSON header for people and other programs, the
//! fitted pipeline (postcard), and a BLAKE3 checksum of everything before it. Nothing in it is
//! executed; every length is checked before memory is taken, and the parts are checked against one
//! another before they are used.
//!
//! | bytes | content |
//! |---|---|
//! | 8 | `CORSMDL` and a zero byte |
//! | 4 | format version, little endian |
//! | 8 | header length |
//! | 8 | payload length |
//! | … | header, JSON |
//! | … | payload, postcard |
//! | 32 | BLAKE3 |

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use corsmal_files::draft;
use linfa::traits::PredictInplace;
use ndarray::{Array2, ArrayBase, ArrayView2, Data, Ix2};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use crate::classifiers::Predicted;
use crate::error::{ModelError, Result};
use crate::formats::is_resampled_alike;
use crate::labels::Labels;
use crate::lengths;
use crate::pipeline::{Pipeline, PipelineSpec};

pub use crate::formats::{FormatRule, OtherRate, TrainedOn};
pub use crate::lengths::Lengths;

const MAGIC: &[u8; 8] = b"CORSMDL\0";
/// Version of the file format written.
pub const FORMAT_VERSION: u32 = 1;
/// Largest header accepted.
pub const MAX_HEADER: u64 = 64 << 20;
/// Largest file accepted.
pub const MAX_FILE: u64 = 4 << 30;
const PREFIX: usize = 28;
const CHECKSUM: usize = 32;

/// What a model file says about its model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelHeader {
    /// steps and classifier with all parameters
    pub pipeline: PipelineSpec,
    /// label names in class order
    pub labels: Labels,
    /// what is predicted: type, level, joint, or a column's name
    pub target: String,
    /// name of each feature; empty when unknown
    pub feature_names: Vec<String>,
    /// full configuration the features were made with; null when they came from elsewhere
    pub feature_config: Value,
    /// hash of that configuration; empty when there is none
    pub feature_config_hash: String,
    /// where it was learned: rows, classes, files, folds, scores
    pub provenance: Value,
    /// formats of the recordings learned from; absent where unknown, as in models of version 0.1.0
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trained_on: Option<TrainedOn>,
    /// version of the program that wrote it
    pub tool_version: String,
}

/// A trained model with everything needed to use it.
#[derive(Clone, Debug)]
pub struct Model {
    header: ModelHeader,
    pipeline: Pipeline,
}

/// Why a model file was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ModelFileError {
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// the file
        path: PathBuf,
        /// why
        source: std::io::Error,
    },
    /// The file could not be written; the text names it.
    #[error(transparent)]
    Write(std::io::Error),
    /// The file does not begin as a model file does.
    #[error("not a model file of corsmal-feat")]
    NotAModel,
    /// Written in a format this program does not know.
    #[error("model format version {found}: this program reads version {FORMAT_VERSION}")]
    Version {
        /// version in the file
        found: u32,
    },
    /// A length in the file is beyond what is accepted.
    #[error("model {part} of {bytes} bytes: at most {limit} are accepted")]
    TooLarge {
        /// header or file
        part: &'static str,
        /// length claimed
        bytes: u64,
        /// most accepted
        limit: u64,
    },
    /// The file is shorter or longer than it says.
    #[error("the model file has {found} bytes; its lengths add up to {expected}")]
    Length {
        /// bytes by its lengths
        expected: u64,
        /// bytes there
        found: u64,
    },
    /// The content is not what was written.
    #[error("the model file is damaged: its checksum does not match")]
    Checksum,
    /// The header or the payload cannot be understood.
    #[error("model {part}: {reason}")]
    Content {
        /// header or payload
        part: &'static str,
        /// why
        reason: String,
    },
    /// The model does not know the formats of the recordings that it was trained on.
    #[error(
        "the model (from version {version}) does not record the sample rates and channels that it \
         was \
         trained on, so recordings of another format would silently be classified wrongly: train \
         it again, or use --any-rate to take every recording as it is"
    )]
    FormatUnknown {
        /// version of the program that wrote it
        version: String,
    },
    /// Recordings would be brought to a rate that the model was not trained on.
    #[error(transparent)]
    Rate(#[from] OtherRate),
    /// The features offered were made with another configuration.
    #[error(
        "the model was trained on features with {}, these have {}",
        configuration(model),
        configuration(features)
    )]
    Configuration {
        /// hash in the model
        model: String,
        /// hash of the features
        features: String,
    },
}

impl ModelHeader {
    /// A header that knows pipeline and labels only: of features that no program made.
    pub fn new(pipeline: PipelineSpec, labels: Labels) -> Self {
        Self {
            pipeline,
            labels,
            target: "y".into(),
            feature_names: Vec::new(),
            feature_config: Value::Null,
            feature_config_hash: String::new(),
            provenance: Value::Null,
            trained_on: None,
            tool_version: env!("CARGO_PKG_VERSION").into(),
        }
    }
}

impl Model {
    /// A model from its parts.
    ///
    /// # Errors
    /// [`ModelError::Inconsistent`] when label or feature names do not fit the pipeline.
    pub fn new(header: ModelHeader, pipeline: Pipeline) -> Result<Self> {
        let refuse = |what: &str| Err(ModelError::Inconsistent(what.into()));
        if header.labels.len() != pipeline.n_classes() {
            return refuse("label names do not match the classes");
        }
        if !header.feature_names.is_empty() && header.feature_names.len() != pipeline.n_features() {
            return refuse("feature names do not match the features");
        }
        if header.pipeline.steps.len() != pipeline.steps().len() {
            return refuse("steps do not match the pipeline");
        }
        Ok(Self { header, pipeline })
    }

    /// What the file says about it.
    pub fn header(&self) -> &ModelHeader {
        &self.header
    }

    /// Features per row.
    pub fn n_features(&self) -> usize {
        self.pipeline.n_features()
    }

    /// Class indices of `[rows, features]`.
    ///
    /// # Errors
    /// See [`Pipeline::predict`].
    pub fn predict(&self, x: ArrayView2<'_, f64>) -> Result<Vec<usize>> {
        self.pipeline.predict(x)
    }

    /// Probabilities `[rows, classes]`.
    ///
    /// # Errors
    /// See [`Pipeline::predict_proba`].
    pub fn predict_proba(&self, x: ArrayView2<'_, f64>) -> Result<Array2<f64>> {
        self.pipeline.predict_proba(x)
    }

    /// Refuses a model without probabilities.
    ///
    /// # Errors
    /// [`ModelError::NoProbability`].
    pub fn require_probabilities(&self) -> Result<()> {
        let row = Array2::zeros((1, self.n_features()));
        match self.predict_proba(row.view()) {
            Err(none @ ModelError::NoProbability { .. }) => Err(none),
            _ => Ok(()),
        }
    }

    /// The fitted steps and classifier.
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// Which recordings the model may be applied to when their features are made with `config`, its
    /// own feature configuration or one that differs in `signal`.
    ///
    /// # Errors
    /// [`ModelFileError::FormatUnknown`] for a model that does not know what it was trained on, where
    /// that matters; [`ModelFileError::Rate`] for a rate to which no training recording was brought.
    pub fn format_rule(&self, config: &Value) -> std::result::Result<FormatRule, ModelFileError> {
        let own = &self.header.feature_config;
        match &self.header.trained_on {
            Some(trained) => Ok(trained.rule(own, config)?),
            // Another number of channels gives another number of features, which is refused anyway.
            None if is_resampled_alike(own, config) => Ok(FormatRule::default()),
            None => {
                let version = self.header.tool_version.clone();
                Err(ModelFileError::FormatUnknown { version })
            }
        }
    }

    /// The same for any sample rate; all pass where it is unknown what the model was trained on.
    pub fn format_rule_of_any_rate(&self, config: &Value) -> FormatRule {
        let own = &self.header.feature_config;
        let rule = |trained: &TrainedOn| trained.rule_of_any_rate(own, config);
        self.header.trained_on.as_ref().map(rule).unwrap_or_default()
    }

    /// How long the recordings are that the model was trained on, where features made with `config`
    /// depend on it and it is known.
    pub fn lengths(&self, config: &Value) -> Option<Lengths> {
        let trained = self.header.trained_on.as_ref().filter(|_| !lengths::is_cut(config));
        trained.and_then(|trained| trained.seconds)
    }

    /// Writes the file, whole or not at all.
    ///
    /// # Errors
    /// [`ModelFileError::TooLarge`], or [`ModelFileError::Io`] naming the file.
    pub fn save(&self, path: &Path) -> std::result::Result<(), ModelFileError> {
        let bytes = self.to_bytes()?;
        draft::write(path, &bytes).map_err(ModelFileError::Write)
    }

    /// Refuses features made with another configuration.
    ///
    /// # Errors
    /// [`ModelFileError::Configuration`].
    pub fn check_configuration(&self, hash: &str) -> std::result::Result<(), ModelFileError> {
        if hash == self.header.feature_config_hash {
            return Ok(());
        }
        let (model, features) = (self.header.feature_config_hash.clone(), hash.to_string());
        Err(ModelFileError::Configuration { model, features })
    }

    /// The file's bytes.
    ///
    /// # Errors
    /// [`ModelFileError::TooLarge`].
    pub fn to_bytes(&self) -> std::result::Result<Vec<u8>, ModelFileError> {
        let content = |part, reason: String| ModelFileError::Content { part, reason };
        let header =
            serde_json::to_vec(&self.header).map_err(|e| content("header", e.to_string()))?;
        let payload =
            postcard::to_stdvec(&self.pipeline).map_err(|e| content("payload", e.to_string()))?;
        limit("header", header.len() as u64, MAX_HEADER)?;
        limit("file", (PREFIX + header.len() + payload.len() + CHECKSUM) as u64, MAX_FILE)?;
        let mut bytes = Vec::with_capacity(PREFIX + header.len() + payload.len() + CHECKSUM);
        bytes.extend(MAGIC);
        bytes.extend(FORMAT_VERSION.to_le_bytes());
        bytes.extend((header.len() as u64).to_le_bytes());
        bytes.extend((payload.len() as u64).to_le_bytes());
        bytes.extend(header);
        bytes.extend(payload);
        let checksum = blake3::hash(&bytes);
        bytes.extend(checksum.as_bytes());
        Ok(bytes)
    }

    /// A model from a file's bytes, whoever wrote them.
    ///
    /// # Errors
    /// One of [`ModelFileError`] for anything that is not a whole, undamaged, consistent model.
    pub fn from_bytes(bytes: &[u8]) -> std::result::Result<Self, ModelFileError> {
        let found = bytes.len() as u64;
        limit("file", found, MAX_FILE)?;
        if !bytes.starts_with(MAGIC) {
            return Err(ModelFileError::NotAModel);
        }
        let short = || ModelFileError::Length { expected: (PREFIX + CHECKSUM) as u64, found };
        let version = bytes.get(8..12).and_then(|b| b.try_into().ok()).ok_or_else(short)?;
        let version = u32::from_le_bytes(version);
        if version != FORMAT_VERSION {
            return Err(ModelFileError::Version { found: version });
        }
        let length = |at: usize| -> std::result::Result<u64, ModelFileError> {
            let raw = bytes.get(at..at + 8).and_then(|b| b.try_into().ok()).ok_or_else(short)?;
            Ok(u64::from_le_bytes(raw))
        };
        let (header_length, payload_length) = (length(12)?, length(20)?);
        limit("header", header_length, MAX_HEADER)?;
        limit("file", payload_length, MAX_FILE)?;
        let expected = PREFIX as u64 + header_length + payload_length + CHECKSUM as u64;
        if expected != found {
            return Err(ModelFileError::Length { expected, found });
        }
        let (content, checksum) = bytes.split_at(bytes.len() - CHECKSUM);
        if blake3::hash(content).as_bytes() != checksum {
            return Err(ModelFileError::Checksum);
        }
        let (header, payload) = content[PREFIX..].split_at(header_length as usize);
        let refuse = |part, reason: String| ModelFileError::Content { part, reason };
        let header: ModelHeader =
            serde_json::from_slice(header).map_err(|e| refuse("header", e.to_string()))?;
        let (pipeline, rest): (Pipeline, _) =
            postcard::take_from_bytes(payload).map_err(|e| refuse("payload", e.to_string()))?;
        if !rest.is_empty() {
            return Err(refuse("payload", format!("{} bytes left over", rest.len())));
        }
        pipeline.validate().map_err(|e| refuse("payload", e.to_string()))?;
        Self::new(header, pipeline).map_err(|e| refuse("header", e.to_string()))
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`ModelFileError`].
    pub fn load(path: &Path) -> std::result::Result<Self, ModelFileError> {
        let io = |source| ModelFileError::Io { path: path.into(), source };
        let file = File::open(path).map_err(io)?;
        limit("file", file.metadata().map_err(io)?.len(), MAX_FILE)?;
        let (mut bytes, mut file) = (Vec::new(), file.take(MAX_FILE + 1));
        Read::by_ref(&mut file).take(MAGIC.len() as u64).read_to_end(&mut bytes).map_err(io)?;
        // Devices that are no model have no end.
        if bytes == MAGIC {
            file.read_to_end(&mut bytes).map_err(io)?;
        }
        Self::from_bytes(&bytes)
    }
}

/// A hash in words; features of other programs have none.
fn configuration(hash: &str) -> String {
    match hash {
        "" => "no configuration (from another program)".into(),
        hash => format!("configuration {hash}"),
    }
}

/// A model predicts as linfa's do: `model.predict(&dataset)`, or `&array`; a refusal is in the result.
impl<D: Data<Elem = f64>> PredictInplace<ArrayBase<D, Ix2>, Result<Predicted>> for Model {
    fn predict_inplace<'a>(&'a self, x: &'a ArrayBase<D, Ix2>, y: &mut Result<Predicted>) {
        self.pipeline.predict_inplace(x, y);
    }

    fn default_target(&self, x: &ArrayBase<D, Ix2>) -> Result<Predicted> {
        self.pipeline.default_target(x)
    }
}

fn limit(part: &'static str, bytes: u64, limit: u64) -> std::result::Result<(), ModelFileError> {
    if bytes <= limit { Ok(()) } else { Err(ModelFileError::TooLarge { part, bytes, limit }) }
}
