"""Filter banks and windows (librosa.filters)."""

from ._filters import chroma, get_window, mel

__all__ = ["chroma", "get_window", "mel"]
