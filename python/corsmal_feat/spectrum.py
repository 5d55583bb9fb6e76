"""Short-time Fourier transform and decibels (librosa.core.spectrum)."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from . import _core
from ._arrays import Floats, audio, channels, floats, rows, unrows
from .errors import ParameterError
from .filters import window_name

__all__ = ["amplitude_to_db", "power_to_db", "stft"]

StftParams = tuple[int, int, int, str, bool, str]
#: hop_length, win_length, window, center, pad_mode as they were given
Framing = tuple[int | None, int | None, Any, bool, str]


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
    """Short-time Fourier transform (librosa.stft).

    float32 signals are transformed in single precision (within 1e-6 of the largest value of a
    frame), float64 signals in double precision.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Any number of channels or other leading axes.
    n_fft : int
        Length of the transform in samples.
    hop_length : int, optional
        Samples between frames; `win_length // 4` by default.
    win_length : int, optional
        Length of the window in samples, at most `n_fft`, which is the default. It is centred.
    window : str or ("kaiser", beta)
        Name of a window.
    center : bool
        Frame `t` is centred on sample `t * hop_length` (or starts there).
    pad_mode : {"constant", "edge", "reflect", "symmetric"}
        What `center` puts before the first and after the last sample.

    Returns
    -------
    complex64 or complex128 [shape=(..., 1 + n_fft // 2, t)]

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.stft(y).shape
    (8, 1025, 87)
    """
    y = audio(y)
    params = stft_params(n_fft, hop_length, win_length, window, center, pad_mode)
    warn_short(y, n_fft, stacklevel=3)
    return unrows(_core.stft(channels(y), params), y, 1)


def warn_short(y: Floats, n_fft: int, stacklevel: int) -> None:
    """librosa's warning where one frame is longer than the signal."""
    if y.shape[-1] < n_fft:
        warnings.warn(
            f"n_fft={n_fft} is larger than the signal of {y.shape[-1]} samples",
            stacklevel=stacklevel,
        )


class Spectra(NamedTuple):
    """What a feature is computed from: the Rust side makes the spectra of a signal one at a time,
    so that no spectrogram is held."""

    #: a signal [shape=(channels, n)] and its transform, or a spectrogram
    source: Floats | tuple[Floats, StftParams]
    #: the axes of the caller's array before those that the feature is about
    leading: tuple[int, ...]
    n_fft: int
    #: the shape of the spectrogram where there is one
    shape: tuple[int, ...] | None

    def restored(self, result: Any) -> Any:
        """`result` [shape=(channels, ...)] with the leading axes of the caller's array."""
        return result.reshape((*self.leading, *result.shape[1:]))


def signal(
    y: Any,
    n_fft: int,
    hop_length: int | None,
    win_length: int | None,
    window: Any,
    center: bool,
    pad_mode: str,
) -> tuple[Floats, StftParams]:
    """`y` and the parameters of its transform, checked."""
    if y is None:
        raise ParameterError("y or S must be given")
    y = audio(y)
    params = stft_params(n_fft, hop_length, win_length, window, center, pad_mode)
    warn_short(y, n_fft, stacklevel=4)
    return y, params


def length_of(s: Floats, n_fft: int) -> int:
    """The transform length of a spectrogram: `n_fft`, unless the bins say otherwise."""
    return n_fft if n_fft // 2 + 1 == s.shape[-2] else 2 * (s.shape[-2] - 1)


def spectra(y: Any, S: Any, n_fft: int, framing: Framing) -> Spectra:
    """Magnitudes, from `S` or by a transform of `y`."""
    if S is not None:
        s = floats("S", S, 2)
        return Spectra(rows(s, 2), s.shape[:-2], length_of(s, n_fft), s.shape)
    y, params = signal(y, n_fft, *framing)
    return Spectra((channels(y), params), y.shape[:-1], n_fft, None)


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
    """`S`, or |stft(y)|**power by a transform in double precision where S is None, and the
    transform length it has (librosa.core.spectrum._spectrogram)."""
    if S is not None:
        S = floats("S", S, 2)
        return S, length_of(S, n_fft)
    y, params = signal(y, n_fft, hop_length, win_length, window, center, pad_mode)
    return unrows(_core.spectrogram(channels(y), params, float(power)), y, 1), n_fft


def power_to_db(
    S: Any,
    *,
    ref: float | Callable[..., Any] = 1.0,
    amin: float = 1e-10,
    top_db: float | None = 80.0,
) -> Any:
    """Power to decibels (librosa.power_to_db): 10 log10 of `S / ref`.

    Parameters
    ----------
    S : float32 or float64, any shape
        Powers; of complex values the magnitude is taken, with a warning.
    ref : float or callable
        The power of 0 dB, or a function that finds it in `S`, such as `numpy.max`.
    amin : float
        Smallest power that is told apart from zero.
    top_db : float, optional
        Range in dB below the maximum over the whole array, channels included; None keeps all.

    Returns
    -------
    dB, in the shape and precision of `S`

    Examples
    --------
    >>> corsmal_feat.power_to_db(np.array([1.0, 0.1, 0.0]))
    array([  0., -10., -80.])
    """
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
    """Amplitude to decibels (librosa.amplitude_to_db): `power_to_db` of the squares.

    Parameters
    ----------
    S : float32 or float64, any shape
        Amplitudes.
    ref, amin, top_db
        As in `power_to_db`, `ref` and `amin` being amplitudes.

    Returns
    -------
    dB, in the shape and precision of `S`

    Examples
    --------
    >>> corsmal_feat.amplitude_to_db(np.array([1.0, 0.1]))
    array([  0., -20.])
    """
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
