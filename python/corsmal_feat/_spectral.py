"""Features of the shape of a spectrum (librosa.feature.spectral_*, poly_features)."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, rows, unrows
from ._core import ParameterError
from .spectrum import spectrogram

Doubles = npt.NDArray[np.float64]


def _frequencies(freq: Any, sr: float, n_fft: int, s: Floats) -> Doubles:
    """Frequencies [bins] of the rows of `s`, or [channels, bins, frames] where they vary."""
    if freq is None:
        return _core.fft_frequencies(float(sr), n_fft)
    freq = np.asarray(freq, dtype=np.float64)
    if freq.ndim == 1:
        return np.ascontiguousarray(freq)
    try:
        return rows(np.broadcast_to(freq, s.shape), 2)
    except ValueError:
        raise ParameterError(f"freq has shape {freq.shape}, expected {s.shape}") from None


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
) -> Doubles:
    """Magnitude-weighted mean frequency in Hz [shape=(..., 1, t)]; 0 in silence
    (librosa.feature.spectral_centroid)."""
    s, n_fft = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, 1.0)
    freq = _frequencies(freq, sr, n_fft, s)
    return unrows(_core.spectral_centroid(rows(s, 2), freq), s, 2)


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
) -> Doubles:
    """Width of the spectrum around its centroid in Hz [shape=(..., 1, t)]: the p-norm of the
    deviations (librosa.feature.spectral_bandwidth)."""
    s, n_fft = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, 1.0)
    freq = _frequencies(freq, sr, n_fft, s)
    if centroid is not None:
        centroid = np.asarray(centroid, dtype=np.float64)
        shape = (*s.shape[:-2], 1, s.shape[-1])
        try:
            centroid = rows(np.broadcast_to(centroid, shape), 2)[:, 0]
        except ValueError:
            raise ParameterError(
                f"centroid has shape {centroid.shape}, expected {shape}"
            ) from None
    result = _core.spectral_bandwidth(rows(s, 2), freq, centroid, bool(norm), float(p))
    return unrows(result, s, 2)


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
) -> Doubles:
    """Lowest frequency in Hz that has the fraction `roll_percent` of the magnitudes at or below it
    [shape=(..., 1, t)] (librosa.feature.spectral_rolloff)."""
    s, n_fft = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, 1.0)
    freq = _frequencies(freq, sr, n_fft, s)
    return unrows(_core.spectral_rolloff(rows(s, 2), freq, float(roll_percent)), s, 2)


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
    """Geometric over arithmetic mean of S**power, floored at `amin` [shape=(..., 1, t)]: 1 for
    white noise and silence (librosa.feature.spectral_flatness)."""
    s, _ = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, 1.0)
    return unrows(_core.spectral_flatness(rows(s, 2), float(amin), float(power)), s, 2)


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
) -> Doubles:
    """Peaks over valleys of octave bands in dB [shape=(..., n_bands + 1, t)], both clamped 80 dB
    below their maximum over the whole array (librosa.feature.spectral_contrast)."""
    s, n_fft = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, 1.0)
    if not isinstance(n_bands, (int, np.integer)) or n_bands < 1:
        raise ParameterError(f"n_bands = {n_bands} is not possible: an integer, at least 1")
    freq = np.atleast_1d(_frequencies(freq, sr, n_fft, s))
    if freq.shape != s.shape[-2:-1]:
        raise ParameterError(f"freq has shape {freq.shape}, expected {s.shape[-2:-1]}")
    result, empty = _core.spectral_contrast(
        rows(s, 2), freq, float(sr), float(fmin), int(n_bands), float(quantile), bool(linear)
    )
    if empty:
        warnings.warn(
            f"no bin lies in the lowest band (0 to {fmin} Hz): its contrast is NaN, and in dB"
            " so is all of it; a longer n_fft or a higher fmin avoids this",
            RuntimeWarning,
            stacklevel=2,
        )
    return unrows(result, s, 2)


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
) -> Doubles:
    """Coefficients of the polynomial over frequency fitted to each frame, highest degree first
    [shape=(..., order + 1, t)] (librosa.feature.poly_features)."""
    s, n_fft = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, 1.0)
    if order < 0:
        raise ParameterError(f"order = {order} is not possible: at least 0")
    freq = _frequencies(freq, sr, n_fft, s)
    result, deficient = _core.poly_features(rows(s, 2), freq, int(order))
    if deficient:
        warnings.warn(
            f"the frequencies cannot determine a polynomial of order {order}",
            np.exceptions.RankWarning,
            stacklevel=2,
        )
    return unrows(result, s, 2)
