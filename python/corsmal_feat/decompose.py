"""Decomposition of spectrograms (librosa.decompose)."""

from ._harmonic import hpss

__all__ = ["hpss"]
