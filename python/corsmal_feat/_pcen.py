"""Per-channel energy normalisation (librosa.pcen)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, as_array, rows, size, spectrum, unrows
from ._params import PcenParams
from ._refusals import refuses
from ._warnings import warn
from .errors import ParameterError


@refuses
def pcen(
    S: npt.ArrayLike,
    *,
    sr: float = 22050,
    hop_length: int = 512,
    gain: float = 0.98,
    bias: float = 2,
    power: float = 0.5,
    time_constant: float = 0.400,
    eps: float = 1e-6,
    b: float | None = None,
    max_size: int = 1,
    ref: npt.ArrayLike | None = None,
    axis: int = -1,
    max_axis: int | None = None,
    zi: npt.ArrayLike | None = None,
    return_zf: bool = False,
) -> Floats | tuple[Floats, Floats]:
    """Per-channel energy normalisation (librosa.pcen): every band is divided by its smoothed level,
    and compressed.

    Parameters
    ----------
    S : float32 or float64 [shape=(..., d, t)]
        Non-negative spectrogram. The defaults suit 32-bit integer samples: multiply a spectrogram
        of samples in -1..1 by 2**31.
    sr, hop_length : number, int
        Sample rate in Hz, and samples between frames; `time_constant` is in seconds.
    gain, bias, power, time_constant, eps, b : number
        Parameters of the gain control, the compression and the smoothing.
    max_size, max_axis : int
        Number of bands of a maximum filter before the smoothing, and the axis of bands.
    ref : [shape of S], optional
        Spectrogram to smooth instead of `S`.
    axis : int
        The axis of time.
    zi, return_zf
        Initial state of the smoothing, and whether to return the state after the last frame.

    Returns
    -------
    float64 [shape of S]; with `return_zf`, also the state [shape of S, 1 along `axis`]

    Examples
    --------
    >>> mel = corsmal_feat.feature.melspectrogram(y=np.zeros(22050, np.float32), power=1)
    >>> corsmal_feat.pcen(mel * 2**31).shape
    (128, 44)
    """
    if np.iscomplexobj(S):
        warn("pcen was called on complex input: phase is discarded")
        S = np.abs(as_array("S", S))
    s: Any = spectrum(S, 1)
    time = axis % s.ndim if -s.ndim <= axis < s.ndim else None
    if time is None:
        raise ParameterError(
            f"axis must be an axis of S, which has {s.ndim} dimensions, not {axis}"
        )
    max_size = size("max_size", max_size)
    places = [time]
    if max_size > 1 and ref is None:
        if s.ndim == 1:
            raise ParameterError(f"max_size must be 1 where S has one dimension, not {max_size}")
        if max_axis is not None and max_axis != int(max_axis):
            raise ParameterError(f"max_axis must be a whole number, not {max_axis}")
        if max_axis is None and s.ndim != 2:
            raise ParameterError(f"max_axis must be given, since S has {s.ndim} dimensions")
        bands = (1 - time) % 2 if max_axis is None else max_axis % s.ndim
        if bands == time:
            raise ParameterError(f"max_axis must not be the axis of time, {max_axis}")
        places = [bands, time]

    def in_order(array: Any) -> Any:
        moved = np.moveaxis(array, places, range(-len(places), 0))
        return np.ascontiguousarray(moved[np.newaxis] if moved.ndim == 1 else moved)

    ordered = in_order(s)
    levels = None
    if ref is not None:
        given = as_array("ref", ref)
        if given.shape != s.shape:
            raise ParameterError(f"ref has shape {given.shape}, expected {s.shape}")
        levels = rows(in_order(given.astype(s.dtype)), 2)
    state = None
    if zi is not None:
        shape = list(s.shape)
        shape[time] = 1
        try:
            begun = np.broadcast_to(as_array("zi", zi, np.float64), shape)
        except ValueError:
            found = np.shape(zi)
            raise ParameterError(f"zi has shape {found}, expected {tuple(shape)}") from None
        state = np.ascontiguousarray(rows(in_order(begun), 2)[..., 0])
    hop_length = size("hop_length", hop_length)
    keys = PcenParams(sr, hop_length, gain, bias, power, time_constant, eps, b, max_size)
    out, end = _core.pcen(rows(ordered, 2), levels, state, keys)

    def restored(array: Any) -> Any:
        array = array[0] if s.ndim == 1 else array
        return np.moveaxis(array, range(-len(places), 0), places)

    result: Floats = restored(unrows(out, ordered, 2))
    if not return_zf:
        return result
    return result, restored(end.reshape((*ordered.shape[:-1], 1)))
