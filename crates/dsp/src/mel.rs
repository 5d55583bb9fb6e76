//! Mel scale and filter bank (librosa 0.11 `filters.mel`, `feature.melspectrogram`).

use std::str::FromStr;

use ndarray::{Array2, Array3, ArrayView3, Axis, s};
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};
use crate::lanes::{Row, weighted_sums};
use crate::real::Real;
use crate::tiles::for_each_tile;

/// Normalisation of each mel filter.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum MelNorm {
    /// Unit area: the triangle is multiplied by `2 / (right - left)` in 1/Hz.
    #[default]
    Slaney,
    /// Peak 1.
    None,
    /// Each row divided by its p-norm (`f64::INFINITY` for the maximum).
    P(f64),
}

impl FromStr for MelNorm {
    type Err = DspError;

    fn from_str(text: &str) -> Result<Self> {
        match (text, text.parse::<f64>()) {
            ("slaney", _) => Ok(Self::Slaney),
            ("none", _) => Ok(Self::None),
            (_, Ok(p)) if p > 0.0 => Ok(Self::P(p)),
            _ => Err(DspError::parameter("norm", text, "'slaney', None, inf or a positive number")),
        }
    }
}

impl Serialize for MelNorm {
    fn serialize<S: serde::Serializer>(&self, s: S) -> std::result::Result<S::Ok, S::Error> {
        match self {
            Self::Slaney => s.serialize_str("slaney"),
            Self::None => s.serialize_str("none"),
            Self::P(p) if p.is_infinite() => s.serialize_str("inf"),
            Self::P(p) => s.serialize_f64(*p),
        }
    }
}

impl<'de> Deserialize<'de> for MelNorm {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> std::result::Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Raw {
            Name(String),
            Number(f64),
        }
        match Raw::deserialize(d)? {
            Raw::Name(n) if n == "slaney" => Ok(Self::Slaney),
            Raw::Name(n) if n == "none" => Ok(Self::None),
            Raw::Name(n) if n == "inf" => Ok(Self::P(f64::INFINITY)),
            Raw::Number(p) if p > 0.0 => Ok(Self::P(p)),
            Raw::Name(n) => Err(serde::de::Error::custom(format!(
                "norm must be \"slaney\", \"none\", \"inf\" or a positive number, not \"{n}\""
            ))),
            Raw::Number(p) => {
                Err(serde::de::Error::custom(format!("norm must be a positive number, not {p}")))
            }
        }
    }
}

/// Parameters of a mel filter bank, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MelParams {
    /// Sample rate in Hz.
    pub sr: f64,
    /// Length of the transform in samples.
    pub n_fft: usize,
    /// Number of bands.
    pub n_mels: usize,
    /// Lowest frequency in Hz.
    pub fmin: f64,
    /// Highest frequency in Hz; `None` is `sr / 2`.
    pub fmax: Option<f64>,
    /// HTK's formula instead of Slaney's.
    pub htk: bool,
    /// Normalisation of the rows.
    pub norm: MelNorm,
}

impl MelParams {
    /// librosa's defaults: 128 bands from 0 to `sr / 2`, Slaney's formula and norm.
    pub fn new(sr: f64, n_fft: usize) -> Self {
        Self { sr, n_fft, n_mels: 128, fmin: 0.0, fmax: None, htk: false, norm: MelNorm::Slaney }
    }

    fn check(&self) -> Result<f64> {
        let refuse =
            |name, value: f64, allowed: String| Err(DspError::parameter(name, value, allowed));
        if !(self.sr.is_finite() && self.sr > 0.0) {
            return refuse("sr", self.sr, "a positive sample rate in Hz".into());
        }
        if self.n_fft == 0 || self.n_mels == 0 {
            let name = if self.n_fft == 0 { "n_fft" } else { "n_mels" };
            return refuse(name, 0.0, "at least 1".into());
        }
        let fmax = self.fmax.unwrap_or(self.sr / 2.0);
        if !(self.fmin.is_finite() && self.fmin >= 0.0) {
            return refuse("fmin", self.fmin, "0 or more, in Hz".into());
        }
        if !(fmax.is_finite() && fmax > self.fmin) {
            return refuse("fmax", fmax, format!("above fmin ({} Hz)", self.fmin));
        }
        Ok(fmax)
    }
}

/// Hz to mel (Slaney's auditory toolbox, or HTK's formula).
pub fn hz_to_mel(hz: f64, htk: bool) -> f64 {
    if htk {
        2595.0 * (1.0 + hz / 700.0).log10()
    } else if hz >= 1000.0 {
        15.0 + (hz / 1000.0).ln() / (6.4_f64.ln() / 27.0)
    } else {
        hz / (200.0 / 3.0)
    }
}

/// Mel to Hz, the inverse of [`hz_to_mel`].
pub fn mel_to_hz(mel: f64, htk: bool) -> f64 {
    if htk {
        700.0 * (10.0_f64.powf(mel / 2595.0) - 1.0)
    } else if mel >= 15.0 {
        1000.0 * (6.4_f64.ln() / 27.0 * (mel - 15.0)).exp()
    } else {
        200.0 / 3.0 * mel
    }
}

/// `n` frequencies in Hz, equally spaced in mel from `fmin` to `fmax` (librosa `mel_frequencies`).
pub fn mel_frequencies(n: usize, fmin: f64, fmax: f64, htk: bool) -> Vec<f64> {
    let (low, high) = (hz_to_mel(fmin, htk), hz_to_mel(fmax, htk));
    let step = if n > 1 { (high - low) / (n - 1) as f64 } else { 0.0 };
    let mel = |i: usize| if n > 1 && i == n - 1 { high } else { low + i as f64 * step };
    (0..n).map(|i| mel_to_hz(mel(i), htk)).collect()
}

/// The filter bank `[n_mels, n_fft / 2 + 1]`, always `f32` as librosa stores it
/// (`filters.mel`): triangles on the exact bin frequencies, not snapped to bins.
///
/// A bank with empty rows is returned as it is; ask [`empty_filters`] to warn as librosa does.
///
/// # Errors
/// Impossible parameters.
pub fn mel_filter(p: &MelParams) -> Result<Array2<f32>> {
    let fmax = p.check()?;
    let points = mel_frequencies(p.n_mels + 2, p.fmin, fmax, p.htk);
    let bin = |k: usize| k as f64 * (p.sr / p.n_fft as f64);
    let mut bank = Array2::<f32>::zeros((p.n_mels, p.n_fft / 2 + 1));
    for (i, mut row) in bank.axis_iter_mut(Axis(0)).enumerate() {
        let (left, center, right) = (points[i], points[i + 1], points[i + 2]);
        // The others are zero.
        let inside = |(k, _): &(usize, &mut f32)| bin(*k) <= right;
        let first = ((left / bin(1)) as usize).min(row.len());
        for (k, weight) in row.iter_mut().enumerate().skip(first).take_while(inside) {
            let f = bin(k);
            let rise = (f - left) / (center - left);
            let fall = (right - f) / (right - center);
            *weight = rise.min(fall).max(0.0) as f32;
        }
        let scale = match p.norm {
            MelNorm::None => continue,
            MelNorm::Slaney => 2.0 / (right - left),
            MelNorm::P(p) => {
                let length = if p.is_infinite() {
                    row.iter().fold(0.0, |m: f64, w| m.max(f64::from(*w)))
                } else {
                    row.iter().map(|w| f64::from(*w).powf(p)).sum::<f64>().powf(1.0 / p)
                };
                if length < f64::from(f32::MIN_POSITIVE) { 1.0 } else { 1.0 / length }
            }
        };
        row.mapv_inplace(|w| (f64::from(w) * scale) as f32);
    }
    Ok(bank)
}

/// Rows of a filter bank that hold no bin at all (librosa warns of them).
pub fn empty_filters(bank: &Array2<f32>) -> Vec<usize> {
    let empty =
        |(i, row): (usize, ndarray::ArrayView1<f32>)| row.iter().all(|w| *w == 0.0).then_some(i);
    bank.axis_iter(Axis(0)).enumerate().filter_map(empty).collect()
}

/// A filter bank without its zeros: for each band the first bin and the weights from there on.
#[derive(Debug, Clone)]
pub struct SparseBank {
    bins: usize,
    bands: Vec<(usize, Vec<f32>)>,
}

impl SparseBank {
    /// The non-zero span of each row of `bank [bands, bins]`.
    pub fn new(bank: &Array2<f32>) -> Self {
        let span = |row: ndarray::ArrayView1<f32>| {
            let row = row.to_vec();
            let first = row.iter().position(|w| *w != 0.0).unwrap_or(0);
            let last = row.iter().rposition(|w| *w != 0.0).map_or(first, |i| i + 1);
            (first, row[first..last].to_vec())
        };
        Self { bins: bank.ncols(), bands: bank.axis_iter(Axis(0)).map(span).collect() }
    }

    /// Bins of the spectra that the bank is for.
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// For each band its first bin and weights.
    pub fn bands(&self) -> &[(usize, Vec<f32>)] {
        &self.bands
    }

    /// `bank @ power` for the rows of one lane block, `[bins] -> [bands]`.
    pub fn apply_rows(&self, power: &[Row], out: &mut [Row]) {
        weighted_sums(&self.bands, power, out);
    }

    /// [`apply`](Self::apply) to a spectrum that may not fit.
    ///
    /// # Errors
    /// Another number of bins.
    pub fn product<T: Real>(&self, spectrum: ArrayView3<T>) -> Result<Array3<T>> {
        if spectrum.dim().1 != self.bins {
            let expected = format!("{} bins for this n_fft", self.bins);
            let actual = spectrum.shape().to_vec();
            return Err(DspError::Shape { name: "S", expected, actual });
        }
        Ok(self.apply(spectrum))
    }

    /// `bank @ spectrum` for `spectrum [channels, bins, frames]`.
    pub fn apply<T: Real>(&self, spectrum: ArrayView3<T>) -> Array3<T> {
        let (channels, _, frames) = spectrum.dim();
        let mut out = Array3::zeros((channels, self.bands.len(), frames));
        for_each_tile(
            out.view_mut(),
            || (),
            |(), mut tile| {
                let frames = tile.first..tile.first + tile.out.ncols();
                let spectrum = spectrum.slice(s![tile.channel, .., frames]);
                for ((first, weights), mut band) in self.bands.iter().zip(tile.out.outer_iter_mut())
                {
                    for (w, bin) in
                        weights.iter().zip(spectrum.slice(s![*first.., ..]).outer_iter())
                    {
                        band.scaled_add(T::of(f64::from(*w)), &bin);
                    }
                }
            },
        );
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scales_are_inverse() {
        for htk in [false, true] {
            for hz in [0.0, 440.0, 1000.0, 7000.0] {
                assert!((mel_to_hz(hz_to_mel(hz, htk), htk) - hz).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn impossible_ranges_are_refused() {
        let p = MelParams { fmin: 5000.0, fmax: Some(4000.0), ..MelParams::new(16000.0, 512) };
        let said = mel_filter(&p).unwrap_err().to_string();
        assert_eq!(said, "fmax must be above fmin (5000 Hz), not 4000");
    }

    #[test]
    fn sparse_equals_dense() {
        let bank = mel_filter(&MelParams { n_mels: 20, ..MelParams::new(16000.0, 512) }).unwrap();
        let s = Array3::from_shape_fn((2, 257, 3), |(c, k, t)| (c + k * t) as f64);
        let got = SparseBank::new(&bank).apply(s.view());
        let want: f64 = (0..257).map(|k| f64::from(bank[[7, k]]) * s[[1, k, 2]]).sum();
        assert!((got[[1, 7, 2]] - want).abs() < 1e-9 * want);
    }
}
