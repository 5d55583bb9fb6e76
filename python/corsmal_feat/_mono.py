"""Mixing channels to one."""

from __future__ import annotations

from typing import Any

from . import _core
from ._arrays import audio


def to_mono(y: Any) -> Any:
    """Mean over all leading axes [shape=(n,)] (librosa.to_mono)."""
    y = audio(y)
    if y.ndim == 1:
        return y
    return _core.to_mono(y.reshape((-1, y.shape[-1])).copy(order="C"))
