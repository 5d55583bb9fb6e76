"""Mixing channels down to one."""

from __future__ import annotations

import math

import numpy.typing as npt

from . import _core
from ._arrays import Floats, audio
from ._refusals import refuses


@refuses
def to_mono(y: npt.ArrayLike) -> Floats:
    """Mean of all channels (librosa.to_mono).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal; its leading axes are channels.

    Returns
    -------
    [shape=(n,)] in the precision of `y`

    Examples
    --------
    >>> corsmal_feat.to_mono(np.array([[1.0, 2.0], [3.0, 4.0]]))
    array([2., 3.])
    """
    y = audio(y)
    if y.ndim == 1:
        return y
    return _core.to_mono(y.reshape((math.prod(y.shape[:-1]), y.shape[-1])).copy(order="C"))
