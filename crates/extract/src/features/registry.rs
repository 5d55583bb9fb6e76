//! Which features there are: those of this crate, and those that a program adds to them.

use std::sync::{PoisonError, RwLock};

use serde_json::{Map, Value};
use thiserror::Error;

use super::kernel::Feature;
use super::kind::FeatureKind;
use crate::params::{ConfigError, Keys, typed};

/// The features of this crate, in the order in which `corsmal-feat features` lists them.
const REGISTRY: &[Entry] = &[
    Entry::of::<super::stft::Stft>(),
    Entry::of::<super::melspectrogram::Melspectrogram>(),
    Entry::of::<super::mfcc::Mfcc>(),
    Entry::of::<super::delta::Delta>(),
    Entry::of::<super::zero_crossing_rate::ZeroCrossingRate>(),
    Entry::of::<super::rms::Rms>(),
    Entry::of::<super::spectral_centroid::SpectralCentroid>(),
    Entry::of::<super::spectral_bandwidth::SpectralBandwidth>(),
    Entry::of::<super::spectral_rolloff::SpectralRolloff>(),
    Entry::of::<super::spectral_flatness::SpectralFlatness>(),
    Entry::of::<super::spectral_contrast::SpectralContrast>(),
    Entry::of::<super::poly_features::PolyFeatures>(),
    Entry::of::<super::onset_strength::OnsetStrength>(),
    Entry::of::<super::spectral_flux::SpectralFlux>(),
    Entry::of::<super::pcen::Pcen>(),
    Entry::of::<super::hpss::Hpss>(),
    Entry::of::<super::cqt::Cqt>(),
    Entry::of::<super::chroma_stft::ChromaStft>(),
    Entry::of::<super::chroma_cqt::ChromaCqt>(),
    Entry::of::<super::tonnetz::Tonnetz>(),
    Entry::of::<super::af193::Af193>(),
    Entry::of::<super::a34_short::A34Short>(),
    Entry::of::<super::a34f136::A34f136>(),
    Entry::of::<super::spec9216::Spec9216>(),
    Entry::of::<super::m2_mfcc::M2Mfcc>(),
    Entry::of::<super::m3_spectrogram::M3Spectrogram>(),
    Entry::of::<super::m4_logmel::M4LogMel>(),
    Entry::of::<super::vggish_patches::VggishPatches>(),
    Entry::of::<super::m6_spectrogram::M6Spectrogram>(),
];

/// Features that the program has registered.
static REGISTERED: RwLock<Vec<&'static Entry>> = RwLock::new(Vec::new());

/// Plans a feature with checked parameters for a sample rate.
pub type Planner = Box<dyn Fn(f64) -> corsmal_dsp::Result<Feature> + Send + Sync>;

/// Checks a table of parameters: every parameter with its value, and the planner.
type Parse = fn(&str, &Map<String, Value>) -> Result<(Value, Planner), ConfigError>;

/// A registered feature kind.
pub struct Entry {
    kind: &'static str,
    about: &'static str,
    python: &'static str,
    keys: &'static [Keys],
    parse: Parse,
}

impl Entry {
    const fn of<K: FeatureKind>() -> Self {
        fn parse<K: FeatureKind>(
            prefix: &str,
            table: &Map<String, Value>,
        ) -> Result<(Value, Planner), ConfigError> {
            let parameters: K = typed(prefix, table)?;
            let value =
                serde_json::to_value(&parameters).map_err(|e| ConfigError::key(prefix, e))?;
            parameters.check().map_err(|e| ConfigError::key(prefix, e))?;
            Ok((value, Box::new(move |sr| parameters.plan(sr))))
        }
        Self { kind: K::KIND, about: K::ABOUT, python: K::PYTHON, keys: K::KEYS, parse: parse::<K> }
    }

    /// Name in configurations.
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// What each number of the output is.
    pub fn about(&self) -> &'static str {
        self.about
    }

    /// Its function in the Python package, such as `feature.mfcc`; empty where there is none.
    pub fn python(&self) -> &'static str {
        self.python
    }

    /// The keys that it explains.
    pub fn keys(&self) -> impl Iterator<Item = &'static str> {
        self.keys.iter().copied().flatten().map(|(name, _)| *name)
    }

    /// What a key of its table means; `None` for an unknown key.
    pub fn explain(&self, key: &str) -> Option<&'static str> {
        let mut all = self.keys.iter().copied().flatten();
        all.find(|(name, _)| *name == key).map(|(_, about)| *about)
    }

    /// Default parameters.
    pub fn defaults(&self) -> Value {
        (self.parse)(self.kind, &Map::new()).map_or(Value::Null, |(value, _)| value)
    }

    /// Checks a table of parameters, whose place in the configuration is `prefix`: every parameter
    /// with its value, and the planner.
    ///
    /// # Errors
    /// An unknown key or an impossible value.
    pub fn parse(
        &self,
        prefix: &str,
        table: &Map<String, Value>,
    ) -> Result<(Value, Planner), ConfigError> {
        (self.parse)(prefix, table)
    }
}

/// A feature that cannot be registered.
#[derive(Debug, Error)]
#[error("there is already a feature \"{kind}\": give the new one another name")]
pub struct Taken {
    /// The name.
    pub kind: &'static str,
}

/// Adds a feature to those that configurations can name, for the rest of the program.
///
/// Outputs store the name and the parameters: a program that reads their configuration again has to
/// register the feature, too.
///
/// # Errors
/// The name is taken.
pub fn register<K: FeatureKind>() -> Result<(), Taken> {
    let mut registered = REGISTERED.write().unwrap_or_else(PoisonError::into_inner);
    let mut all = REGISTRY.iter().chain(registered.iter().copied());
    if all.any(|entry| entry.kind == K::KIND) {
        return Err(Taken { kind: K::KIND });
    }
    registered.push(Box::leak(Box::new(Entry::of::<K>())));
    Ok(())
}

/// Every feature: those of this crate, then those of the program.
pub fn registry() -> Vec<&'static Entry> {
    let registered = REGISTERED.read().unwrap_or_else(PoisonError::into_inner);
    REGISTRY.iter().chain(registered.iter().copied()).collect()
}

/// The feature of that name.
pub fn find(kind: &str) -> Option<&'static Entry> {
    registry().into_iter().find(|entry| entry.kind == kind)
}

/// Names of every feature.
pub fn kinds() -> Vec<&'static str> {
    registry().into_iter().map(|entry| entry.kind).collect()
}
