"""Short-time Fourier transform and decibels (librosa.core.spectrum)."""

from __future__ import annotations

import warnings
from typing import Any

from . import _core
from ._arrays import Floats, audio, rows, unrows
from ._core import ParameterError
from .filters import window_name

__all__ = ["stft"]

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
    _warn_short(y, n_fft)
    return unrows(_core.stft(rows(y, 1), params), y, 1)


def _warn_short(y: Floats, n_fft: int) -> None:
    if y.shape[-1] < n_fft:
        warnings.warn(
            f"n_fft={n_fft} is larger than the signal of {y.shape[-1]} samples", stacklevel=3
        )
