"""Onset strength and onset detection (librosa.onset)."""

from ._onset import onset_backtrack, onset_detect, onset_strength, onset_strength_multi

__all__ = ["onset_backtrack", "onset_detect", "onset_strength", "onset_strength_multi"]
