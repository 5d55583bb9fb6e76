"""Acoustic features in librosa's vocabulary, computed in Rust; classifiers; the CORSMAL benchmark."""

from . import corsmal, decompose, effects, feature, filters, onset
from ._core import ParameterError, __version__
from ._harmonic import cqt, istft
from ._mono import to_mono
from ._pitch import estimate_tuning, piptrack, pitch_tuning
from ._resample import resample
from .spectrum import amplitude_to_db, power_to_db, stft

__all__ = [
    "ParameterError",
    "__version__",
    "amplitude_to_db",
    "corsmal",
    "cqt",
    "decompose",
    "effects",
    "estimate_tuning",
    "feature",
    "filters",
    "istft",
    "onset",
    "piptrack",
    "pitch_tuning",
    "power_to_db",
    "resample",
    "stft",
    "to_mono",
]
