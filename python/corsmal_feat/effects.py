"""Harmonic and percussive parts, trimming, pre-emphasis (librosa.effects)."""

from typing import TYPE_CHECKING, Any

from ._absent import absent as _absent
from ._hpss import effects_hpss as hpss
from ._hpss import harmonic, percussive
from ._silence import preemphasis, split, trim

__all__ = ["harmonic", "hpss", "percussive", "preemphasis", "split", "trim"]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        raise _absent(__name__, name)
