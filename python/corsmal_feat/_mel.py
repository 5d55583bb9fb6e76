"""Mel spectra, cepstra and deltas (librosa.feature)."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _core
from ._arrays import Floats, floats, rows, unrows
from ._core import ParameterError
from .filters import mel_params, warn_empty
from .spectrum import power_to_db, spectrogram


def melspectrogram(
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
    power: float = 2.0,
    n_mels: int = 128,
    fmin: float = 0.0,
    fmax: float | None = None,
    htk: bool = False,
    norm: Any = "slaney",
) -> Any:
    """Mel spectrogram [shape=(..., n_mels, t)] (librosa.feature.melspectrogram)."""
    s, n_fft = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, power)
    params = mel_params(sr, n_fft, n_mels, fmin, fmax, htk, norm)
    result, empty = _core.apply_mel(rows(s, 2), params)
    if empty:
        warn_empty()
    return unrows(result, s, 2)


def mfcc(
    *,
    y: Any = None,
    sr: float = 22050,
    S: Any = None,
    n_mfcc: int = 20,
    dct_type: int = 2,
    norm: str | None = "ortho",
    lifter: float = 0,
    mel_norm: Any = "slaney",
    **kwargs: Any,
) -> Any:
    """Mel-frequency cepstral coefficients [shape=(..., n_mfcc, t)] (librosa.feature.mfcc)."""
    if norm not in ("ortho", None):
        raise ParameterError(f"norm = {norm!r} is not possible: 'ortho' or None")
    if n_mfcc < 1:
        raise ParameterError(f"n_mfcc = {n_mfcc} is not possible: at least 1")
    if S is None:
        S = power_to_db(melspectrogram(y=y, sr=sr, norm=mel_norm, **kwargs))
    s: Floats = floats("S", S, 2)
    result = _core.mfcc(rows(s, 2), int(n_mfcc), int(dct_type), norm == "ortho", float(lifter))
    return unrows(result, s, 2)


def delta(
    data: Any, *, width: int = 9, order: int = 1, axis: int = -1, mode: str = "interp"
) -> Any:
    """Local derivative by a Savitzky-Golay fit (librosa.feature.delta)."""
    if width < 3 or width % 2 == 0:
        raise ParameterError(f"width = {width} is not possible: an odd number, at least 3")
    if order < 1:
        raise ParameterError(f"order = {order} is not possible: at least 1")
    array = floats("data", data)
    moved = np.moveaxis(array, axis, -1)
    result = _core.delta(rows(moved, 1), int(width), int(order), str(mode))
    return np.moveaxis(result.reshape(moved.shape), -1, axis)
