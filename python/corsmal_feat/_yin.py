"""Fundamental frequency (librosa.yin)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ._arrays import Floats, audio, number, size
from ._refusals import refuses
from ._warnings import warn
from .errors import ParameterError
from .util import frame, tiny

#: Values per block of frames: bounds the memory of the transforms.
_BLOCK = 1 << 22
_NOT_GIVEN: Any = object()
_PADDINGS = ("constant", "edge", "reflect", "symmetric", "wrap", "linear_ramp")


@refuses
def yin(
    y: npt.ArrayLike,
    *,
    fmin: float,
    fmax: float,
    sr: float = 22050,
    frame_length: int = 2048,
    win_length: int | None = _NOT_GIVEN,
    hop_length: int | None = None,
    trough_threshold: float = 0.1,
    center: bool = True,
    pad_mode: str = "constant",
) -> Floats:
    """Fundamental frequency of each frame by the YIN algorithm (librosa.yin; de Cheveigné and
    Kawahara 2002).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal at the sample rate `sr` in Hz.
    fmin, fmax : float
        Lowest and highest frequency in Hz, at most half the sample rate.
    frame_length : int
        Samples per frame; at least two periods of `fmin` should fit.
    win_length : deprecated
        Has no effect, as in librosa 0.11.
    hop_length : int, optional
        Samples between frames; by default, a quarter of `frame_length`.
    trough_threshold : float
        The period is the first trough of the difference function below this.
    center : bool
        Whether to centre frames by padding the signal.
    pad_mode : str
        Padding mode of `numpy.pad`.

    Returns
    -------
    Hz [shape=(..., t)]

    Examples
    --------
    >>> y = np.sin(2 * np.pi * 220 * np.arange(22050) / 22050)
    >>> corsmal_feat.yin(y, fmin=110, fmax=440)[10].round()
    np.float64(220.0)
    """
    if fmin is None or fmax is None:
        raise ParameterError("fmin and fmax must be given")
    if win_length is not _NOT_GIVEN:
        warn("win_length is deprecated in librosa 0.11 and has no effect", category=FutureWarning)
    sr, fmin, fmax = number("sr", sr), number("fmin", fmin), number("fmax", fmax)
    _check(sr, fmin, fmax, frame_length)
    signal = audio(y)
    hop = frame_length // 4 if hop_length is None else size("hop_length", hop_length, 0)
    if pad_mode not in _PADDINGS:
        raise ParameterError(f"pad_mode must be one of {_PADDINGS}, not {pad_mode!r}")
    if center:
        widths = [(0, 0)] * signal.ndim
        widths[-1] = (frame_length // 2, frame_length // 2)
        signal = np.pad(signal, widths, mode=pad_mode)  # type: ignore[call-overload]
    frames = np.moveaxis(frame(signal, frame_length=frame_length, hop_length=hop), -1, -2)
    shortest = int(np.floor(sr / fmax))
    longest = min(int(np.ceil(sr / fmin)), frame_length - 1)
    rows = frames.reshape((-1, frame_length))
    step = max(1, _BLOCK // (2 * frame_length))
    parts = [
        _periods(rows[i : i + step], shortest, longest, trough_threshold)
        for i in range(0, len(rows), step)
    ]
    periods: Any = np.concatenate(parts)
    frequencies: Floats = sr / periods.reshape(frames.shape[:-1])
    return frequencies


def _check(sr: float, fmin: float, fmax: float, frame_length: int) -> None:
    if not 1 <= frame_length <= 1 << 24:
        raise ParameterError(f"frame_length must be 1 to {1 << 24}, not {frame_length}")
    if fmax > sr / 2:
        raise ParameterError(f"fmax must be at most sr / 2 ({sr / 2} Hz), not {fmax:.3f}")
    if fmin >= fmax:
        raise ParameterError(f"fmin must be below fmax ({fmax:.3f} Hz), not {fmin:.3f}")
    if fmin <= 0:
        raise ParameterError(f"fmin must be above 0 Hz, not {fmin:.3f}")
    if sr / fmin >= frame_length - 1:
        raise ParameterError(
            f"fmin={fmin:.3f} is too low for frame_length={frame_length} and sr={sr}. "
            f"Increase to fmin={sr / (frame_length - 1):.3f} or "
            f"frame_length={int(np.ceil(sr / fmin) + 1)}"
        )
    if sr / fmin >= frame_length // 2:
        warn(
            f"With fmin={fmin:.3f}, sr={sr} and frame_length={frame_length}, less than two "
            "periods of fmin fit into the frame, which can make the pitch inaccurate. "
            f"Consider increasing to fmin={sr / (frame_length / 2):.3f} or "
            f"frame_length={int(np.ceil(sr / fmin) * 2 + 1)}."
        )


def _periods(frames: Floats, shortest: int, longest: int, threshold: float) -> Floats:
    """Periods in samples of frames [shape=(t, frame_length)]."""
    difference = _normalized_difference(frames, shortest, longest)
    before, here, after = difference[:, :-2], difference[:, 1:-1], difference[:, 2:]
    # The least value of a parabola through three points.
    curve, slope = after + before - 2 * here, (after - before) / 2
    shifts = np.zeros_like(difference)
    inside = np.abs(slope) < np.abs(curve)
    np.divide(-slope, curve, out=shifts[:, 1:-1], where=inside)
    trough = np.zeros(difference.shape, dtype=bool)
    trough[:, 1:-1] = (here < before) & (here <= after)
    trough[:, -1] = difference[:, -1] < difference[:, -2]
    trough[:, 0] = difference[:, 0] < difference[:, 1]
    low = trough & (difference < threshold)
    best = np.where(low.any(axis=1), low.argmax(axis=1), difference.argmin(axis=1))
    shift = np.take_along_axis(shifts, best[:, None], axis=1)[:, 0]
    return np.asarray(shortest + best + shift)


def _normalized_difference(frames: Floats, shortest: int, longest: int) -> Floats:
    """Squared differences at lags `shortest` to `longest`, over their mean at all shorter lags."""
    n = frames.shape[1]
    spectrum = np.fft.rfft(frames, _good_length(2 * n - 1), axis=1)
    power = spectrum.real**2 + spectrum.imag**2
    products = np.fft.irfft(power, _good_length(2 * n - 1), axis=1)[:, : longest + 1]
    energy = np.cumsum(np.square(frames), axis=1)
    # librosa leaves out the first sample at lag 1.
    energy[:, 0] = 0
    lags = np.arange(1, longest + 1)
    difference = 2 * (products[:, :1] - products[:, 1:]) - energy[:, :longest]
    mean = np.cumsum(difference, axis=1) / lags
    divisor = mean[:, shortest - 1 :]
    return np.asarray(difference[:, shortest - 1 :] / (divisor + tiny(divisor)))


def _good_length(n: int) -> int:
    """The smallest length of at least `n` with only the factors 2, 3 and 5."""
    best = 1 << (n - 1).bit_length()
    fives = 1
    while fives < best:
        threes = fives
        while threes < best:
            length = threes
            while length < n:
                length *= 2
            best = min(best, length)
            threes *= 3
        fives *= 5
    return best
