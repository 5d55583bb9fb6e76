"""Makes `librosa_values.json`: what librosa 0.11 gives for features that look at neighbouring frames.

    pip install librosa==0.11.0
    python crates/extract/tests/golden/librosa_values.py > crates/extract/tests/golden/librosa_values.json

Inputs are made of integers, so that the Rust tests make the same ones.
"""

import json
from typing import Any

import librosa
import numpy as np

SR = 22050


def noise(n: int) -> np.ndarray:
    """`n` numbers within -1 and 1."""
    state, values = 7, []
    for _ in range(n):
        state = (state * 1_664_525 + 1_013_904_223) % 2**32
        values.append((state >> 8) / 2**23 - 1.0)
    return np.array(values, np.float32)


def signal() -> np.ndarray:
    """Noise whose level rises and falls in steps."""
    levels = np.repeat(np.array([0, 1, 8, 2, 64, 16, 4, 0], np.float32) / 128, 600)
    return noise(levels.size) * levels


def rounded(values: np.ndarray) -> Any:
    return [[float(f"{x:.8g}") for x in row] for row in np.asarray(values, np.float64)]


spectrogram = np.abs(noise(5 * 12)).reshape(5, 12)
arrays = [
    {},
    {"gain": 0.5, "bias": 10.0, "power": 0.25, "time_constant": 0.06},
    {"power": 0.0},
    {"bias": 0.0},
    {"b": 0.3, "eps": 1e-3},
    {"max_size": 3},
    {"max_size": 4},
]
bands = {"n_fft": 512, "hop_length": 256, "n_mels": 6}
features = [
    ("pcen", {}),
    ("pcen", {"gain": 0.8, "bias": 1.0, "power": 0.3, "time_constant": 0.1, "max_size": 2}),
    ("pcen", {"factor": 1.0, "spectrum_power": 2.0, "eps": 1e-9}),
    ("spectral_flux", {}),
    ("spectral_flux", {"lag": 3, "max_size": 3}),
]


def of_signal(kind: str, keys: dict[str, Any]) -> np.ndarray:
    if kind == "spectral_flux":
        return librosa.onset.onset_strength_multi(
            y=signal(), sr=SR, aggregate=False, **bands, **keys
        )
    keys = dict(keys)
    factor, power = keys.pop("factor", 2.0**31), keys.pop("spectrum_power", 1.0)
    mel = librosa.feature.melspectrogram(y=signal(), sr=SR, power=power, **bands)
    return librosa.pcen(mel * factor, sr=SR, hop_length=bands["hop_length"], **keys)


print(
    json.dumps(
        {
            "librosa": librosa.__version__,
            "pcen": [
                {"keys": keys, "values": rounded(librosa.pcen(spectrogram, sr=SR, hop_length=512, **keys))}
                for keys in arrays
            ],
            "features": [
                {"kind": kind, "keys": {**bands, **keys}, "values": rounded(of_signal(kind, keys))}
                for kind, keys in features
            ],
        }
    )
)
