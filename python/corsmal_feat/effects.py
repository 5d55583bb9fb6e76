"""Harmonic and percussive parts, silence, pre-emphasis (librosa.effects)."""

from ._harmonic import effects_hpss as hpss
from ._harmonic import harmonic, percussive
from ._silence import preemphasis, split, trim

__all__ = ["harmonic", "hpss", "percussive", "preemphasis", "split", "trim"]
