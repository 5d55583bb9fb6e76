"""Sample-rate conversion (librosa.resample)."""

from __future__ import annotations

from typing import Any

import numpy as np

from . import _core
from ._arrays import audio, rows, unrows

__all__ = ["resample"]


def resample(
    y: Any,
    *,
    orig_sr: float,
    target_sr: float,
    res_type: str = "soxr_hq",
    fix: bool = True,
    scale: bool = False,
    axis: int = -1,
) -> Any:
    """`y` at another rate (librosa.resample).

    `res_type` is "soxr_hq" (librosa's default since 0.10), "kaiser_best" (its default before) or
    "kaiser_fast". With `fix` the result has `ceil(n * target_sr / orig_sr)` samples; `scale`
    divides it by the square root of the ratio. Equal rates return `y` itself.

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal, along the last axis unless `axis` says otherwise.
    orig_sr, target_sr : float
        Rates in Hz.
    res_type, fix, scale
        See above.

    Returns
    -------
    [shape=(..., ceil(n * target_sr / orig_sr))] in the precision of `y`

    Examples
    --------
    >>> y = np.zeros((8, 44100), np.float32)
    >>> corsmal_feat.resample(y, orig_sr=44100, target_sr=16000).shape
    (8, 16000)
    """
    y = audio(y)
    if orig_sr == target_sr:
        return y
    moved = np.moveaxis(y, axis, -1)
    rates = (float(orig_sr), float(target_sr))
    result = _core.resample(rows(moved, 1), rates, str(res_type), bool(fix), bool(scale))
    return np.moveaxis(unrows(result, moved, 1), -1, axis)
