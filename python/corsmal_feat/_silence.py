"""Trimming and splitting by silence, pre-emphasis (librosa.effects)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, overload

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, as_array, audio
from ._decibels import amplitude_to_db
from ._refusals import refuses
from ._time_domain import rms
from ._times import frames_to_samples
from .errors import ParameterError

Reference = float | Callable[..., Any]


def _with_sound(
    y: Any,
    top_db: float,
    ref: Reference,
    frame_length: int,
    hop_length: int,
    aggregate: Callable[..., Any],
) -> npt.NDArray[np.bool_]:
    """Which frames are louder than `top_db` below the reference, over all channels."""
    level = rms(y=y, frame_length=frame_length, hop_length=hop_length)
    db = amplitude_to_db(level[..., 0, :], ref=ref, top_db=None)
    if db.ndim > 1:
        others = tuple(range(db.ndim - 1))
        db = np.squeeze(np.apply_over_axes(aggregate, db, others), axis=others)
    loud: npt.NDArray[np.bool_] = db > -top_db
    return loud


@refuses
def trim(
    y: npt.ArrayLike,
    *,
    top_db: float = 60,
    ref: Reference = np.max,
    frame_length: int = 2048,
    hop_length: int = 512,
    aggregate: Callable[..., Any] = np.max,
) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Removes silence from both ends of a signal (librosa.effects.trim).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    top_db : float
        Frames more than this many dB below the reference are silent.
    ref : float or callable
        Level of 0 dB, or a function that computes it from the levels of the frames.
    frame_length, hop_length : int
        Samples per frame, and from one frame to the next.
    aggregate : callable
        Function that combines the levels of all channels.

    Returns
    -------
    the trimmed signal [shape=(..., m)], and its start and end in samples [shape=(2,)]

    Examples
    --------
    >>> y = np.concatenate([np.zeros(8192), np.ones(8192), np.zeros(8192)])
    >>> corsmal_feat.effects.trim(y)[1]
    array([ 7680, 17408])
    """
    signal = audio(y)
    loud = np.flatnonzero(_with_sound(signal, top_db, ref, frame_length, hop_length, aggregate))
    start, end = 0, 0
    if loud.size:
        start = int(loud[0]) * hop_length
        end = min(signal.shape[-1], (int(loud[-1]) + 1) * hop_length)
    return signal[..., start:end], np.asarray([start, end])


@refuses
def split(
    y: npt.ArrayLike,
    *,
    top_db: float = 60,
    ref: Reference = np.max,
    frame_length: int = 2048,
    hop_length: int = 512,
    aggregate: Callable[..., Any] = np.max,
) -> npt.NDArray[np.int64]:
    """Splits a signal into parts that are not silent (librosa.effects.split).

    Parameters
    ----------
    y, top_db, ref, frame_length, hop_length, aggregate
        See `trim`.

    Returns
    -------
    start and end of each part in samples, int64 [shape=(parts, 2)]

    Examples
    --------
    >>> y = np.concatenate([np.zeros(8192), np.ones(8192), np.zeros(8192)])
    >>> corsmal_feat.effects.split(y)
    array([[ 7680, 17408]])
    """
    signal = audio(y)
    loud = _with_sound(signal, top_db, ref, frame_length, hop_length, aggregate)
    # A part begins and ends where sound and silence meet, silence being beyond both ends.
    edges = np.flatnonzero(np.diff(loud.astype(np.int8), prepend=0, append=0))
    samples = frames_to_samples(edges, hop_length=hop_length)
    return np.minimum(samples, signal.shape[-1]).reshape((-1, 2))


@overload
def preemphasis(
    y: npt.ArrayLike,
    *,
    coef: float = 0.97,
    zi: npt.ArrayLike | None = None,
    return_zf: Literal[False] = False,
) -> Floats: ...
@overload
def preemphasis(
    y: npt.ArrayLike,
    *,
    coef: float = 0.97,
    zi: npt.ArrayLike | None = None,
    return_zf: Literal[True],
) -> tuple[Floats, Floats]: ...
@refuses
def preemphasis(
    y: npt.ArrayLike,
    *,
    coef: float = 0.97,
    zi: npt.ArrayLike | None = None,
    return_zf: bool = False,
) -> Floats | tuple[Floats, Floats]:
    """Pre-emphasis filter, `y[n] - coef * y[n - 1]` (librosa.effects.preemphasis).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal, at least 2 samples long.
    coef : float
        Coefficient of the filter.
    zi : [shape=(..., 1)], optional
        Value to add to the first sample: the state after the previous block. Without it, the
        signal is extended as a straight line.
    return_zf : bool
        Whether to return the state for the next block.

    Returns
    -------
    filtered signal in the shape of `y`, and the state [shape=(..., 1)] if requested

    Examples
    --------
    >>> corsmal_feat.effects.preemphasis(np.array([1.0, 1.0, 1.0]), coef=0.5)
    array([2. , 0.5, 0.5])
    """
    signal = audio(y)
    if signal.shape[-1] < (2 if zi is None else 1):
        raise ParameterError(f"y has {signal.shape[-1]} samples, expected at least 2 (1 with zi)")
    factor = signal.dtype.type(coef)
    state: Any = (
        2 * signal[..., :1] - signal[..., 1:2] if zi is None else np.atleast_1d(as_array("zi", zi))
    )
    state = np.asarray(state, dtype=signal.dtype)
    if state.shape != (*signal.shape[:-1], 1) and state.shape != (1,):
        raise ParameterError(f"zi has shape {state.shape}, expected {(*signal.shape[:-1], 1)}")
    delayed = -factor * signal
    result = signal.copy()
    result[..., :1] += state
    result[..., 1:] += delayed[..., :-1]
    return (result, delayed[..., -1:]) if return_zf else result
