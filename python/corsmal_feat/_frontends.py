"""Inputs of the systems compared in the CORSMAL benchmark (M1 to M6) and of its baselines.

`y` is one recording in -1..1 [shape=(n,) or (channels, n)] at the sample rate `sr`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Doubles, Floats, Singles, audio, floats, number, room, rows, size
from ._mel import mfcc
from ._mono import to_mono
from ._refusals import refuses
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


@refuses
def spec9216(
    y: npt.ArrayLike, sr: float, fixed_len: int | None = None, *, librosa: str = "0.11"
) -> Floats:
    """Image of one channel: divided by its RMS, |STFT| (n_fft=512, hop 128) in dB, resized to
    96 x 96.

    Parameters
    ----------
    y : [shape=(n,)]
        One channel, float in -1..1.
    sr : float
        Its sample rate in Hz; has no effect.
    fixed_len : int, optional
        Number of samples to cut the signal to, or to pad it to with zeros; padding makes the result
        float64, as in the baselines.
    librosa : {"0.11", "0.8"}
        "0.8" pads frames as the published baselines did.

    Returns
    -------
    array [shape=(9216,)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 9000).astype(np.float32)
    >>> corsmal_feat.corsmal.spec9216(y, 22050).shape
    (9216,)
    """
    y = audio(y)
    if y.ndim != 1:
        raise ParameterError(f"y has {y.ndim} dimensions, expected 1")
    room("a signal", fixed_len or 0)
    image: Any = _core.spec9216(rows(y, 1), fixed_len or None, librosa).ravel()
    padded = (fixed_len or 0) > len(y)
    values: Floats = image if padded else image.astype(y.dtype, copy=False)
    return values


@refuses
def esc26(y: npt.ArrayLike, sr: float) -> Doubles:
    """The vector of the baseline, from the mean channel: means, then standard deviations of MFCC 1
    to 12 over frames, then mean and standard deviation of the zero-crossing rate.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    sr : float
        Its sample rate in Hz.

    Returns
    -------
    float64 [shape=(26,)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 9000).astype(np.float32)
    >>> corsmal_feat.corsmal.esc26(y, 22050).shape
    (26,)
    """
    y = to_mono(y)
    cepstra = mfcc(y=y, sr=sr)[1:13]
    crossings = zero_crossing_rate(y)
    parts = (part(rows, axis=1) for rows in (cepstra, crossings) for part in (np.mean, np.std))
    return np.concatenate(list(parts)).astype(np.float64)


@refuses
def m1_stft(y: npt.ArrayLike, *, n_fft: int = 2048, hop_length: int = 512) -> Singles:
    """M1's input: magnitudes of the mean channel. The paper gives no parameters; these are our
    choice.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    n_fft, hop_length : int
        Samples per frame, and from one frame to the next.

    Returns
    -------
    float32 [shape=(1 + n_fft/2, frames)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 9000).astype(np.float32)
    >>> corsmal_feat.corsmal.m1_stft(y).shape
    (1025, 18)
    """
    return _core.m1_stft(_recording(y), size("n_fft", n_fft), size("hop_length", hop_length))


@refuses
def m2_mfcc(y: npt.ArrayLike, sr: float, *, padded: bool = True, librosa: str = "0.8") -> Singles:
    """M2's input: 40 standardised MFCCs of the first 30 s.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    sr : float
        Its sample rate in Hz.
    padded : bool
        Whether to pad a shorter recording to 1501 frames.
    librosa : {"0.8", "0.11"}
        The librosa version whose padding of frames is used.

    Returns
    -------
    float32 [shape=(1501 or frames, 40)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, (8, 22050)).astype(np.float32)
    >>> corsmal_feat.corsmal.m2_mfcc(y, 22050).shape
    (1501, 40)
    """
    return _core.m2_mfcc(_recording(y), number("sr", sr), bool(padded), librosa)


@refuses
def m3_spectrogram(
    y: npt.ArrayLike, sr: float, *, n_fft: int = 1124, hop_length: int = 3087
) -> Singles:
    """M3's input: magnitudes of the last 32,000 samples at 16,600 Hz. Window and hop are our
    choice: the paper gives neither.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    sr : float
        Its sample rate in Hz.
    n_fft, hop_length : int
        Samples per frame, and from one frame to the next.

    Returns
    -------
    float32 [shape=(1 + n_fft/2, frames)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 44100).astype(np.float32)
    >>> corsmal_feat.corsmal.m3_spectrogram(y, 22050).shape
    (563, 11)
    """
    return _core.m3_spectrogram(
        _recording(y), number("sr", sr), size("n_fft", n_fft), size("hop_length", hop_length)
    )


@refuses
def m4_logmel(y: npt.ArrayLike, sr: float, *, variant: str = "code") -> Singles:
    """M4's input: 64 log-mel bands of every channel.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    sr : float
        Its sample rate in Hz.
    variant : {"code", "paper"}
        "code" cuts each frame to 512 samples and doubles the decibels, as the code does; "paper"
        does neither.

    Returns
    -------
    float32 [shape=(frames, 64, channels)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, (8, 44100)).astype(np.float32)
    >>> corsmal_feat.corsmal.m4_logmel(y, 44100).shape
    (98, 64, 8)
    """
    return _core.m4_logmel(_recording(y), number("sr", sr), variant)


@refuses
def m4_windows(features: npt.ArrayLike) -> Singles:
    """M4's input: windows of 64 frames with 75 % overlap.

    Parameters
    ----------
    features : [shape=(frames, 64, channels)]
        The result of `m4_logmel`.

    Returns
    -------
    float32 [shape=(windows, channels, 64, 64)]

    Examples
    --------
    >>> corsmal_feat.corsmal.m4_windows(np.zeros((99, 64, 8))).shape
    (3, 8, 64, 64)
    """
    features = floats("features", features, 3)
    if features.ndim != 3:
        raise ParameterError(f"features has {features.ndim} dimensions, expected 3")
    return _core.m4_windows(np.ascontiguousarray(features, dtype=np.float32))


@refuses
def m5_a34f136(y: npt.ArrayLike, sr: float) -> Doubles:
    """M5's vector: 136 pyAudioAnalysis values of a recording of 8 channels (mixed as 7.1), 2 or 1.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    sr : float
        Its sample rate in Hz.

    Returns
    -------
    float64 [shape=(136,)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, (8, 44100)).astype(np.float32)
    >>> corsmal_feat.corsmal.m5_a34f136(y, 44100).shape
    (136,)
    """
    return _core.m5_a34f136(_recording(y), number("sr", sr))


@refuses
def m5_vggish_patches(y: npt.ArrayLike, sr: float, *, res_type: str = "kaiser_best") -> Singles:
    """M5's log-mel patches for VGGish.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    sr : float
        Its sample rate in Hz.
    res_type : {"kaiser_best", "kaiser_fast", "soxr_hq"}
        Resampling to 16 kHz, see `resample`.

    Returns
    -------
    float32 [shape=(patches, 96, 64)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 88200).astype(np.float32)
    >>> corsmal_feat.corsmal.m5_vggish_patches(y, 44100).shape
    (2, 96, 64)
    """
    return _core.m5_vggish_patches(_recording(y), number("sr", sr), res_type)


@refuses
def m6_spectrogram(
    y: npt.ArrayLike, sr: float, *, start: float | None = None, librosa: str = "0.8"
) -> Singles:
    """M6's input: decibel spectrogram of 10 s as an image.

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        One recording, float in -1..1.
    sr : float
        Its sample rate in Hz.
    start : float, optional
        Start of the 10 s in seconds; by default, the second onset.
    librosa : {"0.8", "0.11"}
        The librosa version whose onsets and padding are used.

    Returns
    -------
    float32 [shape=(96, 96)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 44100).astype(np.float32)
    >>> corsmal_feat.corsmal.m6_spectrogram(y, 22050, start=0).shape
    (96, 96)
    """
    return _core.m6_spectrogram(_recording(y), number("sr", sr), start, librosa)
