"""Harmonic and percussive parts, trimming, pre-emphasis (librosa.effects)."""

from ._hpss import effects_hpss as hpss
from ._hpss import harmonic, percussive
from ._silence import preemphasis, split, trim

__all__ = ["harmonic", "hpss", "percussive", "preemphasis", "split", "trim"]
