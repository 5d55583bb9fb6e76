"""Features of the waveform (librosa.feature)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import (
    Doubles,
    Floats,
    audio,
    channels,
    floats,
    number,
    precision,
    room,
    rows,
    size,
    unrows,
)
from ._params import FrameParams
from ._refusals import refuses
from .errors import ParameterError
from .util import frame as frames_of


@refuses
def zero_crossing_rate(
    y: npt.ArrayLike,
    *,
    frame_length: int = 2048,
    hop_length: int = 512,
    center: bool = True,
    threshold: float = 1e-10,
    ref_magnitude: float | Callable[..., Any] | None = None,
    pad: bool = False,
    zero_pos: bool = True,
) -> Doubles:
    """Share of the samples in a frame at which the sign changes
    (librosa.feature.zero_crossing_rate).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    frame_length, hop_length : int
        Samples per frame, and from one frame to the next.
    center : bool
        Whether to centre frames, with the first and last samples repeated.
    threshold : float
        Values of at most this magnitude count as zero.
    ref_magnitude : float or callable, optional
        Value that `threshold` is multiplied by, or a function that computes it from the magnitudes,
        such as `numpy.max`.
    pad : bool
        Whether the first sample of a frame counts as a crossing.
    zero_pos : bool
        Whether zero counts as positive; otherwise, it has its own sign.

    Returns
    -------
    float64 [shape=(..., 1, t)]

    Examples
    --------
    >>> y = np.tile(np.float32([1, -1]), 4096)
    >>> corsmal_feat.feature.zero_crossing_rate(y)[0, 4].round(4)
    np.float64(0.9995)
    """
    y = audio(y)
    frame = framing(frame_length, hop_length, center)
    if callable(ref_magnitude):
        # As librosa: of the frames, in which samples come as often as frames have them.
        ends = [(0, 0)] * (y.ndim - 1) + [(frame_length // 2,) * 2 if center else (0, 0)]
        framed = frames_of(
            np.pad(y, ends, mode="edge"), frame_length=frame_length, hop_length=hop_length
        )
        threshold = threshold * float(ref_magnitude(abs(framed)))
    elif ref_magnitude is not None:
        threshold = threshold * number("ref_magnitude", ref_magnitude)
    rate = _core.zero_crossing_rate(
        channels(y), frame, number("threshold", threshold), bool(zero_pos), bool(pad)
    )
    return unrows(rate, y, 1)


@refuses
def rms(
    *,
    y: npt.ArrayLike | None = None,
    S: npt.ArrayLike | None = None,
    frame_length: int = 2048,
    hop_length: int = 512,
    center: bool = True,
    pad_mode: str = "constant",
    dtype: npt.DTypeLike = np.float32,
) -> Floats:
    """Root-mean-square level of each frame (librosa.feature.rms).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal.
    S : [shape=(..., 1 + frame_length // 2, t)], optional
        Magnitude spectrogram, used only without `y`.
    frame_length, hop_length : int
        Samples per frame, and from one frame to the next.
    center, pad_mode
        See `stft`.
    dtype : float32 or float64
        Type of the result, which is computed as float32.

    Returns
    -------
    [shape=(..., 1, t)]

    Examples
    --------
    >>> corsmal_feat.feature.rms(y=np.full(4096, 0.5, np.float32))[0, 4]
    np.float32(0.5)
    """
    kind = precision(dtype)
    if y is None and S is None:
        raise ParameterError("y or S must be given")
    if y is None:
        s = floats("S", S, 2)
        level = unrows(_core.rms_of_spectrogram(rows(s, 2), int(frame_length)), s, 2)
        return level.astype(kind, copy=False)
    y = audio(y)
    frame = framing(frame_length, hop_length, center)
    level = unrows(_core.rms(channels(y), frame, str(pad_mode)), y, 1)
    return level.astype(kind, copy=False)


def framing(frame_length: int, hop_length: int, center: bool) -> FrameParams:
    """Framing in the form that the Rust side takes."""
    length, hop = size("frame_length", frame_length), size("hop_length", hop_length)
    room("a frame", length)
    return FrameParams(length, hop, bool(center))
