"""Framing, padding, normalisation (librosa.util)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._arrays import as_array, unmasked
from ._arrays import size as whole
from ._refusals import refuses
from .errors import ParameterError

__all__ = ["fix_frames", "fix_length", "frame", "normalize", "pad_center", "tiny", "valid_audio"]

Array = npt.NDArray[Any]


def _along(x: Array, axis: int, name: str = "data") -> int:
    if x.ndim == 0:
        raise ParameterError(f"{name} has 0 dimensions, expected at least 1")
    if not -x.ndim <= axis < x.ndim:
        raise ParameterError(
            f"axis must be an axis of the array, which has {x.ndim} dimensions, not {axis}"
        )
    return int(x.shape[axis])


@refuses
def frame(
    x: npt.ArrayLike,
    *,
    frame_length: int,
    hop_length: int,
    axis: int = -1,
    writeable: bool = False,
    subok: bool = False,
) -> Array:
    """Overlapping frames of an array, as a view (librosa.util.frame).

    Parameters
    ----------
    x : array
        Array to cut into frames.
    frame_length, hop_length : int
        Elements per frame, and from one frame to the next.
    axis : int
        Axis to cut. A negative axis gives [shape=(..., frame_length, t)], any other
        [shape=(t, frame_length, ...)].
    writeable : bool
        Whether the view can be written to; note that its elements overlap.
    subok : bool
        Whether to keep a subclass of `numpy.ndarray`.

    Returns
    -------
    view of `x` with one more dimension

    Examples
    --------
    >>> corsmal_feat.util.frame(np.arange(6), frame_length=4, hop_length=2)
    array([[0, 2],
           [1, 3],
           [2, 4],
           [3, 5]])
    """
    array = np.asanyarray(unmasked("x", x)) if subok else np.asarray(unmasked("x", x))
    length = _along(array, axis, "x")
    if frame_length < 1 or length < frame_length:
        raise ParameterError(
            f"frame_length must be 1 to {length}, the length of the input, not {frame_length}"
        )
    if hop_length < 1:
        raise ParameterError(f"hop_length must be at least 1, not {hop_length}")
    windows = np.lib.stride_tricks.sliding_window_view(
        array, whole("frame_length", frame_length), axis, subok=subok, writeable=writeable
    )
    # The elements of a frame come before the frames, or after them for an axis from the front.
    windows = np.moveaxis(windows, -1, axis - 1 if axis < 0 else axis + 1)
    steps = [slice(None)] * windows.ndim
    steps[axis] = slice(0, None, whole("hop_length", hop_length))
    return windows[tuple(steps)]


@refuses
def fix_length(data: npt.ArrayLike, *, size: int, axis: int = -1, **kwargs: Any) -> Array:
    """Cuts or pads an axis to `size` (librosa.util.fix_length).

    Parameters
    ----------
    data : array
        Array to cut or pad at the end of the axis.
    size : int
        Length of the axis in the result.
    axis : int
        Axis to change.
    **kwargs
        Arguments of `numpy.pad`; zeros by default.

    Returns
    -------
    array of that size along `axis`

    Examples
    --------
    >>> corsmal_feat.util.fix_length(np.arange(3), size=5)
    array([0, 1, 2, 0, 0])
    """
    array = as_array("data", data)
    length, size = _along(array, axis), whole("size", size, 0)
    if length > size:
        part = [slice(None)] * array.ndim
        part[axis] = slice(0, size)
        return array[tuple(part)]
    if length == size:
        return array
    widths = [(0, 0)] * array.ndim
    widths[axis] = (0, size - length)
    return _padded(array, widths, kwargs)


def _padded(array: Array, widths: list[tuple[int, int]], kwargs: dict[str, Any]) -> Array:
    kwargs.setdefault("mode", "constant")
    try:
        padded: Array = np.pad(array, widths, **kwargs)
    except MemoryError as error:
        raise ParameterError(f"not enough memory for padding of {widths}: {error}") from error
    return padded


@refuses
def pad_center(data: npt.ArrayLike, *, size: int, axis: int = -1, **kwargs: Any) -> Array:
    """Pads an axis on both sides to `size` (librosa.util.pad_center).

    Parameters
    ----------
    data : array
        Array to pad; it ends up in the middle.
    size : int
        Length of the axis in the result, at least the present one.
    axis : int
        Axis to change.
    **kwargs
        Arguments of `numpy.pad`; zeros by default.

    Returns
    -------
    array of that size along `axis`

    Examples
    --------
    >>> corsmal_feat.util.pad_center(np.ones(2), size=5)
    array([0., 1., 1., 0., 0.])
    """
    array = as_array("data", data)
    length = _along(array, axis)
    if size < length:
        raise ParameterError(f"size must be at least {length}, the length of data, not {size}")
    before = (whole("size", size, 0) - length) // 2
    widths = [(0, 0)] * array.ndim
    widths[axis] = (before, int(size - length - before))
    return _padded(array, widths, kwargs)


@refuses
def fix_frames(
    frames: npt.ArrayLike, *, x_min: int | None = 0, x_max: int | None = None, pad: bool = True
) -> npt.NDArray[np.int64]:
    """Unique, sorted frame numbers within limits (librosa.util.fix_frames).

    Parameters
    ----------
    frames : int [shape=(n,)]
        Frame numbers, 0 or more.
    x_min, x_max : int, optional
        Limits.
    pad : bool
        Whether to add the limits and clip frames to them; otherwise, frames outside are dropped.

    Returns
    -------
    int64 [shape=(m,)]

    Examples
    --------
    >>> corsmal_feat.util.fix_frames([3, 9, 9, 40], x_max=20)
    array([ 0,  3,  9, 20])
    """
    values = as_array("frames", frames)
    if np.any(values < 0):
        raise ParameterError("frames must be at least 0, but some are negative")
    limits = [limit for limit in (x_min, x_max) if limit is not None]
    if pad and limits:
        values = np.concatenate([limits, np.clip(values, x_min, x_max)])
    if x_min is not None:
        values = values[values >= x_min]
    if x_max is not None:
        values = values[values <= x_max]
    return np.unique(values).astype(np.int64)


@refuses
def tiny(x: npt.ArrayLike) -> np.floating[Any]:
    """Smallest positive normal number in the precision of `x`, or in float32 if `x` holds integers
    (librosa.util.tiny).

    Parameters
    ----------
    x : number or array
        Value or array that gives the precision.

    Returns
    -------
    number

    Examples
    --------
    >>> float(corsmal_feat.util.tiny(np.float64(1)))
    2.2250738585072014e-308
    """
    kind = np.asarray(x).dtype
    smallest: np.floating[Any] = np.finfo(kind if kind.kind in "fc" else np.float32).tiny
    return smallest


@refuses
def valid_audio(y: object) -> bool:
    """Checks that `y` is a signal: returns True, or raises an error (librosa.util.valid_audio).

    Parameters
    ----------
    y : array
        Signal: floating-point, finite, with at least one dimension.

    Returns
    -------
    True

    Examples
    --------
    >>> corsmal_feat.util.valid_audio(np.zeros(9))
    True
    """
    if not isinstance(y, np.ndarray):
        raise ParameterError("Audio data must be of type numpy.ndarray; use numpy.asarray")
    if not np.issubdtype(y.dtype, np.floating):
        raise ParameterError(f"Audio data must be floating-point, got {y.dtype}; cast it first")
    if y.ndim == 0:
        raise ParameterError("Audio data must be at least one-dimensional, given y.shape=()")
    if not np.isfinite(unmasked("y", y)).all():
        raise ParameterError("Audio buffer is not finite everywhere")
    return True


@refuses
def normalize(
    S: npt.ArrayLike,
    *,
    norm: float | None = np.inf,
    axis: int | None = 0,
    threshold: float | None = None,
    fill: bool | None = None,
) -> Array:
    """Divides an array by its norm along an axis (librosa.util.normalize).

    Parameters
    ----------
    S : array
        Array of finite values.
    norm : {inf, -inf, 0, None} or float above 0
        inf or -inf for the largest or smallest magnitude, 0 for the number of non-zero values, a
        positive p for the p-norm; None to change nothing.
    axis : int, optional
        Axis of the norm; None for the norm of the whole array.
    threshold : float, optional
        Smaller norms count as zero.
    fill : bool, optional
        What becomes of values with too small a norm: they stay (None), or are set to 0 (False) or
        to a constant of norm 1 (True).

    Returns
    -------
    array in the shape and type of `S`

    Examples
    --------
    >>> corsmal_feat.util.normalize(np.array([[2.0, 0.0], [-4.0, 0.0]]))
    array([[ 0.5,  0. ],
           [-1. ,  0. ]])
    """
    array = as_array("S", S)
    if threshold is None:
        threshold = float(tiny(array))
    elif not threshold > 0:
        raise ParameterError(f"threshold must be above 0, not {threshold}")
    if fill not in (None, False, True):
        raise ParameterError(f"fill must be True, False or None, not {fill!r}")
    if not np.isfinite(array).all():
        raise ParameterError("S contains NaN or infinite values")
    if norm is None:
        return array
    if axis is not None:
        _along(array, axis, "S")
    magnitude = np.abs(array).astype(np.float64)
    constant = 1.0
    length: Any
    if norm == np.inf:
        length = magnitude.max(axis=axis, keepdims=True)
    elif norm == -np.inf:
        length = magnitude.min(axis=axis, keepdims=True)
    elif norm == 0:
        if fill:
            raise ParameterError("fill=True does not work with norm=0")
        length = np.sum(magnitude > 0, axis=axis, keepdims=True, dtype=np.float64)
    elif isinstance(norm, (int, float, np.number)) and norm > 0:
        length = np.sum(magnitude**norm, axis=axis, keepdims=True) ** (1.0 / norm)
        count = magnitude.size if axis is None else magnitude.shape[axis]
        constant = float(count) ** (-1.0 / norm)
    else:
        raise ParameterError(f"norm must be inf, -inf, 0, a positive number or None, not {norm!r}")
    small = length < threshold
    length = np.where(small, np.inf if fill is False else 1.0, length)
    result = np.empty_like(array)
    result[...] = array / length
    if fill:
        result[np.broadcast_to(small, result.shape)] = constant
    return result
