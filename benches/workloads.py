"""What the benchmarks of whole commands extract."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence


@dataclasses.dataclass(frozen=True)
class Workload:
    """What to extract, by which peer, and how close the values must be."""

    title: str
    arguments: Sequence[str]
    peer: str
    task: str
    #: largest difference allowed, absolute and relative
    tolerance: tuple[float, float]
    features: Sequence[str] = ()


MFCC_ZCR = """
[features.mfcc]
joint = true
[features.zero_crossing_rate]
"""
WORKLOADS = {
    "W1": Workload(
        "log-mel, 8 channels",
        ["--preset", "logmel", "--set", "melspectrogram.joint=true"],
        *("librosa", "logmel", (2e-3, 0.0)),
    ),
    "W2": Workload(
        "20 MFCC and ZCR, 8 channels",
        ["--config", "{work}/mfcc-zcr.toml"],
        *("librosa", "mfcc-zcr", (2e-3, 1e-5)),
        features=["mfcc", "zero_crossing_rate"],
    ),
    "W3": Workload(
        "`esc26` vector, mean of 8 channels",
        ["--preset", "esc26"],
        *("librosa", "esc26", (1e-4, 1e-5)),
    ),
    "W4": Workload(
        "AF193 vector, channel 0",
        ["--preset", "af193"],
        *("librosa", "af193", (1e-4, 1e-3)),
    ),
    "W5": Workload(
        "136-number vector, mean of 8 channels",
        ["--preset", "a34f136", "--set", "signal.channels=mean", "--set", "a34f136.peak=centred"],
        *("pyAudioAnalysis", "a34f136", (1e-6, 1e-5)),
    ),
}
