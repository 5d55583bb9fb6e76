"""Decomposition of spectrograms (librosa.decompose)."""

from typing import TYPE_CHECKING, Any

from ._absent import absent as _absent
from ._hpss import hpss

__all__ = ["hpss"]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        raise _absent(__name__, name)
