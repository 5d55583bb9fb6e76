"""Features of the shape of a spectrum (librosa.feature.spectral_*, poly_features)."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from . import _core
from ._arrays import rows
from .errors import ParameterError
from .spectrum import Framing, Spectra, spectra, spectrogram


def _spectra(y: Any, S: Any, n_fft: int, framing: Framing, whole: bool = False) -> Spectra:
    """Magnitudes of `y` or `S`; `whole` says that other arrays are to fit the spectrogram."""
    if whole and S is None:
        S, n_fft = spectrogram(y, None, n_fft, *framing, 1.0)
    return spectra(y, S, n_fft, framing)


def _frequencies(freq: Any, sr: float, s: Spectra) -> Any:
    """Frequencies [bins] of the rows of `s`, or [channels, bins, frames] where they vary."""
    if freq is None:
        return _core.fft_frequencies(float(sr), s.n_fft)
    freq = np.asarray(freq, dtype=np.float64)
    if freq.ndim == 1 or s.shape is None:
        return np.ascontiguousarray(freq)
    return rows(_fitting("freq", freq, s.shape), 2)


def _fitting(name: str, array: Any, shape: tuple[int, ...]) -> Any:
    """`array` broadcast to `shape`."""
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ParameterError(f"{name} has shape {array.shape}, expected {shape}") from None


def spectral_centroid(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    freq: Any = None,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Any:
    """Magnitude-weighted mean frequency; 0 in silence (librosa.feature.spectral_centroid).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        A magnitude spectrogram to use instead.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    freq : float [shape=(1 + n_fft // 2,) or that of S], optional
        Frequencies of the bins in Hz.

    Returns
    -------
    Hz, float64 [shape=(..., 1, t)]

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.spectral_centroid(y=y, sr=44100).shape
    (8, 1, 87)
    """
    framing = (hop_length, win_length, window, center, pad_mode)
    s = _spectra(y, S, n_fft, framing, whole=np.ndim(freq) > 1)
    freq = _frequencies(freq, sr, s)
    return s.restored(_core.spectral_centroid(s.source, freq))


def spectral_bandwidth(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    freq: Any = None,
    centroid: Any = None,
    norm: bool = True,
    p: float = 2,
) -> Any:
    """Width of the spectrum around its centroid (librosa.feature.spectral_bandwidth): the p-norm of
    the deviations.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        A magnitude spectrogram to use instead.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    freq : float [shape=(1 + n_fft // 2,) or that of S], optional
        Frequencies of the bins in Hz.
    centroid : float [shape=(..., 1, t)], optional
        Centroids in Hz; those of the frames by default.
    norm : bool
        Divide the magnitudes by their sum first.
    p : float
        Exponent of the deviations, above 0.

    Returns
    -------
    Hz, float64 [shape=(..., 1, t)]

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.spectral_bandwidth(y=y, sr=44100).shape
    (8, 1, 87)
    """
    framing = (hop_length, win_length, window, center, pad_mode)
    s = _spectra(y, S, n_fft, framing, whole=np.ndim(freq) > 1 or centroid is not None)
    freq = _frequencies(freq, sr, s)
    if centroid is not None and s.shape is not None:
        shape = (*s.shape[:-2], 1, s.shape[-1])
        centroid = np.asarray(centroid, dtype=np.float64)
        centroid = rows(_fitting("centroid", centroid, shape), 2)[:, 0]
    result = _core.spectral_bandwidth(s.source, freq, centroid, bool(norm), float(p))
    return s.restored(result)


def spectral_rolloff(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    freq: Any = None,
    roll_percent: float = 0.85,
) -> Any:
    """Lowest frequency that has the fraction `roll_percent` of the magnitudes at or below it
    (librosa.feature.spectral_rolloff).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        A magnitude spectrogram to use instead.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    freq : float [shape=(1 + n_fft // 2,) or that of S], optional
        Frequencies of the bins in Hz.
    roll_percent : float
        The fraction, between 0 and 1.

    Returns
    -------
    Hz, float64 [shape=(..., 1, t)]

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.spectral_rolloff(y=y, sr=44100).shape
    (8, 1, 87)
    """
    framing = (hop_length, win_length, window, center, pad_mode)
    s = _spectra(y, S, n_fft, framing, whole=np.ndim(freq) > 1)
    freq = _frequencies(freq, sr, s)
    return s.restored(_core.spectral_rolloff(s.source, freq, float(roll_percent)))


def spectral_flatness(
    *,
    y: Any = None,
    S: Any = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    amin: float = 1e-10,
    power: float = 2.0,
) -> Any:
    """Geometric over arithmetic mean of the powers: 1 for white noise and silence
    (librosa.feature.spectral_flatness).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        A magnitude spectrogram to use instead.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    amin : float
        Floor of the powers, above 0.
    power : float
        Exponent that makes powers of magnitudes.

    Returns
    -------
    in the precision of `y` or `S` [shape=(..., 1, t)]

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.spectral_flatness(y=y).shape
    (8, 1, 87)
    """
    framing = (hop_length, win_length, window, center, pad_mode)
    s = _spectra(y, S, n_fft, framing)
    return s.restored(_core.spectral_flatness(s.source, float(amin), float(power)))


def spectral_contrast(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    freq: Any = None,
    fmin: float = 200.0,
    n_bands: int = 6,
    quantile: float = 0.02,
    linear: bool = False,
) -> Any:
    """Peaks over valleys of octave bands (librosa.feature.spectral_contrast), both clamped 80 dB
    below their maximum over the whole array.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        A magnitude spectrogram to use instead.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    freq : float [shape=(1 + n_fft // 2,)], optional
        Frequencies of the bins in Hz.
    fmin : float
        Upper edge of the lowest band in Hz.
    n_bands : int
        Octaves above it.
    quantile : float
        Fraction of the bins of a band that makes its peak and its valley.
    linear : bool
        The difference of magnitudes, not of dB.

    Returns
    -------
    dB, or magnitudes, float64 [shape=(..., n_bands + 1, t)]

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.spectral_contrast(y=y, sr=44100).shape
    (8, 7, 87)
    """
    framing = (hop_length, win_length, window, center, pad_mode)
    s = _spectra(y, S, n_fft, framing)
    if not isinstance(n_bands, (int, np.integer)) or n_bands < 1:
        raise ParameterError(f"n_bands = {n_bands} is not possible: an integer, at least 1")
    freq = np.atleast_1d(_frequencies(freq, sr, s))
    if freq.ndim != 1:
        raise ParameterError(f"freq has shape {freq.shape}, expected one frequency for each bin")
    result, empty = _core.spectral_contrast(
        s.source, freq, float(sr), float(fmin), int(n_bands), float(quantile), bool(linear)
    )
    if empty:
        warnings.warn(
            f"no bin lies in the lowest band (0 to {fmin} Hz): its contrast is NaN, and in dB"
            " so is all of it; a longer n_fft or a higher fmin avoids this",
            RuntimeWarning,
            stacklevel=2,
        )
    return s.restored(result)


def poly_features(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    order: int = 1,
    freq: Any = None,
) -> Any:
    """Polynomial over frequency, fitted to each frame (librosa.feature.poly_features).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        A magnitude spectrogram to use instead.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    order : int
        Degree of the polynomial.
    freq : float [shape=(1 + n_fft // 2,) or that of S], optional
        Frequencies of the bins in Hz.

    Returns
    -------
    coefficients, highest degree first, float64 [shape=(..., order + 1, t)]

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.poly_features(y=y, sr=44100).shape
    (8, 2, 87)
    """
    framing = (hop_length, win_length, window, center, pad_mode)
    s = _spectra(y, S, n_fft, framing, whole=np.ndim(freq) > 1)
    if order < 0:
        raise ParameterError(f"order = {order} is not possible: at least 0")
    freq = _frequencies(freq, sr, s)
    result, deficient = _core.poly_features(s.source, freq, int(order))
    if deficient:
        warnings.warn(
            f"the frequencies cannot determine a polynomial of order {order}",
            np.exceptions.RankWarning,
            stacklevel=2,
        )
    return s.restored(result)
