"""Short-time Fourier transform and decibels (librosa.core.spectrum)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from . import _core
from ._arrays import Floats, audio, floats, rows, unrows
from ._core import ParameterError
from .filters import window_name

__all__ = ["amplitude_to_db", "power_to_db", "stft"]

StftParams = tuple[int, int, int, str, bool, str]


def stft_params(
    n_fft: int,
    hop_length: int | None,
    win_length: int | None,
    window: Any,
    center: bool,
    pad_mode: str,
) -> StftParams:
    """Transform parameters with librosa's defaults filled in: hop is a quarter of the window."""
    if n_fft < 1:
        raise ParameterError(f"n_fft = {n_fft} is not possible: at least 1")
    win_length = n_fft if win_length is None else win_length
    hop_length = win_length // 4 if hop_length is None else hop_length
    if hop_length < 1:
        raise ParameterError(f"hop_length = {hop_length} is not possible: at least 1")
    if win_length < 1:
        raise ParameterError(f"win_length = {win_length} is not possible: at least 1")
    name = window_name(window)
    return int(n_fft), int(hop_length), int(win_length), name, bool(center), str(pad_mode)


def stft(
    y: Any,
    *,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Any:
    """Complex spectrogram [shape=(..., 1 + n_fft/2, frames)] of `y` [shape=(..., n)]."""
    y = audio(y)
    params = stft_params(n_fft, hop_length, win_length, window, center, pad_mode)
    warn_short(y, n_fft)
    return unrows(_core.stft(rows(y, 1), params), y, 1)


def warn_short(y: Floats, n_fft: int) -> None:
    """librosa's warning where one frame is longer than the signal."""
    if y.shape[-1] < n_fft:
        warnings.warn(
            f"n_fft={n_fft} is larger than the signal of {y.shape[-1]} samples", stacklevel=3
        )


def spectrogram(
    y: Any,
    S: Any,
    n_fft: int,
    hop_length: int | None,
    win_length: int | None,
    window: Any,
    center: bool,
    pad_mode: str,
    power: float,
) -> tuple[Floats, int]:
    """`S`, or |stft(y)|**power where S is None, and the transform length it has
    (librosa.core.spectrum._spectrogram)."""
    if S is not None:
        S = floats("S", S, 2)
        if n_fft // 2 + 1 != S.shape[-2]:
            n_fft = 2 * (S.shape[-2] - 1)
        return S, n_fft
    if y is None:
        raise ParameterError("y or S must be given")
    y = audio(y)
    params = stft_params(n_fft, hop_length, win_length, window, center, pad_mode)
    warn_short(y, n_fft)
    return unrows(_core.spectrogram(rows(y, 1), params, float(power)), y, 1), n_fft


def power_to_db(
    S: Any,
    *,
    ref: float | Callable[..., Any] = 1.0,
    amin: float = 1e-10,
    top_db: float | None = 80.0,
) -> Any:
    """Power to decibels; the top_db clamp is joint over the whole array (librosa.power_to_db)."""
    S = np.asarray(S)
    if np.iscomplexobj(S):
        warnings.warn("power_to_db was called on complex input: phase is discarded", stacklevel=2)
        S = np.abs(S)
    scalar = S.ndim == 0
    S = floats("S", S.astype(np.float64) if S.dtype.kind in "iu" else S, 0)
    reference = float(abs(ref(S) if callable(ref) else ref))
    top = None if top_db is None else float(top_db)
    result = _core.power_to_db(np.ascontiguousarray(S), reference, float(amin), top)
    return result[0] if scalar else result.reshape(S.shape)


def amplitude_to_db(
    S: Any,
    *,
    ref: float | Callable[..., Any] = 1.0,
    amin: float = 1e-5,
    top_db: float | None = 80.0,
) -> Any:
    """Amplitude to decibels (librosa.amplitude_to_db): power_to_db of the square."""
    S = np.asarray(S)
    if np.iscomplexobj(S):
        warnings.warn(
            "amplitude_to_db was called on complex input: phase is discarded", stacklevel=2
        )
    if amin <= 0:
        raise ParameterError(f"amin = {amin} is not possible: above 0")
    magnitude = np.abs(S)
    reference = float(abs(ref(magnitude) if callable(ref) else ref))
    return power_to_db(np.square(magnitude), ref=reference**2, amin=amin**2, top_db=top_db)
