"""Parameters in the form that the Rust side takes: one named tuple for each group."""

from __future__ import annotations

from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
import numpy.typing as npt

from .errors import ParameterError

#: a window by name (parameters after a colon), or as values
WindowSpec = str | npt.NDArray[np.float64]


_Params = TypeVar("_Params", bound=type)
_WHOLE = (int, np.integer)
_NUMBER = (int, float, np.integer, np.floating)


def _checked(kind: _Params) -> _Params:
    """Refuses values of another type by name; the Rust side would only raise a `TypeError`."""
    make = kind.__new__
    wanted = {}
    for name, hint in get_type_hints(kind).items():
        kinds = set(get_args(hint) or (hint,)) - {type(None)}
        if kinds in ({int}, {float}):
            wanted[name] = (_WHOLE if int in kinds else _NUMBER, type(None) in get_args(hint))

    def new(cls: Any, *args: Any, **kwargs: Any) -> Any:
        made = make(cls, *args, **kwargs)
        for name, (types, optional) in wanted.items():
            value = getattr(made, name)
            if value is None and optional:
                continue
            if isinstance(value, bool | np.bool_) or not isinstance(value, types):
                what = "a whole number" if types is _WHOLE else "a number"
                raise ParameterError(f"{name} must be {what}, not {value!r}")
        return made

    kind.__new__ = new  # type: ignore[assignment]
    return kind


@_checked
class StftParams(NamedTuple):
    """A short-time Fourier transform, with all defaults filled in."""

    n_fft: int
    hop_length: int
    win_length: int
    window: WindowSpec
    center: bool
    pad_mode: str


@_checked
class FrameParams(NamedTuple):
    """How a waveform is cut into frames."""

    frame_length: int
    hop_length: int
    center: bool


@_checked
class MelParams(NamedTuple):
    """A mel filter bank; `norm` is "slaney", "none" or a number as text."""

    sr: float
    n_fft: int
    n_mels: int
    fmin: float
    fmax: float | None
    htk: bool
    norm: str


@_checked
class ChromaParams(NamedTuple):
    """A chroma filter bank; `norm` is librosa's number."""

    sr: float
    n_fft: int
    n_chroma: int
    tuning: float
    ctroct: float
    octwidth: float | None
    norm: float | None
    base_c: bool


@_checked
class PitchParams(NamedTuple):
    """A pitch tracker."""

    sr: float
    n_fft: int
    fmin: float
    fmax: float
    threshold: float


@_checked
class PeakParams(NamedTuple):
    """Conditions for an onset; None is librosa's default for the sample rate and hop."""

    pre_max: int | None
    post_max: int | None
    pre_avg: int | None
    post_avg: int | None
    delta: float | None
    wait: int | None


@_checked
class HpssParams(NamedTuple):
    """Harmonic-percussive separation."""

    kernel_harmonic: int
    kernel_percussive: int
    power: float
    margin_harmonic: float
    margin_percussive: float


@_checked
class CqtParams(NamedTuple):
    """A constant-Q transform."""

    sr: float
    hop_length: int
    fmin: float
    n_bins: int
    bins_per_octave: int
    tuning: float
    filter_scale: float
    norm: float | None
    sparsity: float
    window: WindowSpec
    scale: bool
    pad_mode: str


@_checked
class CqtChromaParams(NamedTuple):
    """How constant-Q bins are folded into pitch classes."""

    bins_per_octave: int
    n_chroma: int
    fmin: float
    window: list[float] | None
    threshold: float | None
    norm: float | None


@_checked
class PaaFrames(NamedTuple):
    """Windows and steps of pyAudioAnalysis, in samples."""

    window: int
    step: int
    mid_window: int
    mid_step: int


@_checked
class PcenParams(NamedTuple):
    """Per-channel energy normalisation; `b` replaces the time constant."""

    sr: float
    hop_length: int
    gain: float
    bias: float
    power: float
    time_constant: float
    eps: float
    b: float | None
    max_size: int
