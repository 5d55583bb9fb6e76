"""Inputs of the systems compared in the CORSMAL benchmark (M1 to M6) and of its baselines.

`y` is one recording in -1..1 [shape=(n,) or (channels, n)] at rate `sr`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Doubles, Floats, Singles, audio, floats, room, rows, size
from ._mel import mfcc
from ._mono import to_mono
from ._time_domain import zero_crossing_rate
from .errors import ParameterError

__all__ = [
    "esc26",
    "m1_stft",
    "m2_mfcc",
    "m3_spectrogram",
    "m4_logmel",
    "m4_windows",
    "m5_a34f136",
    "m5_vggish_patches",
    "m6_spectrogram",
    "spec9216",
]


def _recording(y: Any) -> Singles:
    y = audio(y)
    if y.ndim > 2:
        raise ParameterError(f"y has {y.ndim} dimensions, expected (n,) or (channels, n)")
    return np.ascontiguousarray(np.atleast_2d(y), dtype=np.float32)


def spec9216(
    y: npt.ArrayLike, sr: float, fixed_len: int | None = None, *, librosa: str = "0.11"
) -> Floats:
    """9216 values of one channel `y`: divided by its RMS, |STFT| (512, hop 128) in dB, resized to
    96 x 96. `fixed_len` cuts or zero-pads first; padding makes the result float64, as it does in
    the baselines. `sr` is not used; `librosa="0.8"` pads frames as the published baselines did."""
    y = audio(y)
    if y.ndim != 1:
        raise ParameterError(f"y has {y.ndim} dimensions, expected one channel")
    room("a signal", fixed_len or 0)
    image: Any = _core.spec9216(rows(y, 1), fixed_len or None, librosa).ravel()
    padded = (fixed_len or 0) > len(y)
    values: Floats = image if padded else image.astype(y.dtype, copy=False)
    return values


def esc26(y: npt.ArrayLike, sr: float) -> Doubles:
    """26 values of the mean channel of `y`: means, then standard deviations over frames of MFCC 1
    to 12, then mean and standard deviation of the zero-crossing rate."""
    y = to_mono(y)
    cepstra = mfcc(y=y, sr=sr)[1:13]
    crossings = zero_crossing_rate(y)
    parts = (part(rows, axis=1) for rows in (cepstra, crossings) for part in (np.mean, np.std))
    return np.concatenate(list(parts)).astype(np.float64)


def m1_stft(y: npt.ArrayLike, *, n_fft: int = 2048, hop_length: int = 512) -> Singles:
    """M1: magnitudes [shape=(1 + n_fft/2, frames)] of the mean channel. The paper gives no
    parameters; these are our choice."""
    return _core.m1_stft(_recording(y), size("n_fft", n_fft), size("hop_length", hop_length))


def m2_mfcc(y: npt.ArrayLike, sr: float, *, padded: bool = True, librosa: str = "0.8") -> Singles:
    """M2: 40 standardised MFCCs of the first 30 s [shape=(1501, 40)], or of the frames that are
    there if not `padded`."""
    return _core.m2_mfcc(_recording(y), float(sr), bool(padded), librosa)


def m3_spectrogram(
    y: npt.ArrayLike, sr: float, *, n_fft: int = 1124, hop_length: int = 3087
) -> Singles:
    """M3: magnitudes [shape=(1 + n_fft/2, frames)] of the last 32,000 samples at 16,600 Hz. Window
    and hop are our choice, the paper gives none."""
    return _core.m3_spectrogram(
        _recording(y), float(sr), size("n_fft", n_fft), size("hop_length", hop_length)
    )


def m4_logmel(y: npt.ArrayLike, sr: float, *, variant: str = "code") -> Singles:
    """M4: 64 log-mel bands of every channel [shape=(frames, 64, channels)]. `variant="code"` cuts
    each frame to 512 samples and doubles the decibels as the code does, "paper" does neither."""
    return _core.m4_logmel(_recording(y), float(sr), variant)


def m4_windows(features: npt.ArrayLike) -> Singles:
    """M4: windows of 64 frames with 75 % overlap [shape=(windows, channels, 64, 64)] of
    `m4_logmel`'s result."""
    features = floats("features", features, 3)
    if features.ndim != 3:
        raise ParameterError(f"features has {features.ndim} dimensions, expected 3")
    return _core.m4_windows(np.ascontiguousarray(features, dtype=np.float32))


def m5_a34f136(y: npt.ArrayLike, sr: float) -> Doubles:
    """M5: 136 pyAudioAnalysis values of a recording of 8 channels (mixed as 7.1), 2 or 1."""
    return _core.m5_a34f136(_recording(y), float(sr))


def m5_vggish_patches(y: npt.ArrayLike, sr: float, *, res_type: str = "kaiser_best") -> Singles:
    """M5: log-mel patches for VGGish [shape=(patches, 96, 64)]."""
    return _core.m5_vggish_patches(_recording(y), float(sr), res_type)


def m6_spectrogram(
    y: npt.ArrayLike, sr: float, *, start: float | None = None, librosa: str = "0.8"
) -> Singles:
    """M6: decibel spectrogram of 10 s from the second onset, or from `start` seconds, as an image
    [shape=(96, 96)]."""
    return _core.m6_spectrogram(_recording(y), float(sr), start, librosa)
