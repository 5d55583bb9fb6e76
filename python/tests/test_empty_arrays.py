"""Signals without samples and matrices without frames: what librosa makes of them, or a refusal of
this package."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import corsmal_feat
import librosa
import numpy as np
import pytest

SIGNAL = np.zeros((2, 0), np.float32)


def frames(rows: int, dtype: Any = np.float64) -> np.ndarray[Any, Any]:
    return np.zeros((rows, 0), dtype)


CALLS: dict[str, Callable[[Any], Any]] = {
    "to_mono": lambda m: m.to_mono(SIGNAL),
    "resample": lambda m: m.resample(SIGNAL, orig_sr=44100, target_sr=22050),
    "stft": lambda m: m.stft(SIGNAL),
    "istft": lambda m: m.istft(frames(1025, np.complex64)),
    "istft of no channels": lambda m: m.istft(np.zeros((0, 1025, 4), np.complex64)),
    "magphase": lambda m: m.magphase(frames(3, np.complex64)),
    "power_to_db": lambda m: m.power_to_db(frames(3)),
    "pcen": lambda m: m.pcen(frames(12)),
    "piptrack": lambda m: m.piptrack(S=frames(1025)),
    "yin": lambda m: m.yin(SIGNAL[0], fmin=60, fmax=400),
    "A_weighting": lambda m: m.A_weighting(np.zeros(0)),
    "perceptual_weighting": lambda m: m.perceptual_weighting(frames(12), np.arange(1.0, 13.0)),
    "zero_crossing_rate": lambda m: m.feature.zero_crossing_rate(SIGNAL),
    "rms": lambda m: m.feature.rms(y=SIGNAL),
    "melspectrogram": lambda m: m.feature.melspectrogram(S=frames(1025)),
    "mfcc": lambda m: m.feature.mfcc(S=frames(128)),
    "delta": lambda m: m.feature.delta(frames(3)),
    "stack_memory": lambda m: m.feature.stack_memory(frames(3)),
    "chroma_stft": lambda m: m.feature.chroma_stft(S=frames(1025)),
    "tonnetz": lambda m: m.feature.tonnetz(chroma=frames(12)),
    "spectral_centroid": lambda m: m.feature.spectral_centroid(S=frames(1025)),
    "spectral_contrast": lambda m: m.feature.spectral_contrast(S=frames(1025)),
    "hpss": lambda m: m.decompose.hpss(frames(1025)),
    "onset_strength": lambda m: m.onset.onset_strength(S=frames(128)),
    "preemphasis": lambda m: m.effects.preemphasis(SIGNAL),
    "trim": lambda m: m.effects.trim(SIGNAL),
    "split": lambda m: m.effects.split(SIGNAL),
    "normalize": lambda m: m.util.normalize(SIGNAL),
    "fix_length": lambda m: m.util.fix_length(SIGNAL, size=3),
    "frame": lambda m: m.util.frame(SIGNAL, frame_length=2, hop_length=1),
}


def test_complex_windows_are_refused() -> None:
    with pytest.raises(corsmal_feat.ParameterError, match="must be real"):
        corsmal_feat.stft(np.ones(2048), n_fft=512, window=np.ones(512) * 1j)


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.filterwarnings("ignore")
def test_nothing_in(name: str) -> None:
    try:
        ours = CALLS[name](corsmal_feat)
    except corsmal_feat.CorsmalFeatError:
        return
    try:
        theirs = CALLS[name](librosa)
    except Exception:
        return  # librosa stops in numpy's words
    pairs = (x if isinstance(x, tuple) else (x,) for x in (ours, theirs))
    for a, b in zip(*pairs, strict=True):
        assert a.shape == b.shape and np.array_equal(a, b)
