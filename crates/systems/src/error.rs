//! Why networks cannot learn from recordings, hear or embed them.

use std::path::PathBuf;

use corsmal_extract::config::ConfigError;
use corsmal_extract::run::RunError;
use corsmal_models::ModelError;
use corsmal_models::dataset::DatasetError;
use corsmal_models::model_file::OtherRate;
use corsmal_nets::NetError;
use corsmal_nets::weights::WeightsError;
use thiserror::Error;

/// Why a network cannot be trained or applied. What is wrong with a single recording is said of that
/// recording instead.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SystemError {
    /// The user stopped the work.
    #[error("interrupted")]
    Interrupted,
    /// A network that takes something else.
    #[error("{network} takes {takes}, not recordings; give it an .npz of those")]
    TakesNoRecordings {
        /// the network
        network: &'static str,
        /// what it takes
        takes: &'static str,
    },
    /// A model that does not say on which recordings it was trained.
    #[error("the model is damaged: trained_on, the formats of its recordings: {reason}")]
    TrainedOn {
        /// what is wrong
        reason: serde_json::Error,
    },
    /// A network that takes something else.
    #[error("{network} takes {takes}, not pictures")]
    TakesNoPictures {
        /// the network
        network: &'static str,
        /// what it takes
        takes: &'static str,
    },
    /// A folder without pictures.
    #[error("{path}: has no PNG or JPEG picture")]
    NoPictures {
        /// the folder
        path: PathBuf,
    },
    /// A folder with more pictures than can be learned from.
    #[error("{path}: has more than {limit} pictures, the limit")]
    TooManyPictures {
        /// the folder
        path: PathBuf,
        /// how many there may be
        limit: usize,
    },
    /// More pictures than memory holds.
    #[error(
        "{path}: {pictures} pictures take {:.1} GiB of memory as inputs of the network; {:.1} GiB \
         are free",
        gib(*needed), gib(*available)
    )]
    TooMuchMemory {
        /// the folder
        path: PathBuf,
        /// how many there are
        pictures: usize,
        /// bytes that they take
        needed: u64,
        /// bytes that are free
        available: u64,
    },
    /// Two pictures that differ in their ending alone.
    #[error("{first} and {second} have the same id, {id}; rename one of them")]
    SameId {
        /// their id
        id: String,
        /// the one
        first: PathBuf,
        /// the other
        second: PathBuf,
    },
    /// A trained network that does not know how its inputs come from recordings.
    #[error(
        "{network} was trained on inputs from a file and cannot make them from recordings; give it such inputs, \
         or train it on recordings"
    )]
    TrainedOnInputs {
        /// the network
        network: String,
    },
    /// A network that gives classes where embeddings are wanted.
    #[error("{network} gives classes, not embeddings; vggish gives embeddings")]
    NoEmbeddings {
        /// the network
        network: &'static str,
    },
    /// Recordings without features, or pictures that are all damaged.
    #[error("{path}: nothing in it can be used for training")]
    NoExamples {
        /// where they lie
        path: PathBuf,
    },
    /// Weights that cannot be read.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// Weights of another network.
    #[error("{path}: {source}")]
    OtherWeights {
        /// the file
        path: PathBuf,
        /// how they differ
        source: Box<NetError>,
    },
    /// A file that cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// the file
        path: PathBuf,
        /// why
        source: std::io::Error,
    },
    /// The feature configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Recordings would be brought to a rate that the network was not trained on.
    #[error(transparent)]
    Rate(#[from] OtherRate),
    /// The extraction cannot start or go on.
    #[error(transparent)]
    Extraction(Box<RunError>),
    /// The threads cannot be started.
    #[error(transparent)]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// A file of a network's inputs.
    #[error(transparent)]
    Inputs(#[from] corsmal_nets::dataset::ItemsError),
    /// Labels or groups.
    #[error(transparent)]
    Labels(#[from] DatasetError),
    /// Classes, folds or votes.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The network.
    #[error(transparent)]
    Network(#[from] NetError),
}

fn gib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 30)
}

impl From<RunError> for SystemError {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Interrupted => Self::Interrupted,
            error => Self::Extraction(Box::new(error)),
        }
    }
}

/// Result with this error.
pub type Result<T> = std::result::Result<T, SystemError>;
