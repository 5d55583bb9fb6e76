"""Perceptual weightings (librosa.core.convert, librosa.perceptual_weighting)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from ._arrays import unmasked
from ._decibels import power_to_db
from ._refusals import refuses
from ._times import Doubles, Number
from .errors import ParameterError


def _clamped(weights: Any, min_db: float | None) -> Any:
    return weights if min_db is None else np.maximum(min_db, weights)


def _squares(frequencies: Any) -> Any:
    return np.asanyarray(frequencies) ** 2.0


@overload
def A_weighting(frequencies: Number, *, min_db: float | None = -80.0) -> np.float64: ...
@overload
def A_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Doubles: ...
@refuses
def A_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Any:
    """A weighting in dB (librosa.A_weighting, IEC 61672).

    Parameters
    ----------
    frequencies : number or [shape=(n,)]
        Hz.
    min_db : float, optional
        Lower limit of the weights; None for none.

    Returns
    -------
    dB, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.A_weighting([100.0, 1000.0]).round(1) + 0.0
    array([-19.1,   0. ])
    """
    f = _squares(frequencies)
    c = np.array([12194.217, 20.598997, 107.65265, 737.86223]) ** 2.0
    log = np.log10
    with np.errstate(divide="ignore"):
        gain = log(c[0]) + 2 * log(f) - log(f + c[0]) - log(f + c[1])
    gain = gain - 0.5 * log(f + c[2]) - 0.5 * log(f + c[3])
    return _clamped(2.0 + 20.0 * gain, min_db)


@overload
def B_weighting(frequencies: Number, *, min_db: float | None = -80.0) -> np.float64: ...
@overload
def B_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Doubles: ...
@refuses
def B_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Any:
    """B weighting in dB (librosa.B_weighting).

    Parameters
    ----------
    frequencies, min_db
        See `A_weighting`.

    Returns
    -------
    dB, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.B_weighting([100.0, 1000.0]).round(1) + 0.0
    array([-5.6,  0. ])
    """
    f = _squares(frequencies)
    c = np.array([12194.217, 20.598997, 158.48932]) ** 2.0
    log = np.log10
    with np.errstate(divide="ignore"):
        gain = log(c[0]) + 1.5 * log(f) - log(f + c[0]) - log(f + c[1]) - 0.5 * log(f + c[2])
    return _clamped(0.17 + 20.0 * gain, min_db)


@overload
def C_weighting(frequencies: Number, *, min_db: float | None = -80.0) -> np.float64: ...
@overload
def C_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Doubles: ...
@refuses
def C_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Any:
    """C weighting in dB (librosa.C_weighting, IEC 61672).

    Parameters
    ----------
    frequencies, min_db
        See `A_weighting`.

    Returns
    -------
    dB, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.C_weighting([100.0, 1000.0]).round(1) + 0.0
    array([-0.3,  0. ])
    """
    f = _squares(frequencies)
    c = np.array([12194.217, 20.598997]) ** 2.0
    log = np.log10
    with np.errstate(divide="ignore"):
        gain = log(c[0]) + log(f) - log(f + c[0]) - log(f + c[1])
    return _clamped(0.062 + 20.0 * gain, min_db)


@overload
def D_weighting(frequencies: Number, *, min_db: float | None = -80.0) -> np.float64: ...
@overload
def D_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Doubles: ...
@refuses
def D_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = -80.0) -> Any:
    """D weighting in dB (librosa.D_weighting).

    Parameters
    ----------
    frequencies, min_db
        See `A_weighting`.

    Returns
    -------
    dB, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.D_weighting([100.0, 1000.0]).round(1) + 0.0
    array([-7.2,  0. ])
    """
    f = _squares(frequencies)
    c = np.array([8.3046305e-3, 1018.7, 1039.6, 3136.5, 3424, 282.7, 1160]) ** 2.0
    log = np.log10
    with np.errstate(divide="ignore"):
        slope = 0.5 * log(f) - log(c[0])
    resonance = log((c[1] - f) ** 2 + c[2] * f) - log((c[3] - f) ** 2 + c[4] * f)
    gain = slope + 0.5 * (resonance - log(c[5] + f) - log(c[6] + f))
    return _clamped(20.0 * gain, min_db)


@refuses
def Z_weighting(frequencies: npt.ArrayLike, *, min_db: float | None = None) -> Doubles:
    """Z weighting in dB: zero at all frequencies (librosa.Z_weighting).

    Parameters
    ----------
    frequencies : [shape=(n,)]
        Hz.
    min_db : float, optional
        Lower limit of the weights.

    Returns
    -------
    dB [shape=(n,)]

    Examples
    --------
    >>> corsmal_feat.Z_weighting([100.0, 1000.0])
    array([0., 0.])
    """
    weights: Doubles = _clamped(np.zeros(len(np.atleast_1d(frequencies))), min_db)
    return weights


_KINDS: dict[str | None, Callable[..., Any]] = {
    "A": A_weighting,
    "B": B_weighting,
    "C": C_weighting,
    "D": D_weighting,
    "Z": Z_weighting,
    None: Z_weighting,
}


@refuses
def frequency_weighting(
    frequencies: npt.ArrayLike, *, kind: str | None = "A", **kwargs: Any
) -> Doubles:
    """Frequency weighting by name (librosa.frequency_weighting).

    Parameters
    ----------
    frequencies : number or [shape=(n,)]
        Hz.
    kind : {"A", "B", "C", "D", "Z", None}
        Name of the weighting.
    **kwargs
        `min_db` of the weighting.

    Returns
    -------
    dB, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.frequency_weighting([1000.0], kind="C").round(1) + 0.0
    array([0.])
    """
    name = kind.upper() if isinstance(kind, str) else kind
    if name not in _KINDS:
        raise ParameterError(f"kind must be 'A', 'B', 'C', 'D', 'Z' or None, not {kind!r}")
    weights: Doubles = _KINDS[name](frequencies, **kwargs)
    return weights


@refuses
def multi_frequency_weighting(
    frequencies: npt.ArrayLike, *, kinds: Iterable[str] = "ZAC", **kwargs: Any
) -> Doubles:
    """Several frequency weightings, stacked (librosa.multi_frequency_weighting).

    Parameters
    ----------
    frequencies : [shape=(n,)]
        Hz.
    kinds : iterable of str
        Names of the weightings, see `frequency_weighting`.
    **kwargs
        `min_db` of the weightings.

    Returns
    -------
    dB [shape=(number of kinds, n)]

    Examples
    --------
    >>> corsmal_feat.multi_frequency_weighting([100.0, 1000.0], kinds="ZA").shape
    (2, 2)
    """
    unmasked("frequencies", frequencies)
    return np.stack([frequency_weighting(frequencies, kind=k, **kwargs) for k in kinds])


@refuses
def perceptual_weighting(
    S: npt.ArrayLike, frequencies: npt.ArrayLike, *, kind: str | None = "A", **kwargs: Any
) -> npt.NDArray[Any]:
    """Weighted power spectrogram in dB (librosa.perceptual_weighting).

    Parameters
    ----------
    S : [shape=(..., d, t)]
        Power spectrogram.
    frequencies : [shape=(d,)]
        Frequencies of the rows of `S` in Hz.
    kind : str
        See `frequency_weighting`.
    **kwargs
        `ref`, `amin`, `top_db` of `power_to_db`.

    Returns
    -------
    dB, in the shape of `S`

    Examples
    --------
    >>> corsmal_feat.perceptual_weighting(np.ones((2, 1)), [100.0, 1000.0]).round(1) + 0.0
    array([[-19.1],
           [  0. ]])
    """
    offset = frequency_weighting(frequencies, kind=kind).reshape((-1, 1))
    weighted: npt.NDArray[Any] = offset + power_to_db(S, **kwargs)
    return weighted
