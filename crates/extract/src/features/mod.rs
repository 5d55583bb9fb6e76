//! Features: one file each, with its parameters and one line in `REGISTRY`.
//!
//! A feature declares what it reads (rows of a spectrum, frames of the waveform, or the whole
//! recording, which is then held in memory), what it computes from that alone, and, where its values depend on the maximum of the
//! recording (`top_db`), how stored values are finished once that is known.

mod a34_short;
mod a34f136;
mod af193;
mod chroma_cqt;
mod chroma_stft;
mod cqt;
mod delta;
mod hpss;
mod m2_mfcc;
mod m3_spectrogram;
mod m4_logmel;
mod m6_spectrogram;
mod mel_bands;
mod melspectrogram;
mod mfcc;
mod onset_strength;
mod poly_features;
mod rms;
mod spec9216;
mod spectral_bandwidth;
mod spectral_centroid;
mod spectral_contrast;
mod spectral_flatness;
mod spectral_rolloff;
mod stft;
mod tonnetz;
mod vggish_patches;
mod zero_crossing_rate;

use corsmal_dsp::lanes::Row;
use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::time_domain::FrameParams;
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::config::{ConfigError, typed};

/// Every feature, in the order in which `corsmal-feat features` lists them.
const REGISTRY: &[Entry] = &[
    Entry::of::<stft::Stft>(),
    Entry::of::<melspectrogram::Melspectrogram>(),
    Entry::of::<mfcc::Mfcc>(),
    Entry::of::<delta::Delta>(),
    Entry::of::<zero_crossing_rate::ZeroCrossingRate>(),
    Entry::of::<rms::Rms>(),
    Entry::of::<spectral_centroid::SpectralCentroid>(),
    Entry::of::<spectral_bandwidth::SpectralBandwidth>(),
    Entry::of::<spectral_rolloff::SpectralRolloff>(),
    Entry::of::<spectral_flatness::SpectralFlatness>(),
    Entry::of::<spectral_contrast::SpectralContrast>(),
    Entry::of::<poly_features::PolyFeatures>(),
    Entry::of::<onset_strength::OnsetStrength>(),
    Entry::of::<hpss::Hpss>(),
    Entry::of::<cqt::Cqt>(),
    Entry::of::<chroma_stft::ChromaStft>(),
    Entry::of::<chroma_cqt::ChromaCqt>(),
    Entry::of::<tonnetz::Tonnetz>(),
    Entry::of::<af193::Af193>(),
    Entry::of::<a34_short::A34Short>(),
    Entry::of::<a34f136::A34f136>(),
    Entry::of::<spec9216::Spec9216>(),
    Entry::of::<m2_mfcc::M2Mfcc>(),
    Entry::of::<m3_spectrogram::M3Spectrogram>(),
    Entry::of::<m4_logmel::M4LogMel>(),
    Entry::of::<vggish_patches::VggishPatches>(),
    Entry::of::<m6_spectrogram::M6Spectrogram>(),
];

/// Parameters of a feature, and how to plan it.
pub trait FeatureKind:
    Serialize + for<'de> Deserialize<'de> + Default + Send + Sync + 'static
{
    /// Name in configurations, librosa's where it has one.
    const KIND: &'static str;
    /// What each number of the output is, in a sentence or two.
    const ABOUT: &'static str;

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

/// What a spectrum feature reads of each frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// `|X|^2`, one row a bin.
    Power,
    /// `|X|`, one row a bin.
    Magnitude,
    /// Real and imaginary parts, two rows a bin.
    Complex,
}

/// Computes from the spectra of sixteen (frame, channel) slots.
pub trait SpectrumKernel: Send + Sync {
    /// `spectrum` holds the quantity's rows, `out` the feature's.
    fn rows(&self, spectrum: &[Row], out: &mut [Row]);

    /// What the user should know of these parameters, though they are possible.
    fn warning(&self) -> Option<String> {
        None
    }
}

/// Computes from frames of the waveform.
pub trait WaveKernel: Send + Sync {
    /// `samples` is interleaved and starts at the first sample of the first of `frames` frames, edge
    /// padding included; appends `[frames][rows][channels]` to `out`.
    fn frames(&self, samples: &[f32], channels: usize, frames: usize, out: &mut Vec<f32>);
}

/// Computes from one magnitude spectrum of `n_fft / 2 + 1` bins the rows of one (frame, channel).
pub type SlotFn<'k> = Box<dyn FnMut(&[f32], &mut [f64]) + 'k>;

/// Computes from exact magnitude spectra, one (frame, channel) at a time.
pub trait SlotKernel: Send + Sync {
    /// The function with its working memory, made once per block of frames.
    fn worker(&self) -> SlotFn<'_>;
}

/// Computes from a whole channel, which is held in memory until its end.
pub trait WholeKernel: Send + Sync {
    /// `[coefficients, frames]` of the samples of one channel; a vector is one frame.
    ///
    /// # Errors
    /// A signal that the feature does not exist for.
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>>;
}

/// Finishes stored values once the maxima of the recording are known.
pub trait Finish: Send + Sync {
    /// Rows whose maximum is needed, and whether it is joint over channels.
    fn peaks(&self) -> Vec<(std::ops::Range<usize>, bool)>;

    /// One frame, `raw [rows][channels]` to `out [coefficients][channels]`; `peaks` is
    /// `[peaks][channels]`.
    fn frame(&self, raw: &[f32], peaks: &[f32], channels: usize, out: &mut [f32]);
}

/// What a feature computes from.
pub enum Kernel {
    /// Rows of the spectrum.
    Spectrum(StftParams, Quantity, Box<dyn SpectrumKernel>),
    /// Magnitudes of a transform in double precision, rounded to single precision as librosa
    /// stores them.
    Exact(StftParams, Box<dyn SlotKernel>),
    /// Frames of the waveform, with what they see outside the signal.
    Wave(FrameParams, PadMode, Box<dyn WaveKernel>),
    /// The whole recording, channel by channel.
    Whole(Extent, Box<dyn WholeKernel>),
    /// The finished frames of another feature, by name.
    Derived(String, corsmal_dsp::delta::DeltaParams),
}

/// What a whole-recording feature gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Extent {
    /// Frames this many samples apart.
    Frames(f64),
    /// One vector, which statistics leave as it is.
    Vector,
}

/// A planned feature.
pub struct Feature {
    /// What it computes from.
    pub kernel: Kernel,
    /// Values stored per frame and channel before finishing.
    pub raw_rows: usize,
    /// Names of the output coefficients (empty for [`Kernel::Derived`], which takes its source's).
    pub labels: Vec<String>,
    /// Whether pairs of rows are real and imaginary parts.
    pub complex: bool,
    /// Finishing, where values depend on the whole recording.
    pub finish: Option<Box<dyn Finish>>,
}

impl Feature {
    /// A feature of exact magnitudes whose values are final as computed, one row a label.
    fn exact(stft: StftParams, kernel: Box<dyn SlotKernel>, labels: Vec<String>) -> Self {
        let raw_rows = labels.len();
        let kernel = Kernel::Exact(stft, kernel);
        Self { kernel, raw_rows, labels, complex: false, finish: None }
    }

    /// A feature of the whole recording, one row a label.
    fn whole(extent: Extent, kernel: impl WholeKernel + 'static, labels: Vec<String>) -> Self {
        let raw_rows = labels.len();
        let kernel = Kernel::Whole(extent, Box::new(kernel));
        Self { kernel, raw_rows, labels, complex: false, finish: None }
    }
}

/// Names of `n` coefficients: their indices.
fn indices(n: usize) -> Vec<String> {
    (0..n).map(|i| i.to_string()).collect()
}

/// Name of a coefficient by its frequency.
fn hertz(frequency: f64) -> String {
    format!("{frequency:.1}Hz")
}

/// Names of the pixels of an image of 96 x 96, row by row: `row,column`.
fn pixels() -> Vec<String> {
    (0..96).flat_map(|row| (0..96).map(move |column| format!("{row},{column}"))).collect()
}

/// Rate in Hz by which coefficients are counted where the recordings give the rate.
const USUAL_RATE: f64 = 44_100.0;

type Planner = Box<dyn Fn(f64) -> corsmal_dsp::Result<Feature> + Send + Sync>;

/// Checks a table of parameters: every parameter with its value, and the planner.
type Parse = fn(&str, &Map<String, Value>) -> Result<(Value, Planner), ConfigError>;

/// A registered feature kind.
pub struct Entry {
    kind: &'static str,
    about: &'static str,
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
        Self { kind: K::KIND, about: K::ABOUT, parse: parse::<K> }
    }

    /// Name in configurations.
    pub fn kind(&self) -> &'static str {
        self.kind
    }

    /// What each number of the output is.
    pub fn about(&self) -> &'static str {
        self.about
    }

    /// Default parameters.
    pub fn defaults(&self) -> Value {
        (self.parse)(self.kind, &Map::new()).map_or(Value::Null, |(value, _)| value)
    }
}

/// Every registered feature.
pub fn registry() -> &'static [Entry] {
    REGISTRY
}

/// Names of every registered feature.
pub fn kinds() -> Vec<&'static str> {
    REGISTRY.iter().map(|e| e.kind).collect()
}

/// A feature of a configuration: name, kind, checked parameters.
#[derive(Clone)]
pub struct FeatureConfig {
    name: String,
    entry: &'static Entry,
    parameters: Value,
    coefficients: Option<[usize; 2]>,
    planner: std::sync::Arc<Planner>,
}

impl std::fmt::Debug for FeatureConfig {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} = {}", self.name, self.to_value())
    }
}

impl FeatureConfig {
    /// Parses the table `features.NAME`. `kind` is the name unless given; `coefficients = [a, b]`
    /// keeps coefficients `a` to `b - 1`; everything else are the kind's parameters.
    pub(crate) fn parse(name: &str, value: Value) -> Result<Self, ConfigError> {
        let prefix = format!("features.{name}");
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
            let message = "is not a possible name: letters, digits, _ and - only";
            return Err(ConfigError::key(prefix, message));
        }
        let Value::Object(mut table) = value else {
            return Err(ConfigError::key(prefix, format!("= {value}: expected a table")));
        };
        let kind = match table.remove("kind") {
            None => name.to_string(),
            Some(Value::String(kind)) => kind,
            Some(other) => {
                let message = format!("= {other}: expected one of {}", kinds().join(", "));
                return Err(ConfigError::key(format!("{prefix}.kind"), message));
            }
        };
        let Some(entry) = REGISTRY.iter().find(|e| e.kind == kind) else {
            let message =
                format!("= \"{kind}\" is unknown: {}", corsmal_names::choices(&kind, kinds()));
            return Err(ConfigError::key(format!("{prefix}.kind"), message));
        };
        let coefficients = match table.remove("coefficients") {
            None => None,
            Some(value) => match serde_json::from_value::<[usize; 2]>(value.clone()) {
                Ok([a, b]) if a < b => Some([a, b]),
                _ => {
                    let message = format!("= {value}: expected [first, end) with first < end");
                    return Err(ConfigError::key(format!("{prefix}.coefficients"), message));
                }
            },
        };
        let (parameters, planner) = (entry.parse)(&prefix, &table)?;
        let planner = std::sync::Arc::new(planner);
        Ok(Self { name: name.to_string(), entry, parameters, coefficients, planner })
    }

    /// Refuses what is impossible at the sample rate `sr`, where that is configured; a derived
    /// feature whose source is missing or comes later; coefficients that a feature has not.
    pub(crate) fn check(all: &[Self], sr: Option<f64>) -> Result<(), ConfigError> {
        let mut coefficients: Vec<usize> = Vec::new();
        for (i, feature) in all.iter().enumerate() {
            let key = |last: &str| format!("features.{}{last}", feature.name);
            let planned = match (feature.plan(sr.unwrap_or(USUAL_RATE)), sr) {
                (Ok(planned), _) => planned,
                (Err(e), Some(_)) => return Err(ConfigError::key(key(""), e)),
                // Possible at another rate: the recordings will tell.
                (Err(_), None) => {
                    coefficients.push(usize::MAX);
                    continue;
                }
            };
            let count = match &planned.kernel {
                Kernel::Derived(of, _) => {
                    let source = all[..i].iter().position(|f| f.name == *of);
                    let message = || format!("= \"{of}\": expected the name of an earlier feature");
                    coefficients[source.ok_or_else(|| ConfigError::key(key(".of"), message()))?]
                }
                _ => planned.labels.len(),
            };
            if let Some([first, end]) = feature.coefficients
                && end > count
            {
                let message = format!("= [{first}, {end}]: at most {count}");
                return Err(ConfigError::key(key(".coefficients"), message));
            }
            coefficients.push(count);
        }
        Ok(())
    }

    /// Name of the feature in outputs.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What each number of the output is.
    pub fn about(&self) -> &'static str {
        self.entry.about
    }

    /// Coefficients kept, `[first, end)`; `None` for all.
    pub fn coefficients(&self) -> Option<[usize; 2]> {
        self.coefficients
    }

    /// Kind and every parameter.
    pub fn to_value(&self) -> Value {
        let mut table = Map::new();
        table.insert("kind".into(), self.entry.kind.into());
        if let Some(range) = self.coefficients {
            table.insert("coefficients".into(), Value::from(range.to_vec()));
        }
        if let Value::Object(parameters) = &self.parameters {
            table.extend(parameters.clone());
        }
        Value::Object(table)
    }

    /// Plans the feature for signals of `sr` Hz.
    ///
    /// # Errors
    /// Parameters that are impossible at this rate.
    pub fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        (self.planner)(sr)
    }
}
