//! Window functions with scipy's names and definitions (`scipy.signal.get_window`).

use std::f64::consts::PI;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};

/// A window function, by scipy's name.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum Window {
    /// 0.5 - 0.5 cos
    #[default]
    Hann,
    /// 0.54 - 0.46 cos
    Hamming,
    /// Three-term Blackman.
    Blackman,
    /// Four-term minimum Blackman-Harris.
    BlackmanHarris,
    /// Four-term Nuttall.
    Nuttall,
    /// Five-term flat top.
    FlatTop,
    /// Triangle with zero end points.
    Bartlett,
    /// Triangle with non-zero end points.
    Triang,
    /// Half a sine.
    Cosine,
    /// All ones.
    Boxcar,
    /// Kaiser window with its shape parameter beta.
    Kaiser(f64),
}

const NAMES: &str = "hann, hamming, blackman, blackmanharris, nuttall, flattop, bartlett, triang, \
                     cosine, boxcar (or ones, rectangular), kaiser:BETA";

impl FromStr for Window {
    type Err = DspError;

    fn from_str(name: &str) -> Result<Self> {
        Ok(match name {
            "hann" | "hanning" => Self::Hann,
            "hamming" => Self::Hamming,
            "blackman" => Self::Blackman,
            "blackmanharris" => Self::BlackmanHarris,
            "nuttall" => Self::Nuttall,
            "flattop" => Self::FlatTop,
            "bartlett" => Self::Bartlett,
            "triang" | "triangle" => Self::Triang,
            "cosine" | "halfcosine" => Self::Cosine,
            "boxcar" | "ones" | "rectangular" | "rect" => Self::Boxcar,
            _ => {
                let beta = name.strip_prefix("kaiser:").and_then(|b| b.parse().ok());
                match beta {
                    Some(b) if f64::is_finite(b) && b >= 0.0 => Self::Kaiser(b),
                    _ => {
                        return Err(DspError::parameter("window", name, format!("one of {NAMES}")));
                    }
                }
            }
        })
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Hann => "hann",
            Self::Hamming => "hamming",
            Self::Blackman => "blackman",
            Self::BlackmanHarris => "blackmanharris",
            Self::Nuttall => "nuttall",
            Self::FlatTop => "flattop",
            Self::Bartlett => "bartlett",
            Self::Triang => "triang",
            Self::Cosine => "cosine",
            Self::Boxcar => "boxcar",
            Self::Kaiser(beta) => return write!(f, "kaiser:{beta}"),
        };
        f.write_str(name)
    }
}

impl Serialize for Window {
    fn serialize<S: serde::Serializer>(&self, s: S) -> std::result::Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Window {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> std::result::Result<Self, D::Error> {
        let name = std::borrow::Cow::<str>::deserialize(d)?;
        name.parse().map_err(serde::de::Error::custom)
    }
}

/// The window of `nx` points in double precision (`scipy.signal.get_window(window, nx, fftbins)`).
///
/// `fftbins = true` gives the periodic window that spectral analysis uses, `false` the symmetric one.
pub fn get_window(window: Window, nx: usize, fftbins: bool) -> Vec<f64> {
    if nx <= 1 {
        return vec![1.0; nx];
    }
    // The periodic window is the symmetric one of one more point, without its last point.
    let m = if fftbins { nx + 1 } else { nx };
    let last = (m - 1) as f64;
    let cosines = |terms: &[f64]| -> Vec<f64> {
        (0..nx)
            .map(|i| {
                let x = -PI + 2.0 * PI * i as f64 / last;
                terms.iter().enumerate().map(|(k, a)| a * (k as f64 * x).cos()).sum()
            })
            .collect()
    };
    match window {
        Window::Hann => cosines(&[0.5, 0.5]),
        Window::Hamming => cosines(&[0.54, 0.46]),
        Window::Blackman => cosines(&[0.42, 0.50, 0.08]),
        Window::BlackmanHarris => cosines(&[0.35875, 0.48829, 0.14128, 0.01168]),
        Window::Nuttall => cosines(&[0.3635819, 0.4891775, 0.1365995, 0.0106411]),
        Window::FlatTop => {
            cosines(&[0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368])
        }
        Window::Bartlett => (0..nx)
            .map(|i| {
                let x = 2.0 * i as f64 / last;
                if x <= 1.0 { x } else { 2.0 - x }
            })
            .collect(),
        Window::Triang => {
            let value = |i: usize| {
                let n = (i.min(m - 1 - i) + 1) as f64;
                if m % 2 == 0 { (2.0 * n - 1.0) / m as f64 } else { 2.0 * n / (m as f64 + 1.0) }
            };
            (0..nx).map(value).collect()
        }
        Window::Cosine => (0..nx).map(|i| (PI / m as f64 * (i as f64 + 0.5)).sin()).collect(),
        Window::Boxcar => vec![1.0; nx],
        Window::Kaiser(beta) => {
            let alpha = last / 2.0;
            (0..nx)
                .map(|i| {
                    let r = (i as f64 - alpha) / alpha;
                    bessel_i0(beta * (1.0 - r * r).max(0.0).sqrt()) / bessel_i0(beta)
                })
                .collect()
        }
    }
}

/// Modified Bessel function of the first kind, order zero (power series; exact to rounding for the
/// arguments that filter design uses).
pub fn bessel_i0(x: f64) -> f64 {
    let q = x * x / 4.0;
    let (mut term, mut sum, mut k) = (1.0, 1.0, 1.0);
    while term > sum * 1e-17 {
        term *= q / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// The periodic window of `win_length` points, zero-padded to `n_fft` as librosa centres it
/// (`left = (n_fft - win_length) / 2`).
pub fn padded_window(window: Window, win_length: usize, n_fft: usize) -> Result<Vec<f64>> {
    if win_length == 0 || win_length > n_fft {
        return Err(DspError::parameter("win_length", win_length, format!("1 to n_fft ({n_fft})")));
    }
    let mut padded = vec![0.0; n_fft];
    let left = (n_fft - win_length) / 2;
    padded[left..left + win_length].copy_from_slice(&get_window(window, win_length, true));
    Ok(padded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for name in ["hann", "hamming", "nuttall", "kaiser:8.6"] {
            assert_eq!(name.parse::<Window>().unwrap().to_string(), name);
        }
        assert!("hanny".parse::<Window>().is_err());
        assert!("kaiser:-1".parse::<Window>().is_err());
    }

    #[test]
    fn periodic_hann() {
        let w = get_window(Window::Hann, 4, true);
        for (a, b) in w.iter().zip([0.0, 0.5, 1.0, 0.5]) {
            assert!((a - b).abs() < 1e-15);
        }
    }
}
