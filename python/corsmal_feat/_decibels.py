"""Decibels and magnitudes (librosa.power_to_db and related functions)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Complexes, Floats, as_array, floats, number
from ._refusals import refuses
from ._warnings import warn
from .errors import ParameterError


@refuses
def power_to_db(
    S: npt.ArrayLike,
    *,
    ref: npt.ArrayLike | Callable[..., Any] = 1.0,
    amin: float = 1e-10,
    top_db: float | None = 80.0,
) -> Floats:
    """Power to decibels (librosa.power_to_db): 10 log10 of `S / ref`.

    Parameters
    ----------
    S : float32 or float64, any shape
        Powers; for complex values the magnitude is used, with a warning.
    ref : float, array that broadcasts to the shape of `S`, or callable
        The power of 0 dB, or a function that finds it in `S`, such as `numpy.max`.
    amin : float
        Smallest power; smaller values are raised to it.
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
    array: Any = as_array("S", S)
    if np.iscomplexobj(array):
        warn("power_to_db was called on complex input: phase is discarded")
        array = np.abs(array)
    scalar = array.ndim == 0
    array = floats("S", array.astype(np.float64) if array.dtype.kind in "iu" else array, 0)
    reference: Any = np.abs(ref(array) if callable(ref) else as_array("ref", ref))
    top = None if top_db is None else number("top_db", top_db)
    if reference.ndim:
        if top is not None and not top >= 0:
            raise ParameterError(f"top_db must be 0 or more, or None, not {top}")
        return _by_each(array, reference, number("amin", amin), top)
    reference = float(reference)
    result: Any = _core.power_to_db(
        np.ascontiguousarray(array), reference, number("amin", amin), top
    )
    decibels: Floats = result[0] if scalar else result.reshape(array.shape)
    return decibels


def _by_each(powers: Any, reference: Any, amin: float, top_db: float | None) -> Floats:
    """Decibels by references that differ."""
    above_amin: Any = _core.power_to_db(np.ascontiguousarray(powers), amin, amin, None)
    try:
        decibels: Any = above_amin.reshape(powers.shape) - 10.0 * np.log10(
            np.maximum(reference, amin) / amin
        )
        if decibels.shape != powers.shape:
            raise ValueError
    except ValueError:
        raise ParameterError(
            f"ref has shape {reference.shape}, which does not broadcast to that of S,"
            f" {powers.shape}"
        ) from None
    decibels = decibels.astype(powers.dtype, copy=False)
    if top_db is not None and decibels.size:
        decibels = np.maximum(decibels, decibels.max() - top_db)
    clamped: Floats = decibels
    return clamped


@refuses
def amplitude_to_db(
    S: npt.ArrayLike,
    *,
    ref: npt.ArrayLike | Callable[..., Any] = 1.0,
    amin: float = 1e-5,
    top_db: float | None = 80.0,
) -> Floats:
    """Amplitude to decibels (librosa.amplitude_to_db): `power_to_db` of the squares.

    Parameters
    ----------
    S : float32 or float64, any shape
        Amplitudes.
    ref, amin, top_db
        As in `power_to_db`, but `ref` and `amin` are amplitudes.

    Returns
    -------
    dB, in the shape and precision of `S`

    Examples
    --------
    >>> corsmal_feat.amplitude_to_db(np.array([1.0, 0.1]))
    array([  0., -20.])
    """
    S = as_array("S", S)
    if np.iscomplexobj(S):
        warn("amplitude_to_db was called on complex input: phase is discarded")
    if amin <= 0:
        raise ParameterError(f"amin must be above 0, not {amin}")
    magnitude = np.abs(S)
    reference = np.abs(ref(magnitude) if callable(ref) else as_array("ref", ref))
    squares: Any = np.square(magnitude)
    return power_to_db(squares, ref=reference**2, amin=amin**2, top_db=top_db)


@refuses
def db_to_power(S_db: npt.ArrayLike, *, ref: float = 1.0) -> Floats:
    """Decibels to power (librosa.db_to_power).

    Parameters
    ----------
    S_db : number or array
        Values in dB.
    ref : float
        The power of 0 dB.

    Returns
    -------
    powers, in the shape of `S_db`

    Examples
    --------
    >>> corsmal_feat.db_to_power(np.array([0.0, 10.0]))
    array([ 1., 10.])
    """
    power: Floats = ref * np.power(10.0, np.asanyarray(S_db) * 0.1)
    return power


@refuses
def db_to_amplitude(S_db: npt.ArrayLike, *, ref: float = 1.0) -> Floats:
    """Decibels to amplitude (librosa.db_to_amplitude).

    Parameters
    ----------
    S_db : number or array
        Values in dB.
    ref : float
        The amplitude of 0 dB.

    Returns
    -------
    amplitudes, in the shape of `S_db`

    Examples
    --------
    >>> corsmal_feat.db_to_amplitude(np.array([0.0, 20.0]))
    array([ 1., 10.])
    """
    amplitude: Floats = db_to_power(S_db, ref=ref**2) ** 0.5
    return amplitude


@refuses
def magphase(D: npt.ArrayLike, *, power: float = 1) -> tuple[Floats, Complexes]:
    """Magnitudes, and values of magnitude 1 with the phases (librosa.magphase).

    Parameters
    ----------
    D : complex [shape=(..., d, t)]
        Spectrogram.
    power : float
        Exponent of the magnitudes.

    Returns
    -------
    `abs(D) ** power`, and complex values whose product with `abs(D)` is `D`; 1 where `D` is 0

    Examples
    --------
    >>> corsmal_feat.magphase(np.array([[3 + 4j, 0]]))
    (array([[5., 0.]]), array([[0.6+0.8j, 1. +0.j ]]))
    """
    array = as_array("D", D)
    magnitude: Any = np.abs(array)
    zero = magnitude == 0
    divisor = magnitude + zero
    kind = np.complex128 if magnitude.dtype == np.float64 else np.complex64
    phase: Any = np.empty(array.shape, dtype=array.dtype if array.dtype.kind == "c" else kind)
    phase.real = array.real / divisor + zero
    phase.imag = array.imag / divisor
    return magnitude**power, phase
