"""Pitch tracking and tuning (librosa.piptrack, estimate_tuning, pitch_tuning)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, as_array, number, rows, size, unrows
from ._filters import Window
from ._params import PitchParams
from ._refusals import refuses
from ._spectrum import spectrogram
from ._warnings import warn
from .errors import DataTypeError, ParameterError


def _tracked(
    y: Any,
    sr: float,
    S: Any,
    n_fft: int | None,
    hop_length: int | None,
    fmin: float,
    fmax: float,
    threshold: float,
    win_length: int | None,
    window: Any,
    center: bool,
    pad_mode: str,
    ref: float | Callable[..., Any] | None,
) -> tuple[Floats, Floats | None, PitchParams]:
    """The spectrogram, its reference levels and the tracker's parameters."""
    if S is None and n_fft is None:
        raise ParameterError("n_fft must be a number when y is given, not None")
    if np.iscomplexobj(S):
        S = np.abs(S)
    s, n_fft = spectrogram(y, S, n_fft or 0, hop_length, win_length, window, center, pad_mode, 1.0)
    params = PitchParams(
        number("sr", sr),
        n_fft,
        number("fmin", fmin),
        number("fmax", fmax),
        number("threshold", threshold),
    )
    if ref is None or ref is np.max:
        return s, None, params
    shape = (*s.shape[:-2], s.shape[-1])
    levels: Any
    if callable(ref):
        levels = threshold * np.asarray(ref(np.abs(s), axis=-2))
        if levels.shape != shape:
            raise ParameterError(f"ref(S) has shape {levels.shape}, expected {shape}")
    else:
        levels = np.broadcast_to(np.abs(as_array("ref", ref)), shape)
    return s, rows(levels.astype(s.dtype), 1), params


@refuses
def piptrack(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int | None = 2048,
    hop_length: int | None = None,
    fmin: float = 150.0,
    fmax: float = 4000.0,
    threshold: float = 0.1,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    ref: float | Callable[..., Any] | None = None,
) -> tuple[Floats, Floats]:
    """Interpolated frequencies and magnitudes of spectral peaks; 0 elsewhere (librosa.piptrack).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal at the sample rate `sr` in Hz.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Spectrogram to use instead of `y`, as it is.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; by default, hop_length is `n_fft // 4`.
    fmin, fmax : float
        Lowest and highest frequency in Hz.
    threshold : float
        Peaks must exceed this multiple of `ref`.
    ref : float or callable, optional
        Level to compare with; by default, the maximum of the frame.

    Returns
    -------
    frequencies in Hz, and magnitudes, each [shape=(..., 1 + n_fft // 2, t)]

    Examples
    --------
    >>> pitches, magnitudes = corsmal_feat.piptrack(y=np.zeros(44100), sr=44100)
    >>> pitches.shape
    (1025, 87)
    """
    s, levels, params = _tracked(
        y, sr, S, n_fft, hop_length, fmin, fmax, threshold, win_length, window, center, pad_mode,
        ref,
    )  # fmt: skip
    pitches, magnitudes = _core.piptrack(rows(s, 2), levels, params)
    return unrows(pitches, s, 2), unrows(magnitudes, s, 2)


@refuses
def estimate_tuning(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int | None = 2048,
    resolution: float = 0.01,
    bins_per_octave: int = 12,
    hop_length: int | None = None,
    fmin: float = 150.0,
    fmax: float = 4000.0,
    threshold: float = 0.1,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    ref: float | Callable[..., Any] | None = None,
) -> float:
    """Tuning of a signal in fractions of a bin (librosa.estimate_tuning).

    It is one value for all channels and frames, and can jump with small changes of the input.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal at the sample rate `sr` in Hz.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Spectrogram to use instead of `y`, as it is.
    n_fft : int
        Length of the transform.
    resolution : float
        Step of the result in fractions of a bin.
    bins_per_octave : int
        Bins per octave.
    hop_length, fmin, fmax, threshold, win_length, window, center, pad_mode, ref
        See `piptrack`.

    Returns
    -------
    float, in [-0.5, 0.5)

    Examples
    --------
    >>> t = np.arange(44100) / 44100
    >>> round(corsmal_feat.estimate_tuning(y=np.sin(2 * np.pi * 440 * t), sr=44100), 2)
    -0.03
    """
    s, levels, params = _tracked(
        y, sr, S, n_fft, hop_length, fmin, fmax, threshold, win_length, window, center, pad_mode,
        ref,
    )  # fmt: skip
    bins = size("bins_per_octave", bins_per_octave)
    tuning = _core.estimate_tuning(
        rows(s, 2), levels, params, number("resolution", resolution), bins
    )
    return _or_untuned(tuning)


@refuses
def pitch_tuning(
    frequencies: npt.ArrayLike, *, resolution: float = 0.01, bins_per_octave: int = 12
) -> float:
    """Tuning of frequencies in Hz, in fractions of a bin (librosa.pitch_tuning).

    Parameters
    ----------
    frequencies : float [any shape]
        Hz; values of 0 and below are left out.
    resolution : float
        Step of the result in fractions of a bin.
    bins_per_octave : int
        Bins per octave.

    Returns
    -------
    float, in [-0.5, 0.5)

    Examples
    --------
    >>> corsmal_feat.pitch_tuning(np.array([440.0, 880.0]))
    0.0
    """
    array = np.atleast_1d(as_array("frequencies", frequencies))
    if array.dtype.kind not in "biuf":
        raise DataTypeError(f"frequencies must be real numbers, not {array.dtype}")
    if array.dtype != np.float32:
        array = array.astype(np.float64)
    bins = size("bins_per_octave", bins_per_octave)
    flat = np.ascontiguousarray(array.reshape(-1))
    return _or_untuned(_core.pitch_tuning(flat, number("resolution", resolution), bins))


def _or_untuned(tuning: float | None) -> float:
    if tuning is None:
        warn("Trying to estimate tuning from empty frequency set: 0 is assumed")
        return 0.0
    return tuning


@refuses
def piptrack_both(**kwargs: Any) -> npt.NDArray[Any]:
    """Pitches and magnitudes of `piptrack`, stacked.

    Parameters
    ----------
    **kwargs
        See `piptrack`.

    Returns
    -------
    array [shape=(2, ..., d, t)]

    Examples
    --------
    >>> corsmal_feat.corsmal.piptrack_both(y=np.sin(np.arange(4096.0))).shape
    (2, 1025, 9)
    """
    return np.stack(piptrack(**kwargs))
