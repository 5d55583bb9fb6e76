"""Parameters as the Rust side takes them: one named tuple for each group."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

#: a window by name (parameters after a colon), or as values
WindowSpec = str | npt.NDArray[np.float64]


class StftParams(NamedTuple):
    """A short-time Fourier transform, all resolved."""

    n_fft: int
    hop_length: int
    win_length: int
    window: WindowSpec
    center: bool
    pad_mode: str


class FrameParams(NamedTuple):
    """How a waveform is cut into frames."""

    frame_length: int
    hop_length: int
    center: bool


class MelParams(NamedTuple):
    """A mel filter bank; `norm` is "slaney", "none" or a number in words."""

    sr: float
    n_fft: int
    n_mels: int
    fmin: float
    fmax: float | None
    htk: bool
    norm: str


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


class PitchParams(NamedTuple):
    """A pitch tracker."""

    sr: float
    n_fft: int
    fmin: float
    fmax: float
    threshold: float


class PeakParams(NamedTuple):
    """Conditions of an onset; None is librosa's default for the sample rate and hop."""

    pre_max: int | None
    post_max: int | None
    pre_avg: int | None
    post_avg: int | None
    delta: float | None
    wait: int | None


class HpssParams(NamedTuple):
    """Harmonic-percussive separation."""

    kernel_harmonic: int
    kernel_percussive: int
    power: float
    margin_harmonic: float
    margin_percussive: float


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


class CqtChromaParams(NamedTuple):
    """How constant-Q bins are folded into pitch classes."""

    bins_per_octave: int
    n_chroma: int
    fmin: float
    window: list[float] | None
    threshold: float | None
    norm: float | None


class PaaFrames(NamedTuple):
    """Windows and steps of pyAudioAnalysis, in samples."""

    window: int
    step: int
    mid_window: int
    mid_step: int


class PcenParams(NamedTuple):
    """Per-channel energy normalisation; `b` is instead of the time constant."""

    sr: float
    hop_length: int
    gain: float
    bias: float
    power: float
    time_constant: float
    eps: float
    b: float | None
    max_size: int
