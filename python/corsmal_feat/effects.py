"""Harmonic-percussive separation of signals (librosa.effects)."""

from ._harmonic import effects_hpss as hpss
from ._harmonic import harmonic, percussive

__all__ = ["harmonic", "hpss", "percussive"]
