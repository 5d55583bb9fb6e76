//! Features of the shape of a spectrum.

use corsmal_dsp::frequency::fft_frequencies as dsp_fft_frequencies;
use corsmal_dsp::mono::to_mono as dsp_to_mono;
use corsmal_dsp::spectral::{self, Bandwidth, Contrast, ContrastParams, Flatness, Frequencies};
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::arrays::{Floats, Source, each_precision, each_spectra, into_numpy, view2, view3};
use crate::errors::value_error;

/// Row frequencies of a spectrogram: `[bins]`, or `[channels, bins, frames]`.
fn frequencies<'a>(freq: &'a PyReadonlyArrayDyn<'_, f64>) -> PyResult<Frequencies<'a>> {
    if freq.ndim() == 1 {
        Ok(Frequencies::Bins(freq.as_slice()?))
    } else {
        Ok(Frequencies::Frames(view3(freq)?))
    }
}

#[pyfunction]
pub(crate) fn fft_frequencies(py: Python<'_>, sr: f64, n_fft: usize) -> PyResult<Bound<'_, PyAny>> {
    let freqs = dsp_fft_frequencies(sr, n_fft).map_err(value_error)?;
    into_numpy(py, ndarray::Array1::from_vec(freqs))
}

#[pyfunction]
pub(crate) fn to_mono<'py>(py: Python<'py>, y: Floats<'py>) -> PyResult<Bound<'py, PyAny>> {
    each_precision!(py, view2(y), dsp_to_mono(y))
}

#[pyfunction]
pub(crate) fn spectral_centroid<'py>(
    py: Python<'py>,
    s: Source<'py>,
    freq: PyReadonlyArrayDyn<'py, f64>,
) -> PyResult<Bound<'py, PyAny>> {
    let freq = frequencies(&freq)?;
    each_spectra!(py, s, spectral::spectral_centroid(s, freq))
}

#[pyfunction]
pub(crate) fn spectral_bandwidth<'py>(
    py: Python<'py>,
    s: Source<'py>,
    freq: PyReadonlyArrayDyn<'py, f64>,
    centroid: Option<PyReadonlyArrayDyn<'py, f64>>,
    norm: bool,
    p: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let (freq, params) = (frequencies(&freq)?, Bandwidth { p, norm });
    let centroid = centroid.as_ref().map(view2).transpose()?;
    each_spectra!(py, s, spectral::spectral_bandwidth(s, freq, centroid, params))
}

#[pyfunction]
pub(crate) fn spectral_rolloff<'py>(
    py: Python<'py>,
    s: Source<'py>,
    freq: PyReadonlyArrayDyn<'py, f64>,
    roll_percent: f64,
) -> PyResult<Bound<'py, PyAny>> {
    let freq = frequencies(&freq)?;
    each_spectra!(py, s, spectral::spectral_rolloff(s, freq, roll_percent))
}

#[pyfunction]
pub(crate) fn spectral_flatness<'py>(
    py: Python<'py>,
    s: Source<'py>,
    amin: f64,
    power: f64,
) -> PyResult<Bound<'py, PyAny>> {
    each_spectra!(py, s, spectral::spectral_flatness(s, Flatness { amin, power }))
}

/// The contrast and whether its lowest band is empty.
#[pyfunction]
#[pyo3(signature = (s, freq, sr, fmin, n_bands, quantile, linear))]
#[expect(clippy::too_many_arguments, reason = "librosa's parameters, one by one")]
pub(crate) fn spectral_contrast<'py>(
    py: Python<'py>,
    s: Source<'py>,
    freq: PyReadonlyArrayDyn<'py, f64>,
    sr: f64,
    fmin: f64,
    n_bands: usize,
    quantile: f64,
    linear: bool,
) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let params = ContrastParams { fmin, n_bands, quantile, linear };
    let freq = freq.as_slice()?;
    let empty = Contrast::new(freq, sr, &params).map_err(value_error)?.lowest_is_empty();
    let result = each_spectra!(py, s, spectral::spectral_contrast(s, freq, sr, &params))?;
    Ok((result, empty))
}

/// The coefficients and whether a fit is deficient.
#[pyfunction]
pub(crate) fn poly_features<'py>(
    py: Python<'py>,
    s: Source<'py>,
    freq: PyReadonlyArrayDyn<'py, f64>,
    order: usize,
) -> PyResult<(Bound<'py, PyAny>, bool)> {
    let freq = frequencies(&freq)?;
    let mut deficient = false;
    let result = each_spectra!(py, s, {
        spectral::poly_features(s, freq, order).map(|(coefficients, flag)| {
            deficient = flag;
            coefficients
        })
    })?;
    Ok((result, deficient))
}
