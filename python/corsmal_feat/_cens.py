"""Chroma energy normalised statistics (librosa.feature.chroma_cens)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, size
from ._chroma_cqt import chroma_cqt
from ._filters import Window, get_window
from ._refusals import refuses
from .errors import ParameterError
from .util import normalize

#: Shares of a frame's energy above which a class counts a quarter more.
_STEPS = (0.4, 0.2, 0.1, 0.05)
#: Longest smoothing window.
_LONGEST = 1 << 20


@refuses
def chroma_cens(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    C: npt.ArrayLike | None = None,
    hop_length: int = 512,
    fmin: float | None = None,
    tuning: float | None = None,
    n_chroma: int = 12,
    n_octaves: int = 7,
    bins_per_octave: int = 36,
    cqt_mode: str = "full",
    window: npt.ArrayLike | None = None,
    norm: float | None = 2,
    win_len_smooth: int | None = 41,
    smoothing_window: Window = "hann",
) -> Floats:
    """Chromagram that follows the harmony and ignores the loudness
    (librosa.feature.chroma_cens; Müller and Ewert 2011).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz.
    C : [shape=(..., d, t)], optional
        Constant-Q magnitudes to use instead of `y`.
    hop_length, fmin, tuning, n_chroma, n_octaves, bins_per_octave, cqt_mode, window
        See `chroma_cqt`.
    norm : float, optional
        Norm by which each frame is divided; None for none.
    win_len_smooth : int, optional
        Number of frames to smooth over; None for none.
    smoothing_window : str, tuple, float, array or callable
        See `filters.get_window`.

    Returns
    -------
    [shape=(..., n_chroma, t)]

    Examples
    --------
    >>> y = np.sin(2 * np.pi * 440 * np.arange(22050) / 22050)
    >>> corsmal_feat.feature.chroma_cens(y=y, sr=22050, tuning=0)[:, 20].argmax()
    np.int64(9)
    """
    smooth = win_len_smooth
    if smooth is not None and not (
        isinstance(smooth, (int, np.integer)) and 0 < smooth <= _LONGEST
    ):
        raise ParameterError(
            f"win_len_smooth must be a whole number of at least 1, or None, not {smooth}"
        )
    chroma: Any = chroma_cqt(
        y=y,
        C=C,
        sr=sr,
        hop_length=hop_length,
        fmin=fmin,
        bins_per_octave=size("bins_per_octave", bins_per_octave),
        tuning=tuning,
        norm=None,
        n_chroma=n_chroma,
        n_octaves=n_octaves,
        cqt_mode=cqt_mode,
        window=window,
    )
    shares = normalize(chroma, norm=1, axis=-2)
    quantized: Any = np.zeros_like(shares)
    for step in _STEPS:
        quantized += (shares > step) * 0.25
    if smooth is not None:
        weights = get_window(smoothing_window, int(smooth) + 2, fftbins=False)
        quantized = _smoothed(quantized, weights / weights.sum())
    return normalize(quantized, norm=norm, axis=-2)


def _smoothed(values: Any, weights: npt.NDArray[np.float64]) -> Any:
    """Convolution along the last axis, zeros beyond its ends (scipy.ndimage.convolve)."""
    before = len(weights) // 2
    widths = [(0, 0)] * (values.ndim - 1) + [(len(weights) - 1 - before, before)]
    windows = np.lib.stride_tricks.sliding_window_view(
        np.pad(values, widths), len(weights), axis=-1
    )
    return (windows @ weights[::-1]).astype(values.dtype)
