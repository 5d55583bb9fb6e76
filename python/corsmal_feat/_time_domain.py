"""Features of the waveform (librosa.feature)."""

from __future__ import annotations

from typing import Any

from . import _core
from ._arrays import audio, floats, rows, unrows
from ._core import ParameterError


def zero_crossing_rate(
    y: Any,
    *,
    frame_length: int = 2048,
    hop_length: int = 512,
    center: bool = True,
    threshold: float = 1e-10,
    ref_magnitude: Any = None,
    pad: bool = False,
    zero_pos: bool = True,
) -> Any:
    """Share of samples per frame where the sign changes [shape=(..., 1, t)]
    (librosa.feature.zero_crossing_rate)."""
    y = audio(y)
    frame = framing(frame_length, hop_length, center)
    if callable(ref_magnitude):
        threshold = threshold * float(ref_magnitude(abs(y)))
    elif ref_magnitude is not None:
        threshold = threshold * float(ref_magnitude)
    crossings = (float(threshold), bool(zero_pos), bool(pad))
    return unrows(_core.zero_crossing_rate(rows(y, 1), frame, crossings), y, 1)


def rms(
    *,
    y: Any = None,
    S: Any = None,
    frame_length: int = 2048,
    hop_length: int = 512,
    center: bool = True,
    pad_mode: str = "constant",
) -> Any:
    """Root-mean-square level per frame [shape=(..., 1, t)], float32 (librosa.feature.rms)."""
    if S is not None:
        s = floats("S", S, 2)
        return unrows(_core.rms_of_spectrogram(rows(s, 2), int(frame_length)), s, 2)
    if y is None:
        raise ParameterError("y or S must be given")
    y = audio(y)
    frame = framing(frame_length, hop_length, center)
    return unrows(_core.rms(rows(y, 1), frame, str(pad_mode)), y, 1)


def framing(frame_length: int, hop_length: int, center: bool) -> tuple[int, int, bool]:
    """Framing as the Rust side takes it."""
    if frame_length < 1 or hop_length < 1:
        raise ParameterError(
            f"frame_length = {frame_length}, hop_length = {hop_length} are not possible: at least 1"
        )
    return int(frame_length), int(hop_length), bool(center)
