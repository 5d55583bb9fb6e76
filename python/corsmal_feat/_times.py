"""Frames, samples, blocks and seconds (librosa.core.convert)."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
import numpy.typing as npt

from ._arrays import number, size
from ._refusals import refuses
from .errors import ParameterError

Number = int | float | np.integer[Any] | np.floating[Any]
Integers = npt.NDArray[np.int64]
Doubles = npt.NDArray[np.float64]


def _offset(n_fft: int | None) -> int:
    return 0 if n_fft is None else size("n_fft", n_fft, 0) // 2


def _hop(hop_length: int) -> int:
    return size("hop_length", hop_length)


def _rate(sr: float) -> float:
    if not number("sr", sr) > 0:
        raise ParameterError(f"sr must be a positive sample rate in Hz, not {sr}")
    return float(sr)


@overload
def frames_to_samples(
    frames: Number, *, hop_length: int = 512, n_fft: int | None = None
) -> np.int64: ...
@overload
def frames_to_samples(
    frames: npt.ArrayLike, *, hop_length: int = 512, n_fft: int | None = None
) -> Integers: ...
@refuses
def frames_to_samples(
    frames: npt.ArrayLike, *, hop_length: int = 512, n_fft: int | None = None
) -> Any:
    """First sample of each frame (librosa.frames_to_samples).

    Parameters
    ----------
    frames : number or [shape=(n,)]
        Frame numbers.
    hop_length : int
        Samples between frames.
    n_fft : int, optional
        Length of the transform if frames are not centred; half of it is added.

    Returns
    -------
    int64, in the shape of `frames`

    Examples
    --------
    >>> corsmal_feat.frames_to_samples([0, 1, 10])
    array([   0,  512, 5120])
    """
    return (np.asanyarray(frames) * _hop(hop_length) + _offset(n_fft)).astype(np.int64)


@overload
def samples_to_frames(
    samples: Number, *, hop_length: int = 512, n_fft: int | None = None
) -> np.int64: ...
@overload
def samples_to_frames(
    samples: npt.ArrayLike, *, hop_length: int = 512, n_fft: int | None = None
) -> Integers: ...
@refuses
def samples_to_frames(
    samples: npt.ArrayLike, *, hop_length: int = 512, n_fft: int | None = None
) -> Any:
    """Frame of each sample (librosa.samples_to_frames).

    Parameters
    ----------
    samples : number or [shape=(n,)]
        Sample numbers.
    hop_length, n_fft
        See `frames_to_samples`.

    Returns
    -------
    int64, in the shape of `samples`

    Examples
    --------
    >>> corsmal_feat.samples_to_frames([0, 511, 512, 22050])
    array([ 0,  0,  1, 43])
    """
    shifted = np.asanyarray(samples) - _offset(n_fft)
    return np.floor(shifted // _hop(hop_length)).astype(np.int64)


@overload
def samples_to_time(samples: Number, *, sr: float = 22050) -> np.float64: ...
@overload
def samples_to_time(samples: npt.ArrayLike, *, sr: float = 22050) -> Doubles: ...
@refuses
def samples_to_time(samples: npt.ArrayLike, *, sr: float = 22050) -> Any:
    """Time of each sample (librosa.samples_to_time).

    Parameters
    ----------
    samples : number or [shape=(n,)]
        Sample numbers.
    sr : float
        Sample rate in Hz.

    Returns
    -------
    seconds, float64, in the shape of `samples`

    Examples
    --------
    >>> corsmal_feat.samples_to_time([0, 11025, 22050])
    array([0. , 0.5, 1. ])
    """
    return np.asanyarray(samples) / _rate(sr)


@overload
def time_to_samples(times: Number, *, sr: float = 22050) -> np.int64: ...
@overload
def time_to_samples(times: npt.ArrayLike, *, sr: float = 22050) -> Integers: ...
@refuses
def time_to_samples(times: npt.ArrayLike, *, sr: float = 22050) -> Any:
    """Sample at each time (librosa.time_to_samples).

    Parameters
    ----------
    times : number or [shape=(n,)]
        Seconds.
    sr : float
        Sample rate in Hz.

    Returns
    -------
    int64, in the shape of `times`

    Examples
    --------
    >>> corsmal_feat.time_to_samples([0.0, 0.5], sr=44100)
    array([    0, 22050])
    """
    return (np.asanyarray(times) * sr).astype(np.int64)


@overload
def frames_to_time(
    frames: Number, *, sr: float = 22050, hop_length: int = 512, n_fft: int | None = None
) -> np.float64: ...
@overload
def frames_to_time(
    frames: npt.ArrayLike, *, sr: float = 22050, hop_length: int = 512, n_fft: int | None = None
) -> Doubles: ...
@refuses
def frames_to_time(
    frames: npt.ArrayLike, *, sr: float = 22050, hop_length: int = 512, n_fft: int | None = None
) -> Any:
    """Time of each frame (librosa.frames_to_time).

    Parameters
    ----------
    frames : number or [shape=(n,)]
        Frame numbers.
    sr : float
        Sample rate in Hz.
    hop_length, n_fft
        See `frames_to_samples`.

    Returns
    -------
    seconds, float64, in the shape of `frames`

    Examples
    --------
    >>> corsmal_feat.frames_to_time([0, 43], sr=22050).round(4)
    array([0.    , 0.9985])
    """
    samples = frames_to_samples(frames, hop_length=hop_length, n_fft=n_fft)
    return samples_to_time(samples, sr=sr)


@overload
def time_to_frames(
    times: Number, *, sr: float = 22050, hop_length: int = 512, n_fft: int | None = None
) -> np.int64: ...
@overload
def time_to_frames(
    times: npt.ArrayLike, *, sr: float = 22050, hop_length: int = 512, n_fft: int | None = None
) -> Integers: ...
@refuses
def time_to_frames(
    times: npt.ArrayLike, *, sr: float = 22050, hop_length: int = 512, n_fft: int | None = None
) -> Any:
    """Frame at each time (librosa.time_to_frames).

    Parameters
    ----------
    times : number or [shape=(n,)]
        Seconds.
    sr, hop_length, n_fft
        See `frames_to_time`.

    Returns
    -------
    int64, in the shape of `times`

    Examples
    --------
    >>> corsmal_feat.time_to_frames([0.0, 1.0])
    array([ 0, 43])
    """
    samples = time_to_samples(times, sr=sr)
    return samples_to_frames(samples, hop_length=hop_length, n_fft=n_fft)


@overload
def blocks_to_frames(blocks: Number, *, block_length: int) -> np.int64: ...
@overload
def blocks_to_frames(blocks: npt.ArrayLike, *, block_length: int) -> Integers: ...
@refuses
def blocks_to_frames(blocks: npt.ArrayLike, *, block_length: int) -> Any:
    """First frame of each block of `stream` (librosa.blocks_to_frames).

    Parameters
    ----------
    blocks : number or [shape=(n,)]
        Block numbers.
    block_length : int
        Frames per block.

    Returns
    -------
    in the shape of `blocks`

    Examples
    --------
    >>> corsmal_feat.blocks_to_frames([0, 1, 2], block_length=16)
    array([ 0, 16, 32])
    """
    return block_length * np.asanyarray(blocks)


@overload
def blocks_to_samples(blocks: Number, *, block_length: int, hop_length: int) -> np.int64: ...
@overload
def blocks_to_samples(blocks: npt.ArrayLike, *, block_length: int, hop_length: int) -> Integers: ...
@refuses
def blocks_to_samples(blocks: npt.ArrayLike, *, block_length: int, hop_length: int) -> Any:
    """First sample of each block of `stream` (librosa.blocks_to_samples).

    Parameters
    ----------
    blocks : number or [shape=(n,)]
        Block numbers.
    block_length, hop_length : int
        Frames per block, and samples between frames.

    Returns
    -------
    int64, in the shape of `blocks`

    Examples
    --------
    >>> corsmal_feat.blocks_to_samples([0, 1], block_length=16, hop_length=512)
    array([   0, 8192])
    """
    frames = blocks_to_frames(blocks, block_length=block_length)
    return frames_to_samples(frames, hop_length=hop_length)


@overload
def blocks_to_time(
    blocks: Number, *, block_length: int, hop_length: int, sr: float
) -> np.float64: ...
@overload
def blocks_to_time(
    blocks: npt.ArrayLike, *, block_length: int, hop_length: int, sr: float
) -> Doubles: ...
@refuses
def blocks_to_time(blocks: npt.ArrayLike, *, block_length: int, hop_length: int, sr: float) -> Any:
    """Start time of each block of `stream` (librosa.blocks_to_time).

    Parameters
    ----------
    blocks : number or [shape=(n,)]
        Block numbers.
    block_length, hop_length : int
        Frames per block, and samples between frames.
    sr : float
        Sample rate in Hz.

    Returns
    -------
    seconds, float64, in the shape of `blocks`

    Examples
    --------
    >>> corsmal_feat.blocks_to_time([0, 1], block_length=10, hop_length=441, sr=44100)
    array([0. , 0.1])
    """
    samples = blocks_to_samples(blocks, block_length=block_length, hop_length=hop_length)
    return samples_to_time(samples, sr=sr)


@refuses
def samples_like(
    X: npt.NDArray[Any] | int,
    *,
    hop_length: int = 512,
    n_fft: int | None = None,
    axis: int = -1,
) -> Integers:
    """First sample of each frame of a feature array (librosa.samples_like).

    Parameters
    ----------
    X : array, or int
        Feature array, or its number of frames.
    hop_length, n_fft
        See `frames_to_samples`.
    axis : int
        Axis of the frames.

    Returns
    -------
    int64 [shape=(t,)]

    Examples
    --------
    >>> corsmal_feat.samples_like(np.zeros((128, 3)))
    array([   0,  512, 1024])
    """
    count = int(np.ceil(X)) if np.ndim(X) == 0 else np.shape(X)[axis]
    return frames_to_samples(np.arange(count), hop_length=hop_length, n_fft=n_fft)


@refuses
def times_like(
    X: npt.NDArray[Any] | int,
    *,
    sr: float = 22050,
    hop_length: int = 512,
    n_fft: int | None = None,
    axis: int = -1,
) -> Doubles:
    """Time of each frame of a feature array (librosa.times_like).

    Parameters
    ----------
    X, hop_length, n_fft, axis
        See `samples_like`.
    sr : float
        Sample rate in Hz.

    Returns
    -------
    seconds, float64 [shape=(t,)]

    Examples
    --------
    >>> corsmal_feat.times_like(np.zeros((128, 3)), sr=51200)
    array([0.  , 0.01, 0.02])
    """
    samples = samples_like(X, hop_length=hop_length, n_fft=n_fft, axis=axis)
    return samples_to_time(samples, sr=sr)
