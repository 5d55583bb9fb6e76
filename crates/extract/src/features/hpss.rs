//! `hpss`: the harmonic or the percussive part of a spectrogram.

use corsmal_dsp::hpss::{HpssParams, masks};
use corsmal_dsp::stft::{StftParams, spectrogram};
use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Deserializer, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::hertz;
use crate::params::{Keys, StftSpec, at_most};

/// Longest median in frames or bins: the time of each grows with it.
const MAX_KERNEL: usize = 1024;

/// A part of the sound.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Component {
    /// What is steady along time.
    #[default]
    Harmonic,
    /// What is spread over frequency.
    Percussive,
}

/// Parameters of `hpss`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Hpss {
    #[serde(flatten)]
    stft: StftSpec,
    component: Component,
    /// Frames of the filter along time, bins of the filter along frequency; or one number for both.
    #[serde(deserialize_with = "one_or_two")]
    kernel_size: [usize; 2],
    #[serde(with = "exponent")]
    power: f64,
    /// Of the harmonic and of the percussive mask; or one number for both.
    #[serde(deserialize_with = "one_or_two")]
    margin: [f64; 2],
}

/// A number, or `"inf"`, which JSON has no number for.
mod exponent {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub(super) fn serialize<S: Serializer>(power: &f64, s: S) -> Result<S::Ok, S::Error> {
        if power.is_infinite() { s.serialize_str("inf") } else { s.serialize_f64(*power) }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(value: D) -> Result<f64, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "expected a number or \"inf\"")]
        enum Power {
            Number(f64),
            Word(String),
        }
        match Power::deserialize(value)? {
            Power::Number(power) => Ok(power),
            Power::Word(word) if word == "inf" => Ok(f64::INFINITY),
            Power::Word(word) => {
                Err(D::Error::custom(format!("must be a number or \"inf\", not \"{word}\"")))
            }
        }
    }
}

/// `[a, b]`, or `a` for `[a, a]`, as librosa takes them.
fn one_or_two<'de, D: Deserializer<'de>, T: Deserialize<'de> + Copy>(
    value: D,
) -> Result<[T; 2], D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a number or a list of two")]
    enum OneOrTwo<T> {
        One(T),
        Two([T; 2]),
    }
    Ok(match OneOrTwo::deserialize(value)? {
        OneOrTwo::One(both) => [both, both],
        OneOrTwo::Two(each) => each,
    })
}

impl Default for Hpss {
    fn default() -> Self {
        let p = HpssParams::default();
        Self {
            stft: StftSpec::default(),
            component: Component::default(),
            kernel_size: [p.kernel_harmonic, p.kernel_percussive],
            power: p.power,
            margin: [p.margin_harmonic, p.margin_percussive],
        }
    }
}

struct Magnitudes {
    stft: StftParams,
    params: HpssParams,
    component: Component,
}

impl WholeKernel for Magnitudes {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let y = ArrayView2::from_shape((1, y.len()), y).expect("one row");
        let magnitude = spectrogram(y, &self.stft, 1.0)?;
        let (harmonic, percussive) = masks(magnitude.view(), &self.params)?;
        let mask = match self.component {
            Component::Harmonic => harmonic,
            Component::Percussive => percussive,
        };
        Ok((magnitude * mask).index_axis_move(Axis(0), 0))
    }

    fn bytes_per_sample(&self) -> u64 {
        // Spectrum, two masks and their medians: 40 with the default overlap.
        10 * (self.stft.n_fft as u64).div_ceil(self.stft.hop_length.max(1) as u64)
    }
}

impl FeatureKind for Hpss {
    const KIND: &'static str = "hpss";
    const ABOUT: &'static str = "Magnitudes of the harmonic or percussive component of the sound, \
                                 separated by medians over kernel_size frames and \
                                 bins (librosa.decompose.hpss of |stft|): one \
        value per frequency bin. Holds the whole recording in memory.";
    const KEYS: &'static [Keys] = &[
        StftSpec::KEYS,
        &[
            ("component", "The part to keep: harmonic (steady in time) or percussive."),
            (
                "kernel_size",
                "Frames of the median along time, bins of the median along frequency; one number for both.",
            ),
            ("power", "Exponent of the masks; \"inf\" is a hard mask."),
            (
                "margin",
                "Factors by which a part must exceed the other, harmonic and percussive; one number for both.",
            ),
        ],
    ];
    const PYTHON: &'static str = "decompose.hpss";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let stft = self.stft.params()?;
        self.kernel_size.iter().try_for_each(|&n| at_most("kernel_size", n, MAX_KERNEL))?;
        let params = HpssParams {
            kernel_harmonic: self.kernel_size[0],
            kernel_percussive: self.kernel_size[1],
            power: self.power,
            margin_harmonic: self.margin[0],
            margin_percussive: self.margin[1],
        };
        params.check()?;
        let n_fft = stft.n_fft as f64;
        let labels = (0..stft.n_bins()).map(|k| hertz(k as f64 * sr / n_fft)).collect();
        let extent = Extent::Frames(stft.hop_length as f64);
        let kernel = Magnitudes { stft, params, component: self.component };
        Ok(Feature::whole(extent, kernel, labels))
    }
}
