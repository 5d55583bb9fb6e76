"""Chromagram (librosa.feature.chroma_stft)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, number, rows, unrows
from ._filters import Window, chroma_params
from ._pitch import estimate_tuning
from ._refusals import refuses
from ._spectrum import spectrogram


@refuses
def chroma_stft(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    norm: float | None = np.inf,
    n_fft: int = 2048,
    hop_length: int = 512,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
    tuning: float | None = None,
    n_chroma: int = 12,
    ctroct: float = 5.0,
    octwidth: float | None = 2,
    base_c: bool = True,
    dtype: npt.DTypeLike = np.float32,
) -> Floats:
    """Chromagram of the power spectrogram of `y`, or of `S` as it is (librosa.feature.chroma_stft).

    Without `tuning`, one value is estimated from the same spectrogram over all channels and frames.
    It can jump with small changes of the input: pass `tuning=0` to compare frames of different
    recordings. `dtype` is the type of the filter bank.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal at the sample rate `sr` in Hz.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Spectrogram to use instead of `y`, as it is.
    norm : float, optional
        Norm by which each frame is divided (`numpy.inf`: its maximum); None for none.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    tuning : float, optional
        Deviation from A440 in fractions of a bin.
    n_chroma, ctroct, octwidth, base_c, dtype
        See `filters.chroma`.

    Returns
    -------
    [shape=(..., n_chroma, t)] in the precision of `y` or `S`

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.chroma_stft(y=y, sr=44100, tuning=0).shape
    (8, 12, 87)
    """
    s, n_fft = spectrogram(y, S, n_fft, hop_length, win_length, window, center, pad_mode, 2.0)
    if tuning is None:
        tuning = estimate_tuning(S=s, sr=sr, bins_per_octave=n_chroma)
    params = chroma_params(sr, n_fft, n_chroma, tuning, ctroct, octwidth, 2.0, base_c)
    double = np.dtype(dtype) == np.float64
    if double:
        s = s.astype(np.float64)
    length = None if norm is None else number("norm", norm)
    return unrows(_core.chroma(rows(s, 2), params, length, double), s, 2)
