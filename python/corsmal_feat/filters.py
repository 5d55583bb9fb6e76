"""Filter banks and windows (librosa.filters)."""

from typing import TYPE_CHECKING, Any

from ._absent import absent as _absent
from ._filters import chroma, get_window, mel

__all__ = ["chroma", "get_window", "mel"]

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        raise _absent(__name__, name)
