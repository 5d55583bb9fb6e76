"""Inverse short-time Fourier transform (librosa.istft)."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, as_array, room, size
from ._filters import Window
from ._refusals import refuses
from ._spectrum import stft_params
from .errors import ParameterError


@refuses
def istft(
    stft_matrix: npt.ArrayLike,
    *,
    hop_length: int | None = None,
    win_length: int | None = None,
    n_fft: int | None = None,
    window: Window = "hann",
    center: bool = True,
    dtype: npt.DTypeLike | None = None,
    length: int | None = None,
    out: Floats | None = None,
) -> Floats:
    """Inverse short-time Fourier transform: the signal of a spectrogram (librosa.istft).

    Parameters
    ----------
    stft_matrix : complex64 or complex128 [shape=(..., 1 + n_fft // 2, t)]
        Spectrogram.
    hop_length, win_length, n_fft, window, center
        As in `stft`.
    length : int, optional
        Number of samples of the result.
    dtype : float32 or float64, optional
        Type of the result; by default, the precision of `stft_matrix`.
    out : array, optional
        Array to write the result to.

    Returns
    -------
    float32 or float64 [shape=(..., n)]

    Examples
    --------
    >>> y = np.random.default_rng(0).normal(size=8000)
    >>> np.allclose(corsmal_feat.istft(corsmal_feat.stft(y), length=8000), y)
    True
    """
    d = as_array("stft_matrix", stft_matrix)
    if d.ndim < 2:
        raise ParameterError(f"stft_matrix has {d.ndim} dimensions, expected at least 2")
    if d.shape[-1] == 0:
        raise ParameterError("stft_matrix has 0 frames, expected at least 1")
    single = d.dtype.newbyteorder("=") in (np.complex64, np.float32)
    d = d.astype(np.complex64 if single else np.complex128, copy=False)
    if n_fft is None:
        n_fft = 2 * (d.shape[-2] - 1)
    params = stft_params(n_fft, hop_length, win_length, window, center, "constant")
    samples = size("length", length) if length else None
    room("a signal", d.size // (d.shape[-2] * d.shape[-1] or 1), samples or 0)
    stacked = d.reshape(math.prod(d.shape[:-2]), *d.shape[-2:])
    if not stacked.flags.f_contiguous:
        stacked = np.ascontiguousarray(stacked)
    flat = _core.istft(stacked, params, samples)
    y: Floats = flat.reshape(*d.shape[:-2], flat.shape[-1])
    for name, kind in (("dtype", dtype), ("out", None if out is None else out.dtype)):
        if kind is not None and np.dtype(kind).kind not in "fc":
            raise ParameterError(
                f"{name} is {np.dtype(kind)}, which cannot hold samples: expected float32 or"
                " float64"
            )
    if dtype is not None:
        y = y.astype(dtype, copy=False)
    if out is None:
        return y
    if out.shape != y.shape:
        raise ParameterError(f"out has shape {out.shape}, expected {y.shape}")
    out[...] = y
    return out
