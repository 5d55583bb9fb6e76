"""Acoustic features in librosa's vocabulary, computed in Rust; classifiers; the CORSMAL benchmark."""

from . import feature, filters
from ._core import ParameterError, __version__
from .spectrum import amplitude_to_db, power_to_db, stft

__all__ = [
    "ParameterError",
    "__version__",
    "amplitude_to_db",
    "feature",
    "filters",
    "power_to_db",
    "stft",
]
