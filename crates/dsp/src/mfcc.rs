//! Cosine transforms and cepstral coefficients (librosa 0.11 `feature.mfcc`, scipy `fft.dct`).

use std::f64::consts::{PI, SQRT_2};

use ndarray::linalg::general_mat_mul;
use ndarray::{Array2, Array3, ArrayView3, s};
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};
use crate::real::Real;
use crate::tiles::for_each_tile;

/// Normalisation of a cosine transform.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DctNorm {
    /// Orthonormal rows.
    #[default]
    Ortho,
    /// scipy's unnormalised definition.
    None,
}

/// Parameters of the cepstrum, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MfccParams {
    /// Coefficients kept; more than the mel bands gives as many as there are bands, as in librosa.
    pub n_mfcc: usize,
    /// Cosine transform of type 1, 2 or 3.
    pub dct_type: u8,
    /// Normalisation of the transform.
    pub norm: DctNorm,
    /// Cepstral liftering; 0 for none.
    pub lifter: f64,
}

impl Default for MfccParams {
    fn default() -> Self {
        Self { n_mfcc: 20, dct_type: 2, norm: DctNorm::Ortho, lifter: 0.0 }
    }
}

/// Entry `[k, n]` of the cosine transform of `len` points.
fn dct_entry(dct_type: u8, norm: DctNorm, len: usize, k: usize, n: usize) -> f64 {
    let (size, kf, nf) = (len as f64, k as f64, n as f64);
    let ortho = norm == DctNorm::Ortho;
    match dct_type {
        1 => {
            let last = size - 1.0;
            let edge = |i: usize| i == 0 || i == len - 1;
            let cosine = (PI * kf * nf / last).cos();
            let plain = if edge(n) { cosine } else { 2.0 * cosine };
            if !ortho {
                return plain;
            }
            let input = if edge(n) { SQRT_2 } else { 1.0 };
            let output = if edge(k) { 1.0 / last } else { 2.0 / last };
            plain * input * 0.5 * output.sqrt()
        }
        2 => {
            let plain = 2.0 * (PI * kf * (2.0 * nf + 1.0) / (2.0 * size)).cos();
            let scale = if k == 0 { 1.0 / (4.0 * size) } else { 1.0 / (2.0 * size) };
            if ortho { plain * scale.sqrt() } else { plain }
        }
        _ => {
            let cosine = (PI * (2.0 * kf + 1.0) * nf / (2.0 * size)).cos();
            match (ortho, n) {
                (false, 0) => 1.0,
                (false, _) => 2.0 * cosine,
                (true, 0) => 1.0 / size.sqrt(),
                (true, _) => (2.0 / size).sqrt() * cosine,
            }
        }
    }
}

/// The matrix `[n_mfcc, n_mels]` that turns a log-mel frame into liftered cepstral coefficients.
///
/// # Errors
/// An impossible `dct_type` (1 needs two bands at least), `n_mfcc = 0`, a negative `lifter`, or a
/// lifter with more coefficients than bands (librosa cannot broadcast there).
pub fn mfcc_matrix(n_mels: usize, p: &MfccParams) -> Result<Array2<f64>> {
    if !(1..=3).contains(&p.dct_type) {
        return Err(DspError::parameter("dct_type", p.dct_type, "1, 2 or 3"));
    }
    if p.dct_type == 1 && n_mels < 2 {
        return Err(DspError::parameter("dct_type", 1, "2 or 3 if there is one mel band"));
    }
    if p.n_mfcc == 0 {
        return Err(DspError::parameter("n_mfcc", 0, "at least 1"));
    }
    if p.lifter.is_nan() || p.lifter < 0.0 {
        return Err(DspError::parameter("lifter", p.lifter, "0 or more"));
    }
    if p.lifter > 0.0 && p.n_mfcc > n_mels {
        let allowed = format!("at most n_mels ({n_mels}) when lifter is set");
        return Err(DspError::parameter("n_mfcc", p.n_mfcc, allowed));
    }
    let lift = |k: usize| {
        if p.lifter > 0.0 {
            1.0 + p.lifter / 2.0 * (PI * (k + 1) as f64 / p.lifter).sin()
        } else {
            1.0
        }
    };
    Ok(Array2::from_shape_fn((p.n_mfcc.min(n_mels), n_mels), |(k, n)| {
        lift(k) * dct_entry(p.dct_type, p.norm, n_mels, k, n)
    }))
}

/// Cepstral coefficients `[channels, n_mfcc, frames]` of a log-power mel spectrogram
/// `[channels, n_mels, frames]` (librosa 0.11 `feature.mfcc` given `S`).
///
/// # Errors
/// As [`mfcc_matrix`].
pub fn mfcc<T: Real>(log_mel: ArrayView3<T>, p: &MfccParams) -> Result<Array3<T>> {
    let (channels, n_mels, frames) = log_mel.dim();
    let matrix = mfcc_matrix(n_mels, p)?.mapv(T::of);
    let mut out = Array3::zeros((channels, matrix.nrows(), frames));
    for_each_tile(
        out.view_mut(),
        || (),
        |(), mut tile| {
            let frames = tile.first..tile.first + tile.out.ncols();
            let log_mel = log_mel.slice(s![tile.channel, .., frames]);
            general_mat_mul(T::one(), &matrix, &log_mel, T::zero(), &mut tile.out);
        },
    );
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orthonormal_types_are_orthonormal() {
        for dct_type in 1..=3 {
            let p = MfccParams { n_mfcc: 16, dct_type, ..MfccParams::default() };
            let m = mfcc_matrix(16, &p).unwrap();
            let gram = m.dot(&m.t());
            for ((i, j), g) in gram.indexed_iter() {
                let want = if i == j { 1.0 } else { 0.0 };
                assert!((g - want).abs() < 1e-12, "type {dct_type} [{i},{j}] = {g}");
            }
        }
    }

    #[test]
    fn lifter_with_too_many_coefficients_is_refused() {
        let p = MfccParams { n_mfcc: 30, lifter: 22.0, ..MfccParams::default() };
        assert!(mfcc_matrix(26, &p).is_err());
        assert_eq!(mfcc_matrix(26, &MfccParams { lifter: 0.0, ..p }).unwrap().nrows(), 26);
    }
}
