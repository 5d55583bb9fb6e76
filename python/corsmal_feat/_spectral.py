"""Spectral shape (librosa.feature.spectral_*, poly_features)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Doubles, Floats, as_array, number, room, rows, size
from ._filters import Window
from ._refusals import refuses
from ._spectrum import Framing, Spectra, spectra, spectrogram
from ._warnings import warn
from .errors import ParameterError


def _spectra(y: Any, S: Any, n_fft: int, framing: Framing, whole: bool = False) -> Spectra:
    """Magnitudes of `y` or `S`; `whole` if other arrays must fit the spectrogram."""
    if whole and S is None:
        S, n_fft = spectrogram(y, None, n_fft, *framing, 1.0)
    return spectra(y, S, n_fft, framing)


def _frequencies(freq: Any, sr: float, s: Spectra) -> Any:
    """Frequencies [bins] of the rows of `s`, or [channels, bins, frames] where they vary."""
    if freq is None:
        return _core.fft_frequencies(number("sr", sr), s.n_fft)
    freq = as_array("freq", freq, np.float64)
    if freq.ndim == 1 or s.shape is None:
        return np.ascontiguousarray(freq)
    return rows(_fitting("freq", freq, s.shape), 2)


def _varies(freq: Any) -> bool:
    """Whether the frequencies are given for each frame."""
    return np.ndim(freq) > 1


def _fitting(name: str, array: Any, shape: tuple[int, ...]) -> Any:
    """`array` broadcast to `shape`."""
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ParameterError(f"{name} has shape {array.shape}, expected {shape}") from None


@refuses
def spectral_centroid(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    freq: npt.ArrayLike | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Doubles:
    """Magnitude-weighted mean frequency; 0 in silence (librosa.feature.spectral_centroid).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Magnitude spectrogram to use instead of `y`.
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
    s = _spectra(y, S, n_fft, framing, whole=_varies(freq))
    at = _frequencies(freq, sr, s)
    return s.restored(_core.spectral_centroid(s.source, at))


@refuses
def spectral_bandwidth(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    freq: npt.ArrayLike | None = None,
    centroid: npt.ArrayLike | None = None,
    norm: bool = True,
    p: float = 2,
) -> Doubles:
    """Width of the spectrum around its centroid (librosa.feature.spectral_bandwidth): the p-norm of
    the deviations.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Magnitude spectrogram to use instead of `y`.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    freq : float [shape=(1 + n_fft // 2,) or that of S], optional
        Frequencies of the bins in Hz.
    centroid : float [shape=(..., 1, t)], optional
        Centroids in Hz; by default, those of the frames.
    norm : bool
        Whether to divide the magnitudes by their sum first.
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
    s = _spectra(y, S, n_fft, framing, whole=_varies(freq) or centroid is not None)
    at = _frequencies(freq, sr, s)
    centres: Any = None
    if centroid is not None and s.shape is not None:
        shape = (*s.shape[:-2], 1, s.shape[-1])
        given = as_array("centroid", centroid, np.float64)
        centres = rows(_fitting("centroid", given, shape), 2)[:, 0]
    result = _core.spectral_bandwidth(s.source, at, centres, bool(norm), number("p", p))
    return s.restored(result)


@refuses
def spectral_rolloff(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    freq: npt.ArrayLike | None = None,
    roll_percent: float = 0.85,
) -> Doubles:
    """Lowest frequency with the fraction `roll_percent` of the magnitudes at or below it
    (librosa.feature.spectral_rolloff).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Magnitude spectrogram to use instead of `y`.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    freq : float [shape=(1 + n_fft // 2,) or that of S], optional
        Frequencies of the bins in Hz.
    roll_percent : float
        Fraction, between 0 and 1.

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
    s = _spectra(y, S, n_fft, framing, whole=_varies(freq))
    at = _frequencies(freq, sr, s)
    return s.restored(_core.spectral_rolloff(s.source, at, number("roll_percent", roll_percent)))


@refuses
def spectral_flatness(
    *,
    y: npt.ArrayLike | None = None,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    amin: float = 1e-10,
    power: float = 2.0,
) -> Floats:
    """Geometric mean of the powers over their arithmetic mean: high for noise, 1 for silence
    (librosa.feature.spectral_flatness).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Magnitude spectrogram to use instead of `y`.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    amin : float
        Lower limit of the powers, above 0.
    power : float
        Exponent that turns magnitudes into powers.

    Returns
    -------
    [shape=(..., 1, t)] in the precision of `y` or `S`

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.spectral_flatness(y=y).shape
    (8, 1, 87)
    """
    framing = (hop_length, win_length, window, center, pad_mode)
    s = _spectra(y, S, n_fft, framing)
    return s.restored(
        _core.spectral_flatness(s.source, number("amin", amin), number("power", power))
    )


@refuses
def spectral_contrast(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    freq: npt.ArrayLike | None = None,
    fmin: float = 200.0,
    n_bands: int = 6,
    quantile: float = 0.02,
    linear: bool = False,
) -> Doubles:
    """Contrast of peaks and valleys in octave bands (librosa.feature.spectral_contrast). Both are
    clamped at 80 dB below their maximum over the whole array.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Magnitude spectrogram to use instead of `y`.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    freq : float [shape=(1 + n_fft // 2,)], optional
        Frequencies of the bins in Hz.
    fmin : float
        Upper edge of the lowest band in Hz.
    n_bands : int
        Number of octaves above the lowest band.
    quantile : float
        Fraction of the bins of a band that form its peak and its valley.
    linear : bool
        Whether to return differences of magnitudes instead of dB.

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
        raise ParameterError(f"n_bands must be a whole number of at least 1, not {n_bands}")
    room("a contrast", n_bands)
    at = np.atleast_1d(_frequencies(freq, sr, s))
    if at.ndim != 1:
        raise ParameterError(f"freq has shape {at.shape}, expected one frequency per bin")
    result, empty = _core.spectral_contrast(
        s.source,
        at,
        number("sr", sr),
        number("fmin", fmin),
        int(n_bands),
        number("quantile", quantile),
        bool(linear),
    )
    if empty:
        warn(
            f"no bin lies in the lowest band (0 to {fmin} Hz): its contrast is NaN and, in dB, so"
            " is every other; use a longer n_fft or a higher fmin",
            RuntimeWarning,
        )
    return s.restored(result)


@refuses
def poly_features(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    order: int = 1,
    freq: npt.ArrayLike | None = None,
) -> Doubles:
    """Polynomial over frequency that fits each frame (librosa.feature.poly_features).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. It is transformed in double precision.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Magnitude spectrogram to use instead of `y`.
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
    s = _spectra(y, S, n_fft, framing, whole=_varies(freq))
    order = size("order", order, 0)
    room("a fit", order + 1, s.n_fft // 2 + 1)
    at = _frequencies(freq, sr, s)
    result, deficient = _core.poly_features(s.source, at, int(order))
    if deficient:
        warn(
            f"the frequencies cannot determine a polynomial of order {order}",
            np.exceptions.RankWarning,
        )
    return s.restored(result)
