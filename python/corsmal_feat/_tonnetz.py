"""Tonal centroids (librosa.feature.tonnetz)."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from . import _core
from ._arrays import Floats, floats, rows, unrows
from ._chroma_cqt import chroma_cqt
from ._refusals import refuses
from .errors import ParameterError


@refuses
def tonnetz(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    chroma: npt.ArrayLike | None = None,
    **kwargs: Any,
) -> Floats:
    """Tonal centroids (librosa.feature.tonnetz).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz.
    chroma : [shape=(..., n_chroma, t)], optional
        Chromagram to use instead of `chroma_cqt(y=y, sr=sr, **kwargs)`.
    **kwargs
        Arguments of `chroma_cqt`.

    Returns
    -------
    [shape=(..., 6, t)]

    Examples
    --------
    >>> corsmal_feat.feature.tonnetz(chroma=np.eye(12)).shape
    (6, 12)
    """
    if chroma is None:
        if y is None:
            raise ParameterError("y or chroma must be given")
        chroma = chroma_cqt(y=y, sr=sr, **kwargs)
    c = floats("chroma", chroma, 2)
    return unrows(_core.tonnetz(rows(c, 2)), c, 2)
