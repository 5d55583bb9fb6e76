"""Several frames stacked (librosa.feature.stack_memory)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._arrays import MOST, as_array
from ._refusals import refuses
from .errors import ParameterError


@refuses
def stack_memory(
    data: npt.ArrayLike, *, n_steps: int = 2, delay: int = 1, **kwargs: Any
) -> npt.NDArray[Any]:
    """Each frame stacked with earlier ones (librosa.feature.stack_memory).

    Parameters
    ----------
    data : [shape=(..., d, t)]
        Features.
    n_steps : int
        Number of frames to stack.
    delay : int
        Distance between stacked frames; negative for later frames.
    **kwargs
        Arguments of `numpy.pad` for frames beyond the ends; zeros by default.

    Returns
    -------
    [shape=(..., d * n_steps, t)]

    Examples
    --------
    >>> corsmal_feat.feature.stack_memory(np.arange(1, 4))
    array([[1, 2, 3],
           [0, 1, 2]])
    """
    if n_steps < 1:
        raise ParameterError(f"n_steps must be a whole number of at least 1, not {n_steps}")
    if delay == 0 or delay != int(delay):
        raise ParameterError(f"delay must be a whole number other than 0, not {delay}")
    array = np.atleast_2d(as_array("data", data))
    frames = array.shape[-1]
    if frames < 1:
        raise ParameterError(f"data has 0 frames (its shape is {array.shape}), expected at least 1")
    reach = (int(n_steps) - 1) * abs(int(delay))
    if array.size * int(n_steps) > MOST or reach > MOST:
        raise ParameterError(
            f"n_steps = {n_steps} and delay = {delay} give more than {MOST} values"
        )
    kwargs.setdefault("mode", "constant")
    widths = [(0, 0)] * array.ndim
    widths[-1] = (reach, 0) if delay > 0 else (0, reach)
    try:
        padded = np.pad(array, widths, **kwargs)
        starts = [(reach if delay > 0 else 0) - step * int(delay) for step in range(n_steps)]
        return np.concatenate([padded[..., s : s + frames] for s in starts], axis=-2)
    except MemoryError as error:
        raise ParameterError(
            f"not enough memory for n_steps = {n_steps} and delay = {delay}"
        ) from error
