//! Parameter groups that several features share, with librosa's names and defaults.

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::mel::{MelNorm, MelParams};
use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::time_domain::FrameParams;
use corsmal_dsp::window::Window;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Short-time transform. Features with equal groups share one transform.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct StftSpec {
    /// Length of the transform in samples.
    pub n_fft: usize,
    /// Samples between frames.
    pub hop_length: usize,
    /// Length of the window; 0 is `n_fft`.
    pub win_length: usize,
    /// Window function.
    pub window: Window,
    /// Frames are centred on multiples of the hop.
    pub center: bool,
    /// Padding at the ends.
    pub pad_mode: PadMode,
}

impl Default for StftSpec {
    fn default() -> Self {
        Self {
            n_fft: 2048,
            hop_length: 512,
            win_length: 0,
            window: Window::Hann,
            center: true,
            pad_mode: PadMode::Constant,
        }
    }
}

impl StftSpec {
    /// The checked parameters.
    pub fn params(&self) -> corsmal_dsp::Result<StftParams> {
        let params = StftParams {
            n_fft: self.n_fft,
            hop_length: self.hop_length,
            win_length: if self.win_length == 0 { self.n_fft } else { self.win_length },
            window: self.window.clone(),
            center: self.center,
            pad_mode: self.pad_mode,
        };
        params.check()?;
        at_most("n_fft", self.n_fft, MAX_N_FFT)?;
        Ok(params)
    }
}

/// Longest transform; bounds the memory of windows and filter banks.
pub(crate) const MAX_N_FFT: usize = 1 << 18;
/// Longest frame of the waveform.
const MAX_FRAME: usize = 1 << 24;

/// Refuses values above `limit`.
pub(crate) fn at_most(name: &'static str, value: usize, limit: usize) -> corsmal_dsp::Result<()> {
    if value <= limit {
        return Ok(());
    }
    Err(corsmal_dsp::DspError::parameter(name, value, format!("at most {limit}")))
}

/// Mel filter bank, its norm apart (librosa calls that `norm` or `mel_norm`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct MelSpec {
    /// Number of bands.
    pub n_mels: usize,
    /// Lowest frequency in Hz.
    pub fmin: f64,
    /// Highest frequency in Hz; 0 is half the sample rate.
    pub fmax: f64,
    /// HTK's formula instead of Slaney's.
    pub htk: bool,
}

impl Default for MelSpec {
    fn default() -> Self {
        Self { n_mels: 128, fmin: 0.0, fmax: 0.0, htk: false }
    }
}

impl MelSpec {
    /// Parameters for a sample rate and transform length.
    pub fn params(&self, sr: f64, n_fft: usize, norm: MelNorm) -> MelParams {
        let fmax = (self.fmax != 0.0).then_some(self.fmax);
        MelParams { sr, n_fft, n_mels: self.n_mels, fmin: self.fmin, fmax, htk: self.htk, norm }
    }
}

/// The reference of a conversion to decibels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum DbRef {
    /// This value becomes 0 dB.
    Value(f64),
    /// The maximum becomes 0 dB.
    Max,
}

/// Range kept below the maximum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TopDb {
    /// In dB.
    Range(f64),
    /// Everything.
    None,
}

/// Unit of the output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// As computed.
    #[default]
    Linear,
    /// `10 log10` (librosa.power_to_db).
    PowerToDb,
    /// `20 log10` (librosa.amplitude_to_db): values, reference and smallest value are squared first.
    AmplitudeToDb,
}

/// A number, or the word `auto`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AutoOr {
    /// This one.
    Value(f64),
    /// What suits.
    Auto,
}

/// A number or one word.
fn number_or_word<'de, D: Deserializer<'de>>(d: D, word: &str) -> Result<Option<f64>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Raw {
        Number(f64),
        Word(String),
    }
    match Raw::deserialize(d) {
        Ok(Raw::Number(n)) => Ok(Some(n)),
        Ok(Raw::Word(w)) if w == word => Ok(None),
        _ => Err(serde::de::Error::custom(format!("expected a number or \"{word}\""))),
    }
}

/// A variant with a number is that number, the other one its word.
macro_rules! number_or_word {
    ($type:ident, $number:ident, $other:ident, $word:literal) => {
        impl Serialize for $type {
            fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                match self {
                    Self::$number(v) => s.serialize_f64(*v),
                    Self::$other => s.serialize_str($word),
                }
            }
        }

        impl<'de> Deserialize<'de> for $type {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                Ok(number_or_word(d, $word)?.map_or(Self::$other, Self::$number))
            }
        }
    };
}

number_or_word!(DbRef, Value, Max, "max");
number_or_word!(TopDb, Range, None, "none");
number_or_word!(AutoOr, Value, Auto, "auto");

/// Conversion to decibels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DbSpec {
    /// Value (or `"max"`) that becomes 0 dB.
    #[serde(rename = "ref")]
    pub reference: DbRef,
    /// Smallest value told apart from zero, in the unit of the values; `auto` is librosa's default,
    /// 1e-10 of a power and 1e-5 of an amplitude.
    pub amin: AutoOr,
    /// Range kept below the maximum, in dB, or `"none"`.
    pub top_db: TopDb,
    /// The maximum is that of each channel (false) or of all channels, as librosa 0.11 takes it on
    /// multi-channel arrays (true).
    pub joint: bool,
}

impl Default for DbSpec {
    fn default() -> Self {
        Self {
            reference: DbRef::Value(1.0),
            amin: AutoOr::Auto,
            top_db: TopDb::Range(80.0),
            joint: false,
        }
    }
}

impl DbSpec {
    /// The checked parameters, for powers: those of an amplitude are squared. A reference of `"max"`
    /// is left at 1 here and applied by [`DbSpec::level`].
    pub fn decibel(&self, scale: Scale) -> corsmal_dsp::Result<Decibel> {
        let reference = match self.reference {
            DbRef::Value(v) => v,
            DbRef::Max => 1.0,
        };
        let top_db = match self.top_db {
            TopDb::Range(v) => Some(v),
            TopDb::None => None,
        };
        let power = |value: f64| if scale == Scale::AmplitudeToDb { value * value } else { value };
        let amin = match (self.amin, scale) {
            (AutoOr::Value(amin), _) => amin,
            (AutoOr::Auto, Scale::AmplitudeToDb) => 1e-5,
            (AutoOr::Auto, _) => 1e-10,
        };
        Decibel { reference, amin, top_db }.check()?;
        if power(amin) < f64::from(f32::MIN_POSITIVE) {
            let allowed = "at least 1.2e-38, its square too where values are amplitudes (features \
                           are single precision)";
            return Err(corsmal_dsp::DspError::parameter("amin", amin, allowed));
        }
        Ok(Decibel { reference: power(reference), amin: power(amin), top_db })
    }

    /// Whether values depend on the maximum of the recording.
    pub fn needs_peak(&self) -> bool {
        self.reference == DbRef::Max || self.top_db != TopDb::None
    }

    /// What is subtracted from every value, and the floor below the maximum, given that maximum.
    pub fn level(&self, peak: f32) -> (f32, f32) {
        let shift = if self.reference == DbRef::Max { peak } else { 0.0 };
        let floor = match self.top_db {
            TopDb::Range(range) => peak - range as f32,
            TopDb::None => f32::NEG_INFINITY,
        };
        (shift, floor)
    }
}

/// Frames of the waveform.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameSpec {
    /// Samples in a frame.
    pub frame_length: usize,
    /// Samples between frames.
    pub hop_length: usize,
    /// Frames are centred on multiples of the hop.
    pub center: bool,
}

impl Default for FrameSpec {
    fn default() -> Self {
        Self { frame_length: 2048, hop_length: 512, center: true }
    }
}

impl FrameSpec {
    /// The checked parameters.
    pub fn params(&self) -> corsmal_dsp::Result<FrameParams> {
        let params = FrameParams {
            frame_length: self.frame_length,
            hop_length: self.hop_length,
            center: self.center,
        };
        params.check()?;
        at_most("frame_length", self.frame_length, MAX_FRAME)?;
        Ok(params)
    }
}
