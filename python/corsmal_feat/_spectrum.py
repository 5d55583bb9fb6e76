"""Short-time Fourier transform (librosa.stft), and the spectra behind features."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Complexes, Floats, Same, audio, channels, number, rows, size, spectrum, unrows
from ._filters import Window, window_spec
from ._params import StftParams
from ._refusals import refuses
from ._warnings import warn
from .errors import ParameterError

#: hop_length, win_length, window, center, pad_mode as they were given
Framing = tuple[int | None, int | None, Window, bool, str]


def stft_params(
    n_fft: int,
    hop_length: int | None,
    win_length: int | None,
    window: Any,
    center: bool,
    pad_mode: str,
) -> StftParams:
    """Parameters of a transform, with librosa's defaults: the hop is a quarter of the window."""
    n_fft = size("n_fft", n_fft)
    win_length = size("win_length", n_fft if win_length is None else win_length)
    hop_length = size("hop_length", win_length // 4 if hop_length is None else hop_length)
    spec = window_spec(window, win_length)
    return StftParams(n_fft, hop_length, win_length, spec, bool(center), str(pad_mode))


@refuses
def stft(
    y: npt.ArrayLike,
    *,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    dtype: npt.DTypeLike | None = None,
    pad_mode: str = "constant",
    out: npt.NDArray[Any] | None = None,
) -> Complexes:
    """Short-time Fourier transform (librosa.stft).

    float32 signals are transformed in single precision (within 1e-6 of the largest value of a
    frame), float64 signals in double precision.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal, with any number of leading axes.
    n_fft : int
        Length of the transform in samples.
    hop_length : int, optional
        Samples between frames; `win_length // 4` by default.
    win_length : int, optional
        Length of the window in samples, at most `n_fft`, which is the default. It is centred.
    window : str, tuple, float, array or callable
        See `filters.get_window`.
    center : bool
        Whether frame `t` is centred on sample `t * hop_length`; otherwise, it starts there.
    pad_mode : {"constant", "edge", "reflect", "symmetric"}
        How to pad the signal at both ends if `center`.
    dtype : complex dtype, optional
        Type of the result; by default, in the precision of `y`.
    out : complex [shape=(..., 1 + n_fft // 2, at least t)], optional
        Array to write the result to.

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
    warn_short(y, n_fft)
    result: Any = unrows(_core.stft(channels(y), params), y, 1)
    if dtype is not None:
        if np.dtype(dtype).kind != "c":
            raise ParameterError(f"dtype must be a complex type, not {dtype}")
        result = result.astype(dtype, copy=False)
    spectrum: Complexes = result if out is None else _put(result, out)
    return spectrum


def _put(result: Any, out: npt.NDArray[Any]) -> Any:
    """`result` in the first frames of `out`."""
    frames = result.shape[-1]
    if out.shape[:-1] != result.shape[:-1] or out.shape[-1] < frames:
        raise ParameterError(f"out has shape {out.shape}, expected {result.shape}, or more frames")
    if not np.iscomplexobj(out):
        raise ParameterError(f"out has dtype {out.dtype}, expected a complex type")
    part = out if out.shape[-1] == frames else out[..., :frames]
    part[...] = result
    return part


def warn_short(y: Floats, n_fft: int) -> None:
    """librosa's warning where one frame is longer than the signal."""
    if y.shape[-1] < n_fft:
        warn(f"n_fft={n_fft} is larger than the signal of {y.shape[-1]} samples")


class Spectra(NamedTuple):
    """The input of a feature. The Rust side computes the spectra of a signal one at a time, so no
    spectrogram is kept in memory."""

    #: a signal [shape=(channels, n)] and its transform, or a spectrogram
    source: Floats | tuple[Floats, StftParams]
    #: the leading axes of the caller's array
    leading: tuple[int, ...]
    n_fft: int
    #: the shape of the spectrogram where there is one
    shape: tuple[int, ...] | None

    def restored(self, result: Same) -> Same:
        """`result` [shape=(channels, ...)] with the leading axes of the caller's array."""
        shaped: Same = result.reshape((*self.leading, *result.shape[1:]))
        return shaped


def signal(
    y: Any,
    n_fft: int,
    hop_length: int | None,
    win_length: int | None,
    window: Any,
    center: bool,
    pad_mode: str,
) -> tuple[Floats, StftParams]:
    """`y` and the parameters of its transform, after checks."""
    if y is None:
        raise ParameterError("y or S must be given")
    y = audio(y)
    params = stft_params(n_fft, hop_length, win_length, window, center, pad_mode)
    warn_short(y, n_fft)
    return y, params


def length_of(s: Floats, n_fft: int) -> int:
    """The transform length of a spectrogram: `n_fft`, unless the number of bins differs."""
    return n_fft if n_fft // 2 + 1 == s.shape[-2] else 2 * (s.shape[-2] - 1)


def spectra(y: Any, S: Any, n_fft: int, framing: Framing) -> Spectra:
    """Magnitudes, from `S` or from a transform of `y`."""
    if S is not None:
        s = spectrum(S)
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
    """`S` or, if it is None, |stft(y)|**power from a transform in double precision, with the length
    of the transform (librosa.core.spectrum._spectrogram)."""
    if S is not None:
        S = spectrum(S)
        return S, length_of(S, n_fft)
    y, params = signal(y, n_fft, hop_length, win_length, window, center, pad_mode)
    return unrows(_core.spectrogram(channels(y), params, number("power", power)), y, 1), n_fft
