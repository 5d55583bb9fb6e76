"""Features of `extract` against librosa 0.11, channel by channel, on the real CCM recording.

Deviations are relative to the largest value of the array; docs/parity.md quotes what `-s` prints.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import corsmal_feat
import numpy as np
import pytest

librosa = pytest.importorskip("librosa", reason="skipped: librosa absent")
soundfile = pytest.importorskip("soundfile", reason="skipped: soundfile absent")

SHARED = Path(os.environ.get("CORSMAL_SHARED", Path(__file__).parents[3] / "shared"))
RECORDING = SHARED / "data" / "ccm" / "audio" / "s1_fi0_fu0_b1_l0_audio.wav"
if not RECORDING.is_file():
    pytest.skip(f"{RECORDING} is absent", allow_module_level=True)

SAMPLES, SR = soundfile.read(RECORDING, dtype="float32")
CHANNELS = np.ascontiguousarray(SAMPLES.T)


def each(function: Callable[..., Any], **parameters: Any) -> np.ndarray:
    """librosa's result of every channel by itself, so that `top_db` and tuning are of each."""
    return np.stack([function(y=y, **parameters) for y in CHANNELS])


def shape(name: str) -> Callable[[], np.ndarray]:
    function = getattr(librosa.feature, f"spectral_{name}")
    return lambda: each(function, **({} if name == "flatness" else {"sr": SR}))


def log_mel(y: np.ndarray) -> np.ndarray:
    return librosa.power_to_db(librosa.feature.melspectrogram(y=y, sr=SR))


FEATURES: dict[str, tuple[dict[str, Any], Callable[[], np.ndarray]]] = {
    "stft": ({}, lambda: np.abs(librosa.stft(CHANNELS, hop_length=512))),
    "melspectrogram": ({}, lambda: each(librosa.feature.melspectrogram, sr=SR)),
    "log-mel": (
        {"kind": "melspectrogram", "scale": "power_to_db"},
        lambda: each(log_mel),
    ),
    "log-mel-joint": (
        {"kind": "melspectrogram", "scale": "power_to_db", "joint": True},
        lambda: log_mel(CHANNELS),
    ),
    "mfcc": ({}, lambda: each(librosa.feature.mfcc, sr=SR)),
    "zero_crossing_rate": ({}, lambda: librosa.feature.zero_crossing_rate(CHANNELS)),
    "rms": ({}, lambda: librosa.feature.rms(y=CHANNELS)),
    "spectral_centroid": ({}, shape("centroid")),
    "spectral_bandwidth": ({}, shape("bandwidth")),
    "spectral_rolloff": ({}, shape("rolloff")),
    "spectral_flatness": ({}, shape("flatness")),
    "spectral_contrast": ({}, shape("contrast")),
    "poly_features": ({}, lambda: each(librosa.feature.poly_features, sr=SR)),
    "onset_strength": ({}, lambda: each(librosa.onset.onset_strength, sr=SR)[:, None]),
    "chroma_stft": ({}, lambda: each(librosa.feature.chroma_stft, sr=SR)),
    "chroma_cqt": ({}, lambda: each(librosa.feature.chroma_cqt, sr=SR)),
    "tonnetz": ({}, lambda: each(librosa.feature.tonnetz, sr=SR)),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", FEATURES)
def test_feature_of_every_channel(name: str) -> None:
    parameters, expected = FEATURES[name]
    config = {"features": {name: parameters}}
    features = corsmal_feat.extract(RECORDING, config=config)
    (values,) = features.arrays.values()
    want = expected()
    assert values.shape == want.shape
    largest = np.abs(want).max()
    deviation = np.abs(values - want).max() / largest
    print(f"{name}: {deviation:.1e} of {largest:.3g}")
    assert deviation <= 5e-6
