"""Features (librosa.feature): re-exported from one private module per family."""

from ._mel import delta, melspectrogram, mfcc
from ._time_domain import rms, zero_crossing_rate

__all__ = [
    "delta",
    "melspectrogram",
    "mfcc",
    "rms",
    "zero_crossing_rate",
]
