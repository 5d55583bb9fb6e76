"""Filter banks and windows (librosa.filters)."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from .errors import ParameterError

__all__ = ["chroma", "get_window", "mel"]


def window_name(window: Any) -> str:
    """The name by which the Rust side knows a window: a string or ("kaiser", beta)."""
    if isinstance(window, str):
        return window
    if isinstance(window, tuple) and len(window) == 2 and window[0] == "kaiser":
        return f"kaiser:{float(window[1])}"
    raise ParameterError(f"window = {window!r} is not possible: a name or ('kaiser', beta)")


def get_window(window: Any, Nx: int, *, fftbins: bool = True) -> npt.NDArray[np.float64]:
    """A window of `Nx` points, periodic unless `fftbins=False` (librosa.filters.get_window).

    Parameters
    ----------
    window : str or ("kaiser", beta)
        Name.
    Nx : int
        Points.
    fftbins : bool
        Periodic, as transforms need it, or symmetric.

    Returns
    -------
    float64 [shape=(Nx,)]

    Examples
    --------
    >>> corsmal_feat.filters.get_window("hann", 4)
    array([0. , 0.5, 1. , 0.5])
    """
    return _core.get_window(window_name(window), int(Nx), bool(fftbins))


MelParams = tuple[float, int, int, float, float | None, bool, str]


def mel_params(
    sr: float,
    n_fft: int,
    n_mels: int,
    fmin: float,
    fmax: float | None,
    htk: bool,
    norm: Any,
) -> MelParams:
    """Filter bank parameters as the Rust side takes them."""
    if n_fft < 1 or n_mels < 1:
        raise ParameterError(f"n_fft = {n_fft}, n_mels = {n_mels} are not possible: at least 1")
    name = "none" if norm is None else norm if isinstance(norm, str) else repr(float(norm))
    high = None if fmax is None else float(fmax)
    return float(sr), int(n_fft), int(n_mels), float(fmin), high, bool(htk), name


def mel(
    *,
    sr: float,
    n_fft: int,
    n_mels: int = 128,
    fmin: float = 0.0,
    fmax: float | None = None,
    htk: bool = False,
    norm: Any = "slaney",
    dtype: npt.DTypeLike = np.float32,
) -> npt.NDArray[Any]:
    """Mel filter bank [shape=(n_mels, 1 + n_fft/2)], float32 (librosa.filters.mel).

    Parameters
    ----------
    sr : float
        Sample rate in Hz.
    n_fft, n_mels : int
        Length of the transform, bands.
    fmin, fmax : float
        Range in Hz; fmax is `sr / 2` by default.
    htk : bool
        HTK's scale, or Slaney's.
    norm : {"slaney", None} or float
        Bands of equal area, of height 1, or of a norm of 1.
    dtype : dtype
        Of the result; computed as float32.

    Returns
    -------
    [shape=(n_mels, 1 + n_fft // 2)]

    Examples
    --------
    >>> corsmal_feat.filters.mel(sr=44100, n_fft=2048).shape
    (128, 1025)
    """
    bank, empty = _core.mel(mel_params(sr, n_fft, n_mels, fmin, fmax, htk, norm))
    if empty:
        warn_empty()
    return bank.astype(dtype, copy=False)


def warn_empty() -> None:
    """What librosa warns of: bands too narrow to hold a bin."""
    warnings.warn(
        "Empty filters detected in the mel bank: fewer n_mels or a longer n_fft avoid them",
        stacklevel=3,
    )


ChromaParams = tuple[float, int, int, float, float, float | None, float | None, bool]


def chroma_params(
    sr: float,
    n_fft: int,
    n_chroma: int,
    tuning: float,
    ctroct: float,
    octwidth: float | None,
    norm: float | None,
    base_c: bool,
) -> ChromaParams:
    """Filter bank parameters as the Rust side takes them."""
    if n_fft < 1 or n_chroma < 1:
        raise ParameterError(f"n_fft = {n_fft}, n_chroma = {n_chroma} are not possible: at least 1")
    width = None if octwidth is None else float(octwidth)
    power = None if norm is None else float(norm)
    return (
        float(sr), int(n_fft), int(n_chroma), float(tuning), float(ctroct), width, power,
        bool(base_c),
    )  # fmt: skip


def chroma(
    *,
    sr: float,
    n_fft: int,
    n_chroma: int = 12,
    tuning: float = 0.0,
    ctroct: float = 5.0,
    octwidth: float | None = 2,
    norm: float | None = 2,
    base_c: bool = True,
    dtype: npt.DTypeLike = np.float32,
) -> npt.NDArray[Any]:
    """Chroma filter bank [shape=(n_chroma, 1 + n_fft/2)] (librosa.filters.chroma).

    Parameters
    ----------
    sr : float
        Sample rate in Hz.
    n_fft, n_chroma : int
        Length of the transform, bins of the octave.
    tuning : float
        Deviation from A440 in fractions of a bin.
    ctroct, octwidth : float
        Centre and width in octaves of the dominance window; width None for none.
    norm : float, optional
        Norm of each column.
    base_c : bool
        Begin with C, not A.
    dtype : dtype
        Of the result.

    Returns
    -------
    [shape=(n_chroma, 1 + n_fft // 2)]

    Examples
    --------
    >>> corsmal_feat.filters.chroma(sr=44100, n_fft=2048).shape
    (12, 1025)
    """
    params = chroma_params(sr, n_fft, n_chroma, tuning, ctroct, octwidth, norm, base_c)
    return _core.chroma_filter(params).astype(dtype, copy=False)
