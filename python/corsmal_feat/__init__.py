"""Acoustic features in librosa's vocabulary, computed in Rust; classifiers; the CORSMAL benchmark."""

from . import corsmal, feature, filters
from ._core import ParameterError, __version__
from ._resample import resample
from .spectrum import amplitude_to_db, power_to_db, stft

__all__ = [
    "ParameterError",
    "__version__",
    "amplitude_to_db",
    "corsmal",
    "feature",
    "filters",
    "power_to_db",
    "resample",
    "stft",
]
