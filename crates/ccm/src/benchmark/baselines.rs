//! The twelve audio baselines: four feature sets, three classifiers, seven joint classes.

use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_models::classifiers::{
    ClassifierSpec, Gamma, KNearestParams, RandomForestParams, SvmParams,
};

use super::features::FeatureSet;
use super::results::Estimate;

/// A classifier with the published settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Learner {
    /// Five nearest neighbours.
    Knn,
    /// RBF support vector machine, C 20, gamma 1e-5.
    Svm,
    /// Random forest of 100 trees.
    Forest,
}

/// A feature set with a classifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Baseline {
    /// The features.
    pub features: FeatureSet,
    /// Reduced to 128 principal components.
    pub pca: bool,
    /// The classifier.
    pub learner: Learner,
}

/// How a baseline is run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variant {
    /// As the published code: no scaling, a random split of recordings, PCA fitted anew on every
    /// part.
    Published,
    /// Scaled features, PCA fitted on training data only, containers held out.
    Corrected,
}

impl Variant {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Published, Self::Corrected];

    /// Name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Published => "published",
            Self::Corrected => "corrected",
        }
    }
}

impl Learner {
    /// All three.
    pub const ALL: [Self; 3] = [Self::Knn, Self::Svm, Self::Forest];

    fn name(self) -> &'static str {
        match self {
            Self::Knn => "kNN",
            Self::Svm => "SVM",
            Self::Forest => "RF",
        }
    }

    pub(super) fn spec(self, seed: u64) -> ClassifierSpec {
        match self {
            Self::Knn => KNearestParams::default().into(),
            Self::Svm => SvmParams {
                C: 20.0,
                gamma: Gamma::Value(1e-5),
                probability: false,
                ..Default::default()
            }
            .into(),
            Self::Forest => RandomForestParams { seed, ..Default::default() }.into(),
        }
    }
}

/// What a baseline predicts.
pub(super) struct BaselineResult {
    pub(super) baseline: Baseline,
    pub(super) variant: Variant,
    /// Row numbers of training recordings that were not trained on, with their estimates: the held
    /// out 20 % (published) or all of them, fold by fold (corrected).
    pub(super) held_out: Vec<(usize, Estimate)>,
    /// Estimates for all training recordings by a model that knows most of them (published only).
    pub(super) seen: Vec<Estimate>,
    /// Estimates of each test part.
    pub(super) tests: Vec<Vec<Estimate>>,
    /// By which the features were computed.
    pub(super) config: Arc<Config>,
}

impl Baseline {
    /// The twelve in the paper's order of features.
    pub fn all() -> Vec<Self> {
        let mut list = Vec::new();
        for (features, pca) in [
            (FeatureSet::ZcrMfcc, false),
            (FeatureSet::Af193, false),
            (FeatureSet::Spectrogram, false),
            (FeatureSet::Spectrogram, true),
        ] {
            list.extend(Learner::ALL.map(|learner| Self { features, pca, learner }));
        }
        list
    }

    /// Name as the paper prints it.
    pub fn name(&self) -> String {
        let pca = if self.pca { " + PCA" } else { "" };
        format!("{}{pca} + {}", self.features.name(), self.learner.name())
    }

    /// Name in files and on the command line, such as `spectrogram-pca-svm`.
    pub fn slug(&self) -> String {
        let pca = if self.pca { "-pca" } else { "" };
        format!("{}{pca}-{}", self.features.slug(), self.learner.name().to_lowercase())
    }
}
