//! What a feature is: a name, parameters, and a plan for a sample rate.

use serde::{Deserialize, Serialize};

use super::kernel::Feature;
use crate::params::Keys;

/// Parameters of a feature, and how to plan it.
pub trait FeatureKind:
    Serialize + for<'de> Deserialize<'de> + Default + Send + Sync + 'static
{
    /// Name in configurations, librosa's where it has one.
    const KIND: &'static str;
    /// What each number of the output is, in a sentence or two.
    const ABOUT: &'static str;
    /// What the keys of its table mean, its own and those of shared groups
    /// ([`StftSpec::KEYS`](crate::params::StftSpec::KEYS), ...).
    const KEYS: &'static [Keys];
    /// Its function in the Python package, such as `feature.mfcc`; empty where there is none.
    const PYTHON: &'static str = "";

    /// Plans the feature for signals of `sr` Hz.
    ///
    /// # Errors
    /// Impossible parameters.
    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature>;

    /// Refuses parameters that no sample rate makes possible, before the first file is opened.
    ///
    /// # Errors
    /// Impossible parameters.
    fn check(&self) -> corsmal_dsp::Result<()> {
        self.plan(768_000.0).map(drop)
    }
}
