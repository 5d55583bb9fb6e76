"""Filter banks and windows (librosa.filters)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._core import ParameterError

__all__ = ["get_window"]


def window_name(window: Any) -> str:
    """The name by which the Rust side knows a window: a string or ("kaiser", beta)."""
    if isinstance(window, str):
        return window
    if isinstance(window, tuple) and len(window) == 2 and window[0] == "kaiser":
        return f"kaiser:{float(window[1])}"
    raise ParameterError(f"window = {window!r} is not possible: a name or ('kaiser', beta)")


def get_window(window: Any, Nx: int, *, fftbins: bool = True) -> npt.NDArray[np.float64]:
    """A window of `Nx` points, periodic unless `fftbins=False` (librosa.filters.get_window)."""
    return _core.get_window(window_name(window), int(Nx), bool(fftbins))
