"""Plots of spectrograms and waveforms (librosa.display); needs matplotlib, the extra `plot`."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ._arrays import as_array
from ._frequencies import cqt_frequencies, fft_frequencies, mel_frequencies
from ._pitches import midi_to_hz
from ._refusals import refuses
from ._times import times_like
from ._warnings import warn
from .errors import ParameterError

__all__ = ["specshow", "waveshow"]

_C1 = float(midi_to_hz(24))
#: Axes of time, and one second in their units.
_TIMES = {"time": 1.0, "s": 1.0, "ms": 1e3}
_PLAIN = ("frames", "off", "none", None)
_HERTZ = ("linear", "fft", "hz", "log", "mel", "cqt_hz", "cqt_note")
_CLASSES = ("chroma", "tonnetz")
#: Axes of the same kind, which share a scale if they have the same limits.
_ALIKE = (
    set(_TIMES),
    {"linear", "fft", "hz"},
    *({name} for name in ("frames", "log", "mel", "cqt_hz", "cqt_note", "chroma", "tonnetz")),
)
#: Arguments that only librosa's ticks of Indian music, just intonation, keys and tempograms need.
_LEFT_OUT = (
    "Sa", "intervals", "key", "mela", "tempo_max", "tempo_min", "thaat", "unicode", "unison",
)  # fmt: skip


def _pyplot() -> Any:
    try:
        return import_module("matplotlib.pyplot")
    except ImportError as error:
        raise ImportError(
            "corsmal_feat.display needs matplotlib (pip install 'corsmal-feat[plot]')"
        ) from error


@refuses
def specshow(
    data: npt.ArrayLike,
    *,
    x_coords: npt.ArrayLike | None = None,
    y_coords: npt.ArrayLike | None = None,
    x_axis: str | None = None,
    y_axis: str | None = None,
    sr: float = 22050,
    hop_length: int = 512,
    n_fft: int | None = None,
    win_length: int | None = None,
    fmin: float | None = None,
    fmax: float | None = None,
    tuning: float = 0.0,
    bins_per_octave: int = 12,
    auto_aspect: bool = True,
    htk: bool = False,
    ax: Any = None,
    **kwargs: Any,
) -> Any:
    """Draws a spectrogram (librosa.display.specshow).

    Parameters
    ----------
    data : [shape=(d, t)]
        Data to draw; for complex values, their magnitude.
    x_coords, y_coords : [shape=(t,)] and [shape=(d,)], optional
        Positions to use instead of those of the axes.
    x_axis, y_axis : str, optional
        Kind of axis: "time", "s", "ms", "frames", "linear" (or "fft", "hz"), "log", "mel",
        "cqt_hz", "cqt_note", "chroma", "tonnetz", "off", or None.
    sr : float
        Sample rate in Hz.
    hop_length, n_fft, win_length : int
        Parameters of the transform.
    fmin, fmax : float, optional
        Range of mel bands, or `fmin` for the lowest bin of a constant-Q transform, in Hz.
    tuning : float
        Tuning of a constant-Q transform in fractions of a bin.
    bins_per_octave : int
        Bins per octave of a constant-Q transform or a chromagram.
    auto_aspect : bool
        Whether to use equal scales if both axes are of the same kind and have the same limits.
    htk : bool
        Whether mel bands are on HTK's scale instead of Slaney's.
    ax : matplotlib axes, optional
        Where to draw; by default, the current axes.
    **kwargs
        Arguments of matplotlib's `pcolormesh`.

    Returns
    -------
    matplotlib's mesh

    Examples
    --------
    >>> mesh = corsmal_feat.display.specshow(np.zeros((128, 9)), x_axis="time", y_axis="mel")
    >>> mesh.axes.get_ylabel()
    'Hz'
    """
    left_out = [name for name in _LEFT_OUT if name in kwargs]
    if left_out:
        raise ParameterError(f"{left_out[0]} is not available here: use librosa.display.specshow")
    values = np.asanyarray(data)  # matplotlib leaves masked cells empty
    if values.ndim != 2:
        raise ParameterError(f"data has {values.ndim} dimensions, expected 2")
    if np.iscomplexobj(values):
        values = np.abs(values)
    plot = _pyplot()
    axes = plot.gca() if ax is None else ax
    kwargs.setdefault("cmap", _colors(values))
    kwargs.setdefault("rasterized", True)
    kwargs.setdefault("shading", "auto")

    def positions(axis: str | None, count: int, given: npt.ArrayLike | None) -> Any:
        if given is not None:
            found = as_array("x_coords or y_coords", given)
            if found.shape not in ((count,), (count + 1,)):
                raise ParameterError(
                    f"x_coords or y_coords has shape {found.shape}, expected ({count},)"
                )
            return found
        if axis in _TIMES:
            return times_like(count, sr=sr, hop_length=hop_length)
        if axis in ("linear", "fft", "hz", "log"):
            length = 2 * (count - 1) if n_fft is None else n_fft
            bins = fft_frequencies(sr=sr, n_fft=length)
            if len(bins) != count:
                raise ParameterError(
                    f"n_fft = {length} gives {len(bins)} bins, but data has {count}: give the n_fft"
                    " of the transform"
                )
            return bins
        if axis == "mel":
            high = sr / 2 if fmax is None else fmax
            return mel_frequencies(count, fmin=fmin or 0.0, fmax=high, htk=htk)
        if axis in ("cqt_hz", "cqt_note"):
            low = _C1 if fmin is None else fmin
            found = cqt_frequencies(count, fmin=low, bins_per_octave=bins_per_octave, tuning=tuning)
            if (found > sr / 2).any():
                warn(
                    f"the frequencies reach {found[-1]:.0f} Hz, beyond sr / 2: give sr, fmin and"
                    " bins_per_octave of the transform"
                )
            return found
        if axis == "chroma":
            return np.arange(count) * 12 / bins_per_octave
        if axis in _PLAIN or axis in _CLASSES:
            return np.arange(count)
        names = ", ".join(str(name) for name in (*_TIMES, *_HERTZ, *_CLASSES, *_PLAIN))
        raise ParameterError(f"x_axis and y_axis must be one of {names}, not {axis!r}")

    x = positions(x_axis, values.shape[1], x_coords)
    y = positions(y_axis, values.shape[0], y_coords)
    mesh = axes.pcolormesh(x, y, values, **kwargs)
    if ax is None:
        plot.sci(mesh)
    _decorate(axes.xaxis, axes.set_xscale, x_axis)
    _decorate(axes.yaxis, axes.set_yscale, y_axis)
    alike = any(x_axis in kind and y_axis in kind for kind in _ALIKE)
    if auto_aspect and alike and axes.get_xlim() == axes.get_ylim():
        axes.set_aspect("equal")
    return mesh


def _colors(values: npt.NDArray[Any]) -> str:
    """A diverging colour map if values, without the outermost, are on both sides of zero."""
    if values.dtype == bool:
        return "gray_r"
    shown = np.ma.compressed(values)
    finite = shown[np.isfinite(shown)]
    low, high = np.percentile(finite, [2, 98]) if finite.size else (0.0, 0.0)
    return "coolwarm" if low < 0 < high else "magma"


def _decorate(axis: Any, scale: Callable[..., Any], kind: str | None) -> None:
    """Scale, ticks and label of an axis."""
    ticker = import_module("matplotlib.ticker")
    if kind in ("log", "cqt_hz", "cqt_note"):
        if kind == "log":
            scale("symlog", base=2, linthresh=64)
        else:
            scale("log", base=2)
        axis.set_major_formatter(ticker.ScalarFormatter())
    elif kind == "mel":
        scale("symlog", base=2, linthresh=1000.0)
        axis.set_major_formatter(ticker.ScalarFormatter())
    elif kind == "chroma":
        steps = np.array([0, 2, 4, 5, 7, 9, 11])
        axis.set_major_locator(ticker.FixedLocator(steps))
        axis.set_major_formatter(ticker.FixedFormatter(("C", "D", "E", "F", "G", "A", "B")))
    elif kind == "tonnetz":
        axis.set_major_locator(ticker.FixedLocator(np.arange(6)))
        axis.set_major_formatter(ticker.FixedFormatter(("5x", "5y", "m3x", "m3y", "M3x", "M3y")))
    elif kind == "ms":
        axis.set_major_formatter(ticker.FuncFormatter(lambda x, _: f"{1e3 * x:g}"))
    elif kind in ("off", "none", None):
        axis.set_ticks([])
    labels = {"time": "Time", "s": "Time (s)", "ms": "Time (ms)", "frames": "Frames"}
    labels |= {"chroma": "Pitch class", "tonnetz": "Tonnetz"} | dict.fromkeys(_HERTZ, "Hz")
    axis.set_label_text(labels.get(kind or "", ""))


@refuses
def waveshow(
    y: npt.ArrayLike,
    *,
    sr: float = 22050,
    max_points: int = 11025,
    axis: str | None = "time",
    offset: float = 0.0,
    marker: Any = "",
    where: Literal["pre", "post", "mid"] = "post",
    label: str | None = None,
    transpose: bool = False,
    ax: Any = None,
    **kwargs: Any,
) -> Any:
    """Draws a waveform: its samples or, if there are too many, the range of each stretch
    (librosa.display.waveshow).

    Parameters
    ----------
    y : [shape=(n,) or (channels, n)]
        Signal; for two or more channels, the largest magnitude is drawn.
    sr : float
        Sample rate in Hz.
    max_points : int
        Maximum number of points to draw.
    axis : {"time", "s", "ms", "frames", "off", None}
        Kind of the time axis, see `specshow`.
    offset : float
        Time of the first sample in seconds.
    marker : matplotlib marker
        Marker for samples, if they are drawn.
    where : {"post", "pre", "mid"}
        Where steps are placed, as in matplotlib's `step`.
    label : str, optional
        Label for the legend.
    transpose : bool
        Whether to draw time upwards.
    ax : matplotlib axes, optional
        Where to draw; by default, the current axes.
    **kwargs
        Arguments of matplotlib's `step` or `fill_between`.

    Returns
    -------
    matplotlib's line, or filled area

    Examples
    --------
    >>> area = corsmal_feat.display.waveshow(np.zeros(22050))
    >>> area.axes.get_xlabel()
    'Time'
    """
    signal = np.atleast_2d(as_array("y", y))
    if signal.ndim > 2 or not signal.size:
        raise ParameterError(f"y has shape {np.shape(y)}, expected (n,) or (channels, n)")
    if not sr > 0:
        raise ParameterError(f"sr must be a positive sample rate in Hz, not {sr}")
    if max_points < 1:
        raise ParameterError(f"max_points must be at least 1, not {max_points}")
    plot = _pyplot()
    axes = plot.gca() if ax is None else ax
    samples = signal.shape[1]
    if samples <= max_points and len(signal) == 1:
        points = [offset + np.arange(samples) / sr, signal[0]]
        if transpose:
            points.reverse()
        (drawn,) = axes.step(*points, marker=marker, where=where, label=label, **kwargs)
    else:
        piece = -(-samples // max_points)
        padded = np.pad(np.abs(signal).max(axis=0), (0, -samples % piece))
        upper = padded.reshape(-1, piece).max(axis=1)
        lower = -upper
        if len(signal) == 1:
            padded = np.pad(signal[0], (0, -samples % piece), mode="edge").reshape(-1, piece)
            upper, lower = padded.max(axis=1), padded.min(axis=1)
        times = offset + np.arange(len(upper)) * piece / sr
        fill = axes.fill_betweenx if transpose else axes.fill_between
        drawn = fill(times, lower, upper, step=where, label=label, **kwargs)
    along, scale = (axes.yaxis, axes.set_yscale) if transpose else (axes.xaxis, axes.set_xscale)
    _decorate(along, scale, axis)
    return drawn
