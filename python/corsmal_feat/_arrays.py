"""Checks and shapes shared by the functions on arrays."""

from __future__ import annotations

from math import prod
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from . import _core
from .errors import ParameterError

Singles = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Floats = Singles | Doubles
Complexes = npt.NDArray[np.complex64] | npt.NDArray[np.complex128]
#: an array of either precision, and the same one again
Same = TypeVar("Same", Singles, Doubles, Floats, Complexes)


#: Largest number accepted as a size; whether memory has room is checked where it is allocated.
MOST = 1 << 40


def size(name: str, value: Any, least: int = 1) -> int:
    """A whole number from the caller that is used as a size."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)):
        raise ParameterError(f"{name} must be a whole number, not {value!r}")
    if not least <= value <= MOST:
        raise ParameterError(f"{name} must be {least} to {MOST}, not {value}")
    if value != int(value):
        raise ParameterError(f"{name} must be a whole number, not {value}")
    return int(value)


def number(name: str, value: Any) -> float:
    """A number from the caller."""
    if not isinstance(value, str | bytes):
        try:
            return float(value)
        except (TypeError, ValueError):
            pass
    raise ParameterError(f"{name} must be a number, not {value!r}")


def precision(dtype: npt.DTypeLike) -> np.dtype[Any]:
    """A type of samples or results: float32 or float64."""
    kind = np.dtype(dtype)
    if kind not in (np.float32, np.float64):
        raise ParameterError(f"dtype must be float32 or float64, not {dtype}")
    return kind


def room(what: str, *shape: int) -> None:
    """Refuses an array of doubles that does not fit in memory, before anything is computed: the
    Rust side would abort the process."""
    count = prod(shape)
    if count < 1 << 17:
        return
    try:
        if count <= MOST:
            np.empty(count)
            return
    except MemoryError:
        pass
    sizes = " x ".join(map(str, shape))
    raise ParameterError(f"not enough memory for {what} of {sizes} values")


def unmasked(name: str, value: Any) -> Any:
    """`value` itself; refused if it is a masked array that hides values, or a list with one."""
    for part in value if isinstance(value, list | tuple) else (value,):
        if isinstance(part, np.ma.MaskedArray) and np.ma.is_masked(part):
            raise ParameterError(
                f"{name} must not hide values by a mask, but {part.mask.sum()} of {part.size}"
                " are hidden: fill them first, for example with .filled(0)"
            )
    return value


def as_array(name: str, value: Any, dtype: npt.DTypeLike | None = None) -> npt.NDArray[Any]:
    """An array from the caller, aligned as the Rust side needs it. Functions that return masked
    arrays for masked arrays do not need this."""
    array = np.asarray(unmasked(name, value), dtype=dtype)
    return array if array.flags.aligned else array.copy()


def floats(name: str, value: Any, min_ndim: int = 1) -> Floats:
    """A float32 or float64 array; others are refused with a hint."""
    array = as_array(name, value)
    if array.dtype.kind == "f" and not array.dtype.isnative:
        array = array.astype(array.dtype.newbyteorder("="))
    if array.dtype not in (np.float32, np.float64):
        raise ParameterError(
            f"{name} has dtype {array.dtype}, expected float32 or float64{_advice(name, array)}"
        )
    if array.ndim < min_ndim:
        raise ParameterError(f"{name} has {array.ndim} dimensions, expected at least {min_ndim}")
    return array


def _advice(name: str, given: npt.NDArray[Any]) -> str:
    """How to convert an array of another type."""
    kind, bits = given.dtype.kind, 8 * given.dtype.itemsize
    if kind not in "iuf":
        return ""
    if kind == "f" or name != "y":
        return "; cast it first, for example with .astype(numpy.float32)"
    if bits > 16:
        return (
            "; divide the samples by their full scale (2**15 for 16 bits) and cast them to float32"
            " first"
        )
    half = f"2**{bits - 1}"
    if kind == "u":
        # Silence is in the middle of the range.
        return (
            f"; cast {given.dtype} samples to float32 first, then subtract {half} and divide by"
            f" {half}"
        )
    return f"; divide {given.dtype} samples by {half} and cast them to float32 first"


def spectrum(S: Any, min_ndim: int = 2) -> Floats:
    """A spectrogram `S` [shape=(..., d, t)]; whole numbers become double precision."""
    array = as_array("S", S)
    return floats("S", array.astype(np.float64) if array.dtype.kind in "iu" else array, min_ndim)


def audio(y: Any) -> Floats:
    """`y` [shape=(..., n)], finite."""
    array = floats("y", y)
    flags = array.flags
    contiguous = flags.c_contiguous or flags.f_contiguous
    if not (_core.all_finite(array) if contiguous else np.isfinite(array).all()):
        raise ParameterError("y contains NaN or infinite values")
    return array


def rows(array: Same, keep: int) -> Same:
    """Leading axes flattened to one and the last `keep` axes kept, contiguous."""
    return np.ascontiguousarray(array.reshape(_flattened(array.shape, keep)))


def _flattened(shape: tuple[int, ...], keep: int) -> Any:
    split = len(shape) - keep
    return (prod(shape[:split]), *shape[split:])


def channels(y: Same) -> Same:
    """A signal as [shape=(channels, n)]: planar, or interleaved where it already is."""
    return y if y.ndim == 2 and y.flags.f_contiguous else rows(y, 1)


def unrows(result: Same, like: Floats, keep: int) -> Same:
    """`result` with the leading axes of `like` (whose last `keep` axes were data) put back."""
    return result.reshape((*like.shape[: like.ndim - keep], *result.shape[1:]))
