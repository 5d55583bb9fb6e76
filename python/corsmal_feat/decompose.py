"""Decomposition of spectrograms (librosa.decompose)."""

from ._hpss import hpss

__all__ = ["hpss"]
