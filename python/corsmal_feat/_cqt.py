"""Constant-Q transform (librosa.cqt)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Complexes, Floats, audio, number, room, rows, size, unrows
from ._filters import Window, wavelet_window
from ._params import CqtParams
from ._pitch import estimate_tuning
from ._refusals import refuses
from ._resample import CONVERTERS
from ._warnings import warn
from .errors import ParameterError

#: Default lowest frequency in Hz.
C1 = 440.0 * 2.0 ** ((24.0 - 69.0) / 12.0)


def cqt_params(
    sr: float,
    hop_length: int,
    fmin: float | None,
    n_bins: int,
    bins_per_octave: int,
    tuning: float,
    filter_scale: float = 1.0,
    norm: float | None = 1.0,
    sparsity: float = 0.01,
    window: Window = "hann",
    scale: bool = True,
    pad_mode: str = "constant",
) -> CqtParams:
    return CqtParams(
        sr=number("sr", sr),
        hop_length=size("hop_length", hop_length),
        fmin=C1 if fmin is None else number("fmin", fmin),
        n_bins=size("n_bins", n_bins),
        bins_per_octave=size("bins_per_octave", bins_per_octave),
        tuning=number("tuning", tuning),
        filter_scale=number("filter_scale", filter_scale),
        norm=None if norm is None else number("norm", norm),
        sparsity=number("sparsity", sparsity),
        window=wavelet_window(window),
        scale=bool(scale),
        pad_mode=str(pad_mode),
    )


@refuses
def cqt(
    y: npt.ArrayLike,
    *,
    sr: float = 22050,
    hop_length: int = 512,
    fmin: float | None = None,
    n_bins: int = 84,
    bins_per_octave: int = 12,
    tuning: float | None = 0.0,
    filter_scale: float = 1,
    norm: float | None = 1,
    sparsity: float = 0.01,
    window: Window = "hann",
    scale: bool = True,
    pad_mode: str = "constant",
    res_type: str | None = "soxr_hq",
    dtype: npt.DTypeLike | None = None,
) -> Complexes:
    """Constant-Q transform (librosa.cqt).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal at the sample rate `sr` in Hz.
    hop_length : int
        Samples between frames.
    fmin : float, optional
        Lowest bin in Hz, C1 by default.
    n_bins, bins_per_octave : int
        Number of bins, and bins per octave.
    tuning : float, optional
        Deviation from A440 in fractions of a bin; None estimates one value for all channels.
    filter_scale : float
        Factor for the lengths of the filters.
    norm : float, optional
        Norm of the filters.
    sparsity : float
        Share of each filter's energy to drop.
    window : str, tuple or float
        See `filters.get_window`.
    scale : bool
        Whether to divide by the square roots of the filters' lengths.
    pad_mode : {"constant", "edge", "reflect", "symmetric"}
        How to pad the signal at both ends.
    res_type : str
        A type that `resample` accepts. It has no effect: octaves are always decimated by a filter
        that equals soxr's "HQ" within 1e-6.
    dtype : complex dtype, optional
        Type of the result.

    Returns
    -------
    complex64 or complex128 [shape=(..., n_bins, t)]

    Examples
    --------
    >>> y = np.sin(2 * np.pi * 440 * np.arange(22050) / 22050)
    >>> np.abs(corsmal_feat.cqt(y, sr=22050))[:, 20].argmax()
    np.int64(45)
    """
    y = audio(y)
    if res_type is None:
        warn(
            "Support for VQT with res_type=None is deprecated: it means 'soxr_hq'",
            FutureWarning,
        )
    elif res_type not in CONVERTERS:
        names = ", ".join(CONVERTERS)
        raise ParameterError(f"res_type must be one of {names}, not {res_type!r}")
    if tuning is None:
        tuning = estimate_tuning(y=y, sr=sr, bins_per_octave=bins_per_octave)
    params = cqt_params(
        sr, hop_length, fmin, n_bins, bins_per_octave, tuning, filter_scale, norm, sparsity,
        window, scale, pad_mode,
    )  # fmt: skip
    room("a transform", 2, y.size // (y.shape[-1] or 1), n_bins, 1 + y.shape[-1] // hop_length)
    result: Any = unrows(_core.cqt(rows(y, 1), params), y, 1)
    transform: Complexes = result if dtype is None else result.astype(dtype, copy=False)
    return transform


@refuses
def abs_cqt(y: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Constant-Q magnitudes.

    Parameters
    ----------
    y : [shape=(..., n)]
        Signal.
    **kwargs
        See `cqt`.

    Returns
    -------
    array [shape=(..., bins, frames)]

    Examples
    --------
    >>> corsmal_feat.corsmal.abs_cqt(np.sin(np.arange(22050.0)), n_bins=24).shape
    (24, 44)
    """
    return np.abs(cqt(y, **kwargs))
