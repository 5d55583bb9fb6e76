"""Onset strength and onset detection (librosa.onset)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, as_array, audio, floats, number, rows, size, unrows
from ._decibels import power_to_db
from ._mel import melspectrogram
from ._params import PeakParams
from ._refusals import refuses
from .errors import ParameterError
from .util import fix_frames


def _count(name: str, value: Any) -> int:
    if not isinstance(value, (int, np.integer)) or value < 1:
        raise ParameterError(f"{name} must be a whole number of at least 1, not {value}")
    return int(value)


def _double_melspectrogram(*, y: Any, **kwargs: Any) -> Any:
    """`melspectrogram` from a transform in double precision: differences of decibels amplify its
    rounding where a spectrum is mostly empty."""
    y = audio(y)
    return melspectrogram(y=y.astype(np.float64), **kwargs).astype(y.dtype)


@refuses
def onset_strength(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    lag: int = 1,
    max_size: int = 1,
    ref: npt.ArrayLike | None = None,
    detrend: bool = False,
    center: bool = True,
    feature: Callable[..., Any] | None = None,
    aggregate: Callable[..., Any] | bool | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    **kwargs: Any,
) -> Floats:
    """Onset strength: spectral flux of the mel spectrogram in dB, or of `S` in dB
    (librosa.onset.onset_strength).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal at the sample rate `sr` in Hz.
    S : [shape=(..., d, t)], optional
        Spectrogram in dB to use instead of `y`.
    lag, max_size : int
        Number of frames to look back, and number of bands of the maximum filter.
    ref : [shape of S], optional
        Spectrogram to compare with instead of the filtered `S`.
    detrend, center : bool
        Whether to remove the slow part, and whether to align frames with their centres.
    feature, aggregate : callable
        Functions to use instead of `melspectrogram` and the mean over bands.
    n_fft, hop_length : int
        See `stft`.
    **kwargs
        Arguments of `feature`.

    Returns
    -------
    [shape=(..., t)] in the precision of `y` or `S`

    Examples
    --------
    >>> corsmal_feat.onset.onset_strength(y=np.zeros(44100, np.float32), sr=44100).shape
    (87,)
    """
    if aggregate is False:
        raise ParameterError(
            "aggregate must be a function or None, not False; onset_strength_multi keeps every band"
        )
    lag, max_size = _count("lag", lag), _count("max_size", max_size)
    n_fft, hop_length = _count("n_fft", n_fft), _count("hop_length", hop_length)
    s, before = _compared((y, sr, S), ref, feature, (n_fft, hop_length), kwargs)
    delay = n_fft // (2 * hop_length) if center else None
    envelope: Any
    if callable(aggregate) and aggregate is not np.mean:
        rises: Any = unrows(_core.onset_rises(rows(s, 2), before, lag, max_size), s, 2)
        flux = np.asarray(aggregate(rises, axis=-2), dtype=s.dtype)
        envelope = _delayed(flux, lag, delay, s.shape[-1])
    else:
        envelope = unrows(_core.onset_strength(rows(s, 2), before, lag, max_size, delay), s, 2)
    if detrend:
        envelope = unrows(_core.detrend(rows(envelope, 1)), envelope, 1)
    strength: Floats = envelope
    return strength


@refuses
def onset_strength_multi(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    S: npt.ArrayLike | None = None,
    n_fft: int = 2048,
    hop_length: int = 512,
    lag: int = 1,
    max_size: int = 1,
    ref: npt.ArrayLike | None = None,
    detrend: bool = False,
    center: bool = True,
    feature: Callable[..., Any] | None = None,
    aggregate: Callable[..., Any] | bool | None = None,
    channels: Sequence[int] | Sequence[slice] | None = None,
    **kwargs: Any,
) -> Floats:
    """Onset strength of groups of bands or, with `aggregate=False`, of every band
    (librosa.onset.onset_strength_multi).

    Parameters
    ----------
    y, sr, S, n_fft, hop_length, lag, max_size, ref, detrend, center, feature, **kwargs
        See `onset_strength`.
    channels : list of int or of slice, optional
        Bands at which groups begin and end, or the groups themselves; by default, one group.
    aggregate : callable or False
        Function to use instead of the mean over the bands of a group; False keeps every band.

    Returns
    -------
    [shape=(..., groups, t)]

    Examples
    --------
    >>> y = np.zeros(44100, np.float32)
    >>> corsmal_feat.onset.onset_strength_multi(y=y, sr=44100, aggregate=False).shape
    (128, 87)
    """
    lag, max_size = _count("lag", lag), _count("max_size", max_size)
    n_fft, hop_length = _count("n_fft", n_fft), _count("hop_length", hop_length)
    s, before = _compared((y, sr, S), ref, feature, (n_fft, hop_length), kwargs)
    flux: Any = unrows(_core.onset_rises(rows(s, 2), before, lag, max_size), s, 2)
    if aggregate is not False:
        mean = aggregate if callable(aggregate) else np.mean
        groups = [mean(flux[..., group, :], axis=-2) for group in _groups(channels)]
        flux = np.stack(groups, axis=-2).astype(s.dtype)
    delay = n_fft // (2 * hop_length) if center else None
    envelope: Any = _delayed(flux, lag, delay, None)
    if detrend:
        envelope = unrows(_core.detrend(rows(envelope, 1)), envelope, 1)
    strength: Floats = envelope if delay is None else envelope[..., : s.shape[-1]]
    return strength


def _compared(
    source: tuple[Any, float, Any],
    ref: Any,
    feature: Callable[..., Any] | None,
    framing: tuple[int, int],
    keywords: dict[str, Any],
) -> tuple[Any, Any]:
    """The spectrogram in dB [shape=(..., d, t)], and the rows that it is compared with. `source` is
    (y, sr, S), `framing` (n_fft, hop_length)."""
    (y, sr, S), (n_fft, hop_length) = source, framing
    if S is None:
        if feature is None:
            feature = _double_melspectrogram
            keywords.setdefault("fmax", 0.5 * number("sr", sr))
        mel = feature(y=y, sr=sr, n_fft=n_fft, hop_length=hop_length, **keywords)
        S = power_to_db(np.abs(mel))
    s: Any = np.atleast_2d(floats("S", S))
    if ref is not None:
        ref = as_array("ref", ref)
        if ref.shape != s.shape:
            raise ParameterError(f"ref has shape {ref.shape}, expected {s.shape}")
        ref = rows(ref.astype(s.dtype), 2)
    return s, ref


def _delayed(flux: Any, lag: int, delay: int | None, length: int | None) -> Any:
    """`flux` after zeros for the frames without comparison, cut to `length` if centred."""
    padding = [(0, 0)] * (flux.ndim - 1) + [(lag + (delay or 0), 0)]
    padded = np.pad(flux, padding)
    return padded if delay is None else padded[..., :length]


def _groups(channels: Sequence[int] | Sequence[slice] | None) -> list[slice]:
    """Groups of bands."""
    if channels is None:
        return [slice(None)]
    if all(isinstance(channel, slice) for channel in channels):
        groups = [channel for channel in channels if isinstance(channel, slice)]
    else:
        edges = sorted({int(channel) for channel in channels if not isinstance(channel, slice)})
        groups = [slice(a, b) for a, b in pairwise(edges)]
    if not groups:
        raise ParameterError(f"channels must be two bands or more, or slices, not {channels!r}")
    return groups


@refuses
def onset_detect(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    onset_envelope: npt.ArrayLike | None = None,
    hop_length: int = 512,
    backtrack: bool = False,
    energy: npt.ArrayLike | None = None,
    units: str = "frames",
    normalize: bool = True,
    sparse: bool = True,
    pre_max: float | None = None,
    post_max: float | None = None,
    pre_avg: float | None = None,
    post_avg: float | None = None,
    delta: float | None = None,
    wait: float | None = None,
) -> npt.NDArray[Any]:
    """Onsets: peaks of the onset strength (librosa.onset.onset_detect).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz.
    onset_envelope : [shape=(..., t)], optional
        Onset strength to use instead of `y`.
    hop_length : int
        Samples between frames.
    backtrack : bool
        Whether to move each onset to the minimum of `energy` (by default, the envelope) before it.
    units : {"frames", "samples", "time"}
        Unit of the onsets.
    normalize : bool
        Whether to scale the envelope to 0..1 first.
    sparse : bool
        Whether to return the onsets; otherwise, a mask over all frames.
    pre_max, post_max, pre_avg, post_avg, delta, wait : float, optional
        Conditions for a peak, in frames, and `delta` in units of the envelope; by default, those of
        librosa for the sample rate and hop.

    Returns
    -------
    [shape=(n_onsets,)] or, with `sparse=False`, bool in the shape of the envelope

    Examples
    --------
    >>> envelope = np.zeros(60)
    >>> envelope[[10, 40]] = 1.0
    >>> corsmal_feat.onset.onset_detect(onset_envelope=envelope)
    array([10, 40])
    """
    if units not in ("frames", "samples", "time"):
        raise ParameterError(f"units must be 'frames', 'samples' or 'time', not {units!r}")
    hop_length = _count("hop_length", hop_length)
    if onset_envelope is None:
        if y is None:
            raise ParameterError("y or onset_envelope must be given")
        onset_envelope = onset_strength(y=y, sr=sr, hop_length=hop_length)
    envelope = floats("onset_envelope", onset_envelope)
    if envelope.shape[-1] == 0:
        raise ParameterError("onset_envelope has 0 frames, expected at least 1")
    if sparse and envelope.ndim != 1:
        raise ParameterError(
            f"onset_envelope has {envelope.ndim} dimensions, expected 1 with sparse=True"
        )
    if backtrack and not sparse:
        raise ParameterError("backtrack=True needs sparse=True")
    peaks = PeakParams(
        pre_max=_frames("pre_max", pre_max),
        post_max=_frames("post_max", post_max),
        pre_avg=_frames("pre_avg", pre_avg),
        post_avg=_frames("post_avg", post_avg),
        delta=None if delta is None else number("delta", delta),
        wait=_frames("wait", wait),
    )
    found: list[list[int]] = [[] for _ in range(envelope[..., 0].size)]
    if np.isfinite(envelope).all():
        found = _core.onset_detect(
            rows(envelope, 1), number("sr", sr), hop_length, bool(normalize), peaks
        )
    if not sparse:
        mask = np.zeros((len(found), envelope.shape[-1]), dtype=bool)
        for row, frames in zip(mask, found, strict=True):
            row[frames] = True
        return mask.reshape(envelope.shape)
    onsets = np.asarray(found[0], dtype=np.int64)
    if backtrack:
        onsets = onset_backtrack(onsets, envelope if energy is None else energy)
    if units == "frames":
        return onsets
    samples = onsets * hop_length
    return samples if units == "samples" else samples / sr


def _frames(name: str, value: float | None) -> int | None:
    if value is None:
        return None
    return size(name, np.ceil(value), 0)


@refuses
def onset_backtrack(events: npt.ArrayLike, energy: npt.ArrayLike) -> npt.NDArray[np.int64]:
    """The minimum of `energy` at or before each event (librosa.onset.onset_backtrack).

    Parameters
    ----------
    events : int [shape=(n,)]
        Frames.
    energy : [shape=(t,)]
        Energy or onset strength; with more dimensions, minima along the first axis.

    Returns
    -------
    frames, int64 [shape=(n,)]

    Examples
    --------
    >>> corsmal_feat.onset.onset_backtrack(np.array([3]), np.array([2.0, 0.0, 1.0, 5.0, 1.0]))
    array([1])
    """
    events = as_array("events", events)
    if events.dtype.kind not in "iu" and events.size:
        raise ParameterError(f"events has dtype {events.dtype}, expected integers")
    array: Any = np.ascontiguousarray(floats("energy", energy))
    if array.ndim != 1:
        # As librosa: minima along the first axis, numbered through the whole array.
        low = (array[1:-1] <= array[:-2]) & (array[1:-1] < array[2:])
        minima = fix_frames(1 + np.flatnonzero(low))
        return minima[np.searchsorted(minima, events, side="right") - 1]
    if events.ndim != 1:
        raise ParameterError(f"events has {events.ndim} dimensions, expected 1")
    if events.size and (events.min() < 0 or events.max() >= array.size):
        raise ParameterError(f"events must lie within the {array.size} frames of energy")
    return np.asarray(_core.onset_backtrack(events.tolist(), array), dtype=np.int64)
