"""Filter banks and windows (librosa.filters)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, number, precision, room, size
from ._params import ChromaParams, MelParams, WindowSpec
from ._refusals import refuses
from ._warnings import warn
from .errors import ParameterError

#: a name, ("kaiser", 8.6), the beta of a Kaiser window, an array, or a function
Window = (
    str
    | tuple[Any, ...]
    | float
    | Sequence[float]
    | npt.NDArray[Any]
    | Callable[[int], npt.ArrayLike]
)
#: scaling of the bands of a mel filter bank
Norm = Literal["slaney"] | float | None

#: Longest window; bounds the memory that a number from the caller can take.
_LONGEST = 1 << 26


def window_spec(window: Window, length: int) -> WindowSpec:
    """A window of `length` points in the form that the Rust side takes."""
    if isinstance(window, str):
        return window
    if isinstance(window, (int, float, np.number)) and not isinstance(window, bool):
        return f"kaiser:{float(window)!r}"
    if isinstance(window, tuple) and window and isinstance(window[0], str):
        return ":".join([window[0], ",".join(_parameters(window))])
    if callable(window):
        if not 0 < length <= _LONGEST:
            raise ParameterError(f"a window must have 1 to {_LONGEST} points, not {length}")
        window = np.asarray(window(length))
    try:
        if np.iscomplexobj(np.asarray(window)):
            raise ParameterError("window must be real, not complex")
        values = np.ascontiguousarray(as_array("window", window, np.float64))
    except ParameterError:
        raise
    except (TypeError, ValueError):
        values = np.empty(())
    if values.ndim != 1:
        raise ParameterError(
            "window must be a name, a tuple of a name and parameters, a number (the beta of a"
            f" Kaiser window), an array, or a function of the length, not {window!r}"
        )
    if len(values) != length:
        raise ParameterError(f"Window size mismatch: {len(values)} points, expected {length}")
    if not np.isfinite(values).all():
        raise ParameterError("window contains NaN or infinite values")
    return values


def wavelet_window(window: Window) -> WindowSpec:
    """A window for filters of many lengths, which only a formula can give."""
    if callable(window) or not isinstance(window, (str, tuple, int, float, np.number)):
        raise ParameterError(
            "window must be a name, a tuple of a name and parameters, or a number, since the"
            f" filters differ in length, not {window!r}"
        )
    return window_spec(window, 1)


def _parameters(window: tuple[Any, ...]) -> list[str]:
    """The parameters of a window as text."""
    words = []
    for value in window[1:]:
        several = np.ravel(value) if isinstance(value, (list, tuple, np.ndarray)) else [value]
        try:
            words += ["none" if one is None else repr(float(one)) for one in several]
        except (TypeError, ValueError) as error:
            raise ParameterError(f"window {window!r}: {error}") from error
    return words


@refuses
def get_window(window: Window, Nx: int, *, fftbins: bool = True) -> npt.NDArray[np.float64]:
    """A window of `Nx` points, periodic unless `fftbins=False` (librosa.filters.get_window).

    Parameters
    ----------
    window : str, tuple, float, array or callable
        A name of scipy's; a tuple of a name and its parameters; the beta of a Kaiser window; an
        array of `Nx` values; or a function of `Nx` that returns one.
    Nx : int
        Number of points.
    fftbins : bool
        Whether the window is periodic, as transforms need, or symmetric.

    Returns
    -------
    float64 [shape=(Nx,)]

    Examples
    --------
    >>> corsmal_feat.filters.get_window("hann", 4)
    array([0. , 0.5, 1. , 0.5])
    """
    if not 0 <= Nx <= _LONGEST:
        raise ParameterError(f"Nx must be 0 to {_LONGEST}, not {Nx}")
    length = size("Nx", Nx, 0)
    return _core.get_window(window_spec(window, length), length, bool(fftbins))


def mel_params(
    sr: float,
    n_fft: int,
    n_mels: int,
    fmin: float,
    fmax: float | None,
    htk: bool,
    norm: Norm,
) -> MelParams:
    """Parameters of a filter bank in the form that the Rust side takes."""
    n_fft, n_mels = size("n_fft", n_fft), size("n_mels", n_mels)
    room("a filter bank", 2, n_mels, n_fft // 2 + 1)
    name = "none" if norm is None else norm if isinstance(norm, str) else repr(number("norm", norm))
    high = None if fmax is None else number("fmax", fmax)
    return MelParams(
        number("sr", sr), int(n_fft), int(n_mels), number("fmin", fmin), high, bool(htk), name
    )


@refuses
def mel(
    *,
    sr: float,
    n_fft: int,
    n_mels: int = 128,
    fmin: float = 0.0,
    fmax: float | None = None,
    htk: bool = False,
    norm: Norm = "slaney",
    dtype: npt.DTypeLike = np.float32,
) -> npt.NDArray[Any]:
    """Mel filter bank (librosa.filters.mel).

    Parameters
    ----------
    sr : float
        Sample rate in Hz.
    n_fft, n_mels : int
        Length of the transform, and number of bands.
    fmin, fmax : float
        Lowest and highest frequency in Hz; by default, `fmax` is `sr / 2`.
    htk : bool
        Whether to use HTK's mel scale instead of Slaney's.
    norm : {"slaney", None} or float
        "slaney" gives bands of equal area, None bands of height 1, a number bands whose norm of
        that order is 1.
    dtype : dtype
        Type of the result, which is computed as float32.

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
    return bank.astype(precision(dtype), copy=False)


def warn_empty() -> None:
    """librosa's warning about bands too narrow to hold a bin."""
    warn("Empty filters detected in the mel filter bank: use fewer n_mels or a longer n_fft")


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
    """Parameters of a filter bank in the form that the Rust side takes."""
    n_fft, n_chroma = size("n_fft", n_fft), size("n_chroma", n_chroma)
    room("a filter bank", 4, n_chroma, n_fft // 2 + 1)
    width = None if octwidth is None else number("octwidth", octwidth)
    power = None if norm is None else number("norm", norm)
    return ChromaParams(
        sr=number("sr", sr),
        n_fft=int(n_fft),
        n_chroma=int(n_chroma),
        tuning=number("tuning", tuning),
        ctroct=number("ctroct", ctroct),
        octwidth=width,
        norm=power,
        base_c=bool(base_c),
    )


@refuses
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
    """Chroma filter bank (librosa.filters.chroma).

    Parameters
    ----------
    sr : float
        Sample rate in Hz.
    n_fft, n_chroma : int
        Length of the transform, and bins per octave.
    tuning : float
        Deviation from A440 in fractions of a bin.
    ctroct, octwidth : float
        Centre and width of the dominance window in octaves; None as width for no window.
    norm : float, optional
        Norm of each column.
    base_c : bool
        Whether the first bin is C instead of A.
    dtype : dtype
        Type of the result.

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
