"""Harmonic-percussive separation of spectrograms and signals (librosa.decompose.hpss)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, as_array, audio, floats, number, rows, size, unrows
from ._filters import Window
from ._params import HpssParams
from ._refusals import refuses
from ._spectrum import stft_params, warn_short
from .errors import ParameterError


def _pair(value: Any) -> tuple[Any, Any]:
    """A value for the harmonic and one for the percussive side."""
    if isinstance(value, tuple | list):
        if len(value) < 2:
            raise ParameterError(
                f"kernel_size and margin must be a number or a pair, not {value!r}"
            )
        return value[0], value[1]
    return value, value


def _hpss_params(kernel_size: Any, power: float, margin: Any) -> HpssParams:
    kernels, margins = _pair(kernel_size), _pair(margin)
    return HpssParams(
        kernel_harmonic=size("kernel_size", kernels[0]),
        kernel_percussive=size("kernel_size", kernels[1]),
        power=number("power", power),
        margin_harmonic=number("margin", margins[0]),
        margin_percussive=number("margin", margins[1]),
    )


@refuses
def hpss(
    S: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Harmonic and percussive parts of a spectrogram by median filtering (librosa.decompose.hpss).

    Parameters
    ----------
    S : float or complex [shape=(..., d, t)]
        Spectrogram.
    kernel_size : int or pair of int
        Length of the median filters: in frames for the harmonic part, in bins for the percussive.
    power : float
        Exponent of the soft masks; infinity for binary masks.
    mask : bool
        Whether to return the masks instead of the parts.
    margin : float or pair of float
        Factor, at least 1, by which one part must exceed the other.

    Returns
    -------
    harmonic and percussive parts, or masks, each in the shape of `S`

    Examples
    --------
    >>> S = np.abs(corsmal_feat.stft(np.random.default_rng(0).normal(size=22050)))
    >>> harmonic, percussive = corsmal_feat.decompose.hpss(S)
    >>> np.allclose(harmonic + percussive, S)
    True
    """
    params = _hpss_params(kernel_size, power, margin)
    spectrogram = as_array("S", S)
    s = floats("S", np.abs(spectrogram) if np.iscomplexobj(spectrogram) else spectrogram, 2)
    harmonic, percussive = (unrows(m, s, 2) for m in _core.hpss_masks(rows(s, 2), params))
    if np.isinf(power):
        harmonic, percussive = harmonic.astype(bool), percussive.astype(bool)
    if mask:
        return harmonic, percussive
    return spectrogram * harmonic, spectrogram * percussive


def _separate(
    y: Any,
    kernel_size: Any,
    power: float,
    mask: bool,
    margin: Any,
    n_fft: int,
    hop_length: int | None,
    win_length: int | None,
    center: bool,
    pad_mode: str,
    parts: tuple[bool, bool],
) -> list[Floats]:
    """The requested ones of the harmonic and percussive parts."""
    y = audio(y)
    stft_tuple = stft_params(n_fft, hop_length, win_length, "hann", center, pad_mode)
    params = _hpss_params(kernel_size, power, margin)
    warn_short(y, n_fft)
    separated = _core.separate(rows(y, 1), stft_tuple, params, bool(mask), *parts)
    return [unrows(part, y, 1) for part in separated]


@refuses
def effects_hpss(
    y: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Harmonic and percussive parts of a signal (librosa.effects.hpss).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    kernel_size, power, mask, margin
        See `decompose.hpss`.
    n_fft, hop_length, win_length, center, pad_mode
        See `stft`.
    window : str
        Has no effect, as in librosa.

    Returns
    -------
    harmonic and percussive parts, each in the shape of `y`

    Examples
    --------
    >>> y = np.sin(0.1 * np.arange(22050))
    >>> harmonic, percussive = corsmal_feat.effects.hpss(y)
    >>> harmonic.shape
    (22050,)
    """
    harmonic, percussive = _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (True, True),
    )  # fmt: skip
    return harmonic, percussive


@refuses
def harmonic(
    y: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Floats:
    """Harmonic part of a signal (librosa.effects.harmonic).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    kernel_size, power, mask, margin
        See `decompose.hpss`.
    n_fft, hop_length, win_length, center, pad_mode
        See `stft`.
    window : str
        Has no effect, as in librosa.

    Returns
    -------
    harmonic part, in the shape of `y`

    Examples
    --------
    >>> corsmal_feat.effects.harmonic(np.sin(0.1 * np.arange(22050))).shape
    (22050,)
    """
    (part,) = _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (True, False),
    )  # fmt: skip
    return part


@refuses
def percussive(
    y: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Floats:
    """Percussive part of a signal (librosa.effects.percussive).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    kernel_size, power, mask, margin
        See `decompose.hpss`.
    n_fft, hop_length, win_length, center, pad_mode
        See `stft`.
    window : str
        Has no effect, as in librosa.

    Returns
    -------
    percussive part, in the shape of `y`

    Examples
    --------
    >>> corsmal_feat.effects.percussive(np.sin(0.1 * np.arange(22050))).shape
    (22050,)
    """
    (part,) = _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (False, True),
    )  # fmt: skip
    return part


@refuses
def hpss_masks(S: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Harmonic and percussive masks, stacked.

    Parameters
    ----------
    S : [shape=(..., bins, frames)]
        Spectrogram.
    **kwargs
        See `decompose.hpss`.

    Returns
    -------
    array [shape=(2, ..., bins, frames)]

    Examples
    --------
    >>> corsmal_feat.corsmal.hpss_masks(np.ones((9, 5))).shape
    (2, 9, 5)
    """
    return np.stack(hpss(S, mask=True, **kwargs))


@refuses
def hpss_mags(S: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Harmonic and percussive parts of a spectrogram, stacked.

    Parameters
    ----------
    S : [shape=(..., bins, frames)]
        Spectrogram.
    **kwargs
        See `decompose.hpss`.

    Returns
    -------
    array [shape=(2, ..., bins, frames)]

    Examples
    --------
    >>> corsmal_feat.corsmal.hpss_mags(np.ones((9, 5))).sum(axis=0).max()
    np.float64(1.0)
    """
    return np.stack(hpss(S, **kwargs))


@refuses
def hpss_audio(y: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Harmonic and percussive parts of a signal, stacked.

    Parameters
    ----------
    y : [shape=(..., n)]
        Signal.
    **kwargs
        See `effects.hpss`.

    Returns
    -------
    array [shape=(2, ..., n)]

    Examples
    --------
    >>> corsmal_feat.corsmal.hpss_audio(np.sin(np.arange(4096.0))).shape
    (2, 4096)
    """
    return np.stack(effects_hpss(y, **kwargs))
