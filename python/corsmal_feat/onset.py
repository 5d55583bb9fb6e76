"""Onset strength and onset detection (librosa.onset)."""

from typing import TYPE_CHECKING, Any

from ._absent import absent as _absent
from ._onset import onset_backtrack, onset_detect, onset_strength, onset_strength_multi

__all__ = ["onset_backtrack", "onset_detect", "onset_strength", "onset_strength_multi"]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        raise _absent(__name__, name)
