"""Mel spectra, cepstra and deltas (librosa.feature)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, channels, floats, number, precision, room, rows, size, spectrum, unrows
from ._decibels import power_to_db
from ._filters import Norm, Window, mel_params, warn_empty
from ._refusals import refuses
from ._spectrum import length_of, signal
from .errors import ParameterError


@refuses
def melspectrogram(
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
    power: float = 2.0,
    n_mels: int = 128,
    fmin: float = 0.0,
    fmax: float | None = None,
    htk: bool = False,
    norm: Norm = "slaney",
    dtype: npt.DTypeLike = np.float32,
) -> Floats:
    """Mel spectrogram (librosa.feature.melspectrogram).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz.
    S : [shape=(..., 1 + n_fft // 2, t)], optional
        Spectrogram to use instead of `y`, as it is.
    n_fft, hop_length, win_length, window, center, pad_mode
        See `stft`; hop_length is 512 here.
    power : float
        Exponent of the magnitudes.
    n_mels, fmin, fmax, htk, norm
        See `filters.mel`.
    dtype : float32 or float64
        Type of the filter bank, which is computed as float32; with float64, the result is float64.

    Returns
    -------
    [shape=(..., n_mels, t)] in the precision of `y` or `S`

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.melspectrogram(y=y, sr=44100).shape
    (8, 128, 87)
    """
    if S is not None:
        s = spectrum(S)
        bank = mel_params(sr, length_of(s, n_fft), n_mels, fmin, fmax, htk, norm)
        result, empty = _core.apply_mel(rows(s, 2), bank)
        leading = s.shape[:-2]
    else:
        y, stft = signal(y, n_fft, hop_length, win_length, window, center, pad_mode)
        bank = mel_params(sr, n_fft, n_mels, fmin, fmax, htk, norm)
        result, empty = _core.melspectrogram(channels(y), stft, number("power", power), bank)
        leading = y.shape[:-1]
    if empty:
        warn_empty()
    mel: Floats = result.reshape((*leading, *result.shape[1:]))
    return mel.astype(np.result_type(mel, precision(dtype)), copy=False)


@refuses
def mfcc(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_mfcc: int = 20,
    dct_type: int = 2,
    norm: str | None = "ortho",
    lifter: float = 0,
    mel_norm: Norm = "slaney",
    **kwargs: Any,
) -> Floats:
    """Mel-frequency cepstral coefficients (librosa.feature.mfcc).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz. Its mel spectrogram is converted to dB, at most 80 dB
        below the maximum over all channels.
    S : [shape=(..., n_mels, t)], optional
        Mel spectrogram in dB to use instead of `y`.
    n_mfcc : int
        Number of coefficients, at most the number of mel bands.
    dct_type : {1, 2, 3}
        Type of the cosine transform.
    norm : {"ortho", None}
        Normalisation of the cosine transform.
    lifter : float
        Coefficient of the liftering; 0 for none.
    mel_norm, **kwargs
        Arguments of `melspectrogram`; `mel_norm` is its `norm`.

    Returns
    -------
    [shape=(..., n_mfcc, t)] in the precision of `y` or `S`

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.feature.mfcc(y=y, sr=44100, n_mfcc=13).shape
    (8, 13, 87)
    """
    if norm not in ("ortho", None):
        raise ParameterError(f"norm must be 'ortho' or None, not {norm!r}")
    n_mfcc = size("n_mfcc", n_mfcc)
    if S is None:
        S = power_to_db(melspectrogram(y=y, sr=sr, norm=mel_norm, **kwargs))
    s: Floats = floats("S", S, 2)
    kind = size("dct_type", dct_type)
    if kind > 3:
        raise ParameterError(f"dct_type must be 1, 2 or 3, not {dct_type}")
    return unrows(
        _core.mfcc(rows(s, 2), n_mfcc, kind, norm == "ortho", number("lifter", lifter)), s, 2
    )


@refuses
def delta(
    data: npt.ArrayLike,
    *,
    width: int = 9,
    order: int = 1,
    axis: int = -1,
    mode: str = "interp",
    **kwargs: Any,
) -> Floats:
    """Local derivative along an axis, by a Savitzky-Golay fit (librosa.feature.delta).

    Parameters
    ----------
    data : float32 or float64
        Features, frames along `axis`.
    width : int
        Number of frames per fit: odd, at least 3.
    order : int
        Order of the derivative and degree of the polynomial.
    mode : {"interp", "nearest", "mirror", "constant", "wrap"}
        How to treat the ends.
    **kwargs
        `cval`, the value beyond the ends with "constant", and `delta`, the time between frames, as
        in `scipy.signal.savgol_filter`.

    Returns
    -------
    change per frame, in the shape and precision of `data`

    Examples
    --------
    >>> corsmal_feat.feature.delta(np.arange(10.0)).round(6)
    array([1., 1., 1., 1., 1., 1., 1., 1., 1., 1.])
    """
    width, order = size("width", width), size("order", order)
    if width < 3 or width % 2 == 0:
        raise ParameterError(f"width must be an odd number of at least 3, not {width}")
    room("a filter", width)
    step, beyond = number("delta", kwargs.pop("delta", 1.0)), kwargs.pop("cval", 0.0)
    kwargs.pop("deriv", None)  # as librosa, which sets it to `order`
    if kwargs.pop("polyorder", order) != order:
        raise ParameterError("polyorder must equal order: leave it out")
    if kwargs:
        raise ParameterError(f"delta does not take {', '.join(map(repr, kwargs))}")
    array = floats("data", data)
    kind = array.dtype
    if not np.isfinite(step) or step == 0:
        raise ParameterError(f"delta must be a finite, non-zero number, not {step}")
    if mode == "constant" and beyond != 0:
        # The derivative of a constant is 0: the ends are zeros after a shift.
        array = array.astype(np.float64) - number("cval", beyond)
    moved = np.moveaxis(array, axis, -1)
    result: Any = _core.delta(rows(moved, 1), int(width), int(order), str(mode))
    if step != 1.0:
        result = result / step**order
    slope: Floats = np.moveaxis(result.reshape(moved.shape), -1, axis).astype(kind, copy=False)
    return slope
