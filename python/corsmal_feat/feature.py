"""Features (librosa.feature): re-exported from one private module per family."""

from typing import TYPE_CHECKING, Any

from ._absent import absent as _absent
from ._cens import chroma_cens
from ._chroma import chroma_stft
from ._chroma_cqt import chroma_cqt
from ._mel import delta, melspectrogram, mfcc
from ._memory import stack_memory
from ._spectral import (
    poly_features,
    spectral_bandwidth,
    spectral_centroid,
    spectral_contrast,
    spectral_flatness,
    spectral_rolloff,
)
from ._time_domain import rms, zero_crossing_rate
from ._tonnetz import tonnetz

__all__ = [
    "chroma_cens",
    "chroma_cqt",
    "chroma_stft",
    "delta",
    "melspectrogram",
    "mfcc",
    "poly_features",
    "rms",
    "spectral_bandwidth",
    "spectral_centroid",
    "spectral_contrast",
    "spectral_flatness",
    "spectral_rolloff",
    "stack_memory",
    "tonnetz",
    "zero_crossing_rate",
]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        raise _absent(__name__, name)
