"""Sample-rate conversion (librosa.resample)."""

from __future__ import annotations

from math import gcd
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import MOST, Floats, audio, number, rows, unrows
from ._refusals import refuses
from .errors import ParameterError
from .util import fix_length

#: The band-limited converters of librosa that have no filter of their own here.
_AS_SOXR_HQ = (
    "soxr_vhq",
    "soxr_mq",
    "soxr_lq",
    "soxr_qq",
    "sinc_best",
    "sinc_medium",
    "sinc_fastest",
)
_OWN = ("soxr_hq", "kaiser_best", "kaiser_fast")
_WHOLE = ("fft", "scipy", "polyphase", "linear", "zero_order_hold")
CONVERTERS = _OWN + _WHOLE + _AS_SOXR_HQ
#: Largest term of a ratio for the polyphase filter, which has 20 times as many taps.
_MOST_PHASES = 100_000


@refuses
def resample(
    y: npt.ArrayLike,
    *,
    orig_sr: float,
    target_sr: float,
    res_type: str = "soxr_hq",
    fix: bool = True,
    scale: bool = False,
    axis: int = -1,
) -> Floats:
    """Converts a signal to another sample rate (librosa.resample).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal, along the last axis unless `axis` says otherwise.
    orig_sr, target_sr : float
        Sample rates in Hz. If they are equal, the result is `y` itself.
    res_type : str
        "soxr_hq" (librosa's default since 0.10), "kaiser_best" (its default before) or
        "kaiser_fast"; "fft" or "scipy", "polyphase" (whole numbers of Hz), "linear" and
        "zero_order_hold". The other soxr_* and sinc_* types are the same as "soxr_hq". The kaiser_*
        types are those of resampy 0.2; librosa's are those of the installed resampy.
    fix : bool
        Whether to cut or pad the result to `ceil(n * target_sr / orig_sr)` samples.
    scale : bool
        Whether to divide the result by the square root of the ratio.
    axis : int
        Axis of time.

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
    if not -y.ndim <= axis < y.ndim:
        raise ParameterError(
            f"axis must be an axis of y, which has {y.ndim} dimensions, not {axis}"
        )
    name = "soxr_hq" if res_type in _AS_SOXR_HQ else str(res_type)
    if name not in CONVERTERS:
        names = ", ".join(CONVERTERS)
        raise ParameterError(f"res_type must be one of {names}, not {res_type!r}")
    orig_sr, target_sr = number("orig_sr", orig_sr), number("target_sr", target_sr)
    if not (np.isfinite([orig_sr, target_sr]).all() and orig_sr > 0 and target_sr > 0):
        raise ParameterError(
            f"orig_sr and target_sr must be positive rates in Hz, not {orig_sr} and {target_sr}"
        )
    if y.shape[axis] * (target_sr / orig_sr) > MOST:
        raise ParameterError(f"target_sr = {target_sr} gives more than {MOST} samples")
    if orig_sr == target_sr:
        return y
    moved = np.moveaxis(y, axis, -1)
    result: Any
    if name in _OWN:
        flat = _core.resample(rows(moved, 1), orig_sr, target_sr, name, bool(fix), bool(scale))
        result = unrows(flat, moved, 1)
    else:
        result = _by_whole_signal(moved, orig_sr, target_sr, name)
        if fix:
            samples = int(np.ceil(moved.shape[-1] * (target_sr / orig_sr)))
            result = fix_length(result, size=samples)
        if scale:
            result = result / np.sqrt(target_sr / orig_sr)
        result = np.ascontiguousarray(result, dtype=y.dtype)
    resampled: Floats = np.moveaxis(result, -1, axis)
    return resampled


def _by_whole_signal(y: Floats, orig_sr: float, target_sr: float, name: str) -> Any:
    ratio = target_sr / orig_sr
    samples = int(np.ceil(y.shape[-1] * ratio))
    if samples < 1:
        raise ParameterError(f"y has {y.shape[-1]} samples, too few for one at {target_sr} Hz")
    try:
        if name in ("fft", "scipy"):
            return _fourier(y, samples)
        if name == "polyphase":
            return _polyphase(y, orig_sr, target_sr)
        return _interpolated(y, samples, ratio, name == "linear")
    except MemoryError as error:
        raise ParameterError(f"not enough memory for {samples} samples") from error


def _fourier(y: Floats, samples: int) -> Any:
    """Cuts the spectrum or continues it with zeros (scipy.signal.resample)."""
    n = y.shape[-1]
    spectrum = np.fft.rfft(y)
    shorter = min(n, samples)
    kept = np.zeros((*y.shape[:-1], samples // 2 + 1), dtype=spectrum.dtype)
    kept[..., : shorter // 2 + 1] = spectrum[..., : shorter // 2 + 1]
    if shorter % 2 == 0 and n != samples:
        # The bin at half the lower rate stands for a pair at the higher one.
        kept[..., shorter // 2] *= 2 if samples < n else 0.5
    return np.fft.irfft(kept, samples) * (samples / n)


def _polyphase(y: Floats, orig_sr: float, target_sr: float) -> Any:
    """Filters by a windowed sinc for a ratio of whole numbers (scipy.signal.resample_poly)."""
    if int(orig_sr) != orig_sr or int(target_sr) != target_sr:
        raise ParameterError(
            "orig_sr and target_sr must be whole numbers of Hz for polyphase,"
            f" not {orig_sr} and {target_sr}"
        )
    common = gcd(int(orig_sr), int(target_sr))
    up, down = int(target_sr) // common, int(orig_sr) // common
    widest = max(up, down)
    if widest > _MOST_PHASES:
        raise ParameterError(
            f"polyphase accepts ratios with terms up to {_MOST_PHASES}, not {up} / {down};"
            " soxr_hq accepts any ratio"
        )
    half = 10 * widest
    taps = np.sinc(np.arange(-half, half + 1) / widest) * np.kaiser(2 * half + 1, 5.0)
    taps = (taps / taps.sum()).astype(y.dtype) * y.dtype.type(up)
    n = y.shape[-1]
    samples = -(-n * up // down)
    longest = 2 * half // up + 1
    behind = longest + (samples * down + half) // up + 1 - n
    padded = np.pad(y, [(0, 0)] * (y.ndim - 1) + [(longest, max(behind, 0))])
    result = np.empty((*y.shape[:-1], samples), dtype=y.dtype)
    for first in range(min(up, samples)):
        last_input, phase = divmod(first * down + half, up)
        weights = taps[phase::up][::-1]
        windows = np.lib.stride_tricks.sliding_window_view(padded, len(weights), axis=-1)
        outputs = len(range(first, samples, up))
        start = longest + last_input - len(weights) + 1
        part = windows[..., start : start + (outputs - 1) * down + 1 : down, :]
        result[..., first::up] = part @ weights
    return result


def _interpolated(y: Floats, samples: int, ratio: float, linear: bool) -> Any:
    """Interpolates between neighbouring samples, or repeats the one before."""
    at = np.minimum(np.arange(samples) / ratio, y.shape[-1] - 1)
    before = at.astype(np.int64)
    if not linear:
        return y[..., before]
    after = np.minimum(before + 1, y.shape[-1] - 1)
    weight = at - before
    return y[..., before] * (1 - weight) + y[..., after] * weight
