"""Pitch tracking and tuning (librosa.piptrack, estimate_tuning, pitch_tuning)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, rows, unrows
from ._core import ParameterError
from .spectrum import spectrogram

PitchParams = tuple[float, int, float, float, float]


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
        raise ParameterError("n_fft = None is not possible: a number is needed with y")
    if np.iscomplexobj(S):
        S = np.abs(S)
    s, n_fft = spectrogram(
        y, S, n_fft or 0, hop_length, win_length, window, center, pad_mode, 1.0
    )
    params = (float(sr), n_fft, float(fmin), float(fmax), float(threshold))
    if ref is None or ref is np.max:
        return s, None, params
    shape = (*s.shape[:-2], s.shape[-1])
    if callable(ref):
        levels = threshold * np.asarray(ref(np.abs(s), axis=-2))
        if levels.shape != shape:
            raise ParameterError(f"ref(S) has shape {levels.shape}, expected {shape}")
    else:
        levels = np.broadcast_to(np.abs(ref), shape)
    return s, rows(levels.astype(s.dtype), 1), params


def piptrack(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_fft: int | None = 2048,
    hop_length: int | None = None,
    fmin: float = 150.0,
    fmax: float = 4000.0,
    threshold: float = 0.1,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    ref: float | Callable[..., Any] | None = None,
) -> tuple[Any, Any]:
    """Interpolated frequencies in Hz and magnitudes of spectral peaks, 0 elsewhere, each
    [shape=(..., d, t)] (librosa.piptrack)."""
    s, levels, params = _tracked(
        y, sr, S, n_fft, hop_length, fmin, fmax, threshold, win_length, window, center, pad_mode,
        ref,
    )  # fmt: skip
    pitches, magnitudes = _core.piptrack(rows(s, 2), levels, params)
    return unrows(pitches, s, 2), unrows(magnitudes, s, 2)


def estimate_tuning(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_fft: int | None = 2048,
    resolution: float = 0.01,
    bins_per_octave: int = 12,
    hop_length: int | None = None,
    fmin: float = 150.0,
    fmax: float = 4000.0,
    threshold: float = 0.1,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    ref: float | Callable[..., Any] | None = None,
) -> float:
    """Tuning in fractions of a bin, in [-0.5, 0.5): one for all channels and frames, and a
    discontinuous function of them (librosa.estimate_tuning)."""
    s, levels, params = _tracked(
        y, sr, S, n_fft, hop_length, fmin, fmax, threshold, win_length, window, center, pad_mode,
        ref,
    )  # fmt: skip
    histogram = (float(resolution), _positive("bins_per_octave", bins_per_octave))
    return _or_untuned(_core.estimate_tuning(rows(s, 2), levels, params, histogram))


def pitch_tuning(
    frequencies: npt.ArrayLike, *, resolution: float = 0.01, bins_per_octave: int = 12
) -> float:
    """Tuning of frequencies in Hz, in fractions of a bin (librosa.pitch_tuning)."""
    array = np.atleast_1d(np.asarray(frequencies))
    if array.dtype != np.float32:
        array = array.astype(np.float64)
    bins = _positive("bins_per_octave", bins_per_octave)
    flat = np.ascontiguousarray(array.reshape(-1))
    return _or_untuned(_core.pitch_tuning(flat, float(resolution), bins))


def _positive(name: str, value: int) -> int:
    if value < 1:
        raise ParameterError(f"{name} = {value} is not possible: at least 1")
    return int(value)


def _or_untuned(tuning: float | None) -> float:
    if tuning is None:
        warnings.warn("no frequencies to estimate a tuning from: 0 is assumed", stacklevel=3)
        return 0.0
    return tuning


def piptrack_both(**kwargs: Any) -> Any:
    """Pitches and magnitudes of `piptrack`, stacked [shape=(2, ..., d, t)]."""
    return np.stack(piptrack(**kwargs))
