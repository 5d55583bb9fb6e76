"""Inverse STFT, harmonic-percussive separation, constant-Q features and AF193."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Complexes, Floats, audio, floats, number, room, rows, size, unrows
from ._chroma import chroma_stft
from ._filters import Window, wavelet_window
from ._mel import melspectrogram, mfcc
from ._params import CqtChromaParams, CqtParams, HpssParams
from ._pitch import estimate_tuning
from ._resample import CONVERTERS
from ._spectral import spectral_contrast
from ._spectrum import stft, stft_params, warn_short
from .errors import ParameterError

C1 = 440.0 * 2.0 ** ((24.0 - 69.0) / 12.0)


def _pair(value: Any) -> tuple[Any, Any]:
    """A value for the harmonic and one for the percussive side."""
    if isinstance(value, tuple | list):
        if len(value) < 2:
            raise ParameterError(f"expected a number or a pair, not {value!r}")
        return value[0], value[1]
    return value, value


def _hpss_params(kernel_size: Any, power: float, margin: Any) -> HpssParams:
    kernels, margins = _pair(kernel_size), _pair(margin)
    return HpssParams(
        kernel_harmonic=size("kernel_size", kernels[0]),
        kernel_percussive=size("kernel_size", kernels[1]),
        power=number("power", power),
        margin_harmonic=float(margins[0]),
        margin_percussive=float(margins[1]),
    )


def istft(
    stft_matrix: npt.ArrayLike,
    *,
    hop_length: int | None = None,
    win_length: int | None = None,
    n_fft: int | None = None,
    window: Window = "hann",
    center: bool = True,
    dtype: npt.DTypeLike | None = None,
    length: int | None = None,
    out: Floats | None = None,
) -> Floats:
    """Signal [shape=(..., n)] of a spectrogram [shape=(..., 1 + n_fft/2, frames)]
    (librosa.istft).

    Parameters
    ----------
    stft_matrix : complex64 or complex128 [shape=(..., 1 + n_fft // 2, t)]
        Spectrogram.
    hop_length, win_length, n_fft, window, center
        As they were in `stft`.
    length : int, optional
        Samples of the result.
    dtype : float32 or float64, optional
        Of the result; the precision of `stft_matrix` by default.
    out : array, optional
        Where to put the result.

    Returns
    -------
    float32 or float64 [shape=(..., n)]

    Examples
    --------
    >>> y = np.random.default_rng(0).normal(size=8000)
    >>> np.allclose(corsmal_feat.istft(corsmal_feat.stft(y), length=8000), y)
    True
    """
    d = np.asarray(stft_matrix)
    if d.ndim < 2:
        raise ParameterError(f"stft_matrix has {d.ndim} dimensions, expected at least 2")
    if d.dtype not in (np.complex64, np.complex128):
        d = d.astype(np.complex64 if d.dtype == np.float32 else np.complex128)
    if n_fft is None:
        n_fft = 2 * (d.shape[-2] - 1)
    params = stft_params(n_fft, hop_length, win_length, window, center, "constant")
    samples = size("length", length) if length else None
    room("a signal", d.size // (d.shape[-2] * d.shape[-1] or 1), samples or 0)
    flat = _core.istft(np.ascontiguousarray(d.reshape(-1, *d.shape[-2:])), params, samples)
    y: Floats = flat.reshape(*d.shape[:-2], flat.shape[-1])
    if dtype is not None:
        y = y.astype(dtype, copy=False)
    if out is None:
        return y
    if out.shape != y.shape:
        raise ParameterError(f"out has shape {out.shape}, expected {y.shape}")
    out[...] = y
    return out


def hpss(
    S: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
) -> tuple[Any, Any]:
    """Harmonic and percussive part of a spectrogram by median filtering (librosa.decompose.hpss).

    Parameters
    ----------
    S : float or complex [shape=(..., d, t)]
        Spectrogram.
    kernel_size : int or pair of int
        Frames, and bins, of the median filters.
    power : float
        Exponent of the soft masks, infinite for binary ones.
    mask : bool
        The masks instead of the parts.
    margin : float or pair of float
        Factors by which one part must exceed the other, at least 1.

    Returns
    -------
    harmonic and percussive part, or mask, each in the shape of `S`

    Examples
    --------
    >>> S = np.abs(corsmal_feat.stft(np.random.default_rng(0).normal(size=22050)))
    >>> harmonic, percussive = corsmal_feat.decompose.hpss(S)
    >>> np.allclose(harmonic + percussive, S)
    True
    """
    params = _hpss_params(kernel_size, power, margin)
    spectrogram = np.asarray(S)
    s = floats("S", np.abs(spectrogram) if np.iscomplexobj(spectrogram) else spectrogram, 2)
    harmonic, percussive = (unrows(m, s, 2) for m in _core.hpss_masks(rows(s, 2), params))
    if np.isinf(power):
        harmonic, percussive = harmonic.astype(bool), percussive.astype(bool)
    if mask:
        return harmonic, percussive
    return spectrogram * harmonic, spectrogram * percussive


def _separate(
    y: Any,
    kernel_size: Any,
    power: float,
    mask: bool,
    margin: Any,
    n_fft: int,
    hop_length: int | None,
    win_length: int | None,
    center: bool,
    pad_mode: str,
    parts: tuple[bool, bool],
) -> list[Floats]:
    """The asked ones of the harmonic and the percussive part."""
    y = audio(y)
    stft_tuple = stft_params(n_fft, hop_length, win_length, "hann", center, pad_mode)
    params = _hpss_params(kernel_size, power, margin)
    warn_short(y, n_fft, stacklevel=3)
    separated = _core.separate(rows(y, 1), stft_tuple, params, bool(mask), *parts)
    return [unrows(part, y, 1) for part in separated]


def effects_hpss(
    y: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> tuple[Any, Any]:
    """Harmonic and percussive part of a signal (librosa.effects.hpss).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    kernel_size, power, mask, margin
        See `decompose.hpss`.
    n_fft, hop_length, win_length, center, pad_mode
        See `stft`.
    window : str
        Without effect, as in librosa.

    Returns
    -------
    harmonic and percussive part, each in the shape of `y`

    Examples
    --------
    >>> y = np.sin(0.1 * np.arange(22050))
    >>> harmonic, percussive = corsmal_feat.effects.hpss(y)
    >>> harmonic.shape
    (22050,)
    """
    harmonic, percussive = _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (True, True),
    )  # fmt: skip
    return harmonic, percussive


def harmonic(
    y: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Floats:
    """Harmonic part of a signal (librosa.effects.harmonic).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    kernel_size, power, mask, margin
        See `decompose.hpss`.
    n_fft, hop_length, win_length, center, pad_mode
        See `stft`.
    window : str
        Without effect, as in librosa.

    Returns
    -------
    in the shape of `y`

    Examples
    --------
    >>> corsmal_feat.effects.harmonic(np.sin(0.1 * np.arange(22050))).shape
    (22050,)
    """
    (part,) = _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (True, False),
    )  # fmt: skip
    return part


def percussive(
    y: npt.ArrayLike,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Window = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Floats:
    """Percussive part of a signal (librosa.effects.percussive).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal.
    kernel_size, power, mask, margin
        See `decompose.hpss`.
    n_fft, hop_length, win_length, center, pad_mode
        See `stft`.
    window : str
        Without effect, as in librosa.

    Returns
    -------
    in the shape of `y`

    Examples
    --------
    >>> corsmal_feat.effects.percussive(np.sin(0.1 * np.arange(22050))).shape
    (22050,)
    """
    (part,) = _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (False, True),
    )  # fmt: skip
    return part


def _cqt_params(
    sr: float,
    hop_length: int,
    fmin: float | None,
    n_bins: int,
    bins_per_octave: int,
    tuning: float,
    filter_scale: float = 1.0,
    norm: float | None = 1.0,
    sparsity: float = 0.01,
    window: Window = "hann",
    scale: bool = True,
    pad_mode: str = "constant",
) -> CqtParams:
    return CqtParams(
        sr=number("sr", sr),
        hop_length=size("hop_length", hop_length),
        fmin=C1 if fmin is None else number("fmin", fmin),
        n_bins=size("n_bins", n_bins),
        bins_per_octave=size("bins_per_octave", bins_per_octave),
        tuning=number("tuning", tuning),
        filter_scale=number("filter_scale", filter_scale),
        norm=None if norm is None else number("norm", norm),
        sparsity=number("sparsity", sparsity),
        window=wavelet_window(window),
        scale=bool(scale),
        pad_mode=str(pad_mode),
    )


def cqt(
    y: npt.ArrayLike,
    *,
    sr: float = 22050,
    hop_length: int = 512,
    fmin: float | None = None,
    n_bins: int = 84,
    bins_per_octave: int = 12,
    tuning: float | None = 0.0,
    filter_scale: float = 1,
    norm: float | None = 1,
    sparsity: float = 0.01,
    window: Window = "hann",
    scale: bool = True,
    pad_mode: str = "constant",
    res_type: str | None = "soxr_hq",
    dtype: npt.DTypeLike | None = None,
) -> Complexes:
    """Constant-Q transform (librosa.cqt).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)]
        Signal at the sample rate `sr` in Hz.
    hop_length : int
        Samples between frames.
    fmin : float, optional
        Lowest bin in Hz, C1 by default.
    n_bins, bins_per_octave : int
        Bins in all, and of an octave.
    tuning : float, optional
        Deviation from A440 in fractions of a bin; None estimates one for all channels.
    filter_scale : float
        Factor of the filters' lengths.
    norm : float, optional
        Norm of the filters.
    sparsity : float
        Share of each filter's energy that is left out.
    window : str, tuple or float
        See `filters.get_window`.
    scale : bool
        Divide by the square roots of the filters' lengths.
    pad_mode : {"constant", "edge", "reflect", "symmetric"}
        What lies beyond the ends.
    res_type : str
        One of `resample`; whatever it is, the octaves are decimated by a filter equal to soxr's
        "HQ" to 1e-6.
    dtype : complex dtype, optional
        Of the result.

    Returns
    -------
    complex64 or complex128 [shape=(..., n_bins, t)]

    Examples
    --------
    >>> y = np.sin(2 * np.pi * 440 * np.arange(22050) / 22050)
    >>> np.abs(corsmal_feat.cqt(y, sr=22050))[:, 20].argmax()
    np.int64(45)
    """
    y = audio(y)
    if res_type is None:
        warnings.warn(
            "Support for VQT with res_type=None is deprecated: it stands for 'soxr_hq'",
            FutureWarning,
            stacklevel=2,
        )
    elif res_type not in CONVERTERS:
        names = ", ".join(CONVERTERS)
        raise ParameterError(f"res_type must be one of {names}, not {res_type!r}")
    if tuning is None:
        tuning = estimate_tuning(y=y, sr=sr, bins_per_octave=bins_per_octave)
    params = _cqt_params(
        sr, hop_length, fmin, n_bins, bins_per_octave, tuning, filter_scale, norm, sparsity,
        window, scale, pad_mode,
    )  # fmt: skip
    room("a transform", 2, y.size // (y.shape[-1] or 1), n_bins, 1 + y.shape[-1] // hop_length)
    result: Any = unrows(_core.cqt(rows(y, 1), params), y, 1)
    transform: Complexes = result if dtype is None else result.astype(dtype, copy=False)
    return transform


def chroma_cqt(
    *,
    y: npt.ArrayLike | None = None,
    sr: float = 22050,
    C: npt.ArrayLike | None = None,
    hop_length: int = 512,
    fmin: float | None = None,
    norm: float | None = np.inf,
    threshold: float | None = 0.0,
    tuning: float | None = None,
    n_chroma: int = 12,
    n_octaves: int = 7,
    window: Any = None,
    bins_per_octave: int | None = 36,
    cqt_mode: str = "full",
) -> Floats:
    """Chromagram of a constant-Q transform (librosa.feature.chroma_cqt).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz.
    C : [shape=(..., d, t)], optional
        Constant-Q magnitudes to use instead.
    hop_length, fmin, tuning
        See `cqt`; the tuning is estimated by default.
    norm : float, optional
        Norm that each frame is divided by, None for none.
    threshold : float, optional
        Smaller values become zero.
    n_chroma, n_octaves, bins_per_octave : int
        Classes, octaves, and bins of an octave (`n_chroma` by default).
    window : [shape=(any,)], optional
        Weights of neighbouring bins.
    cqt_mode : {"full"}
        The other modes of librosa do not exist here.

    Returns
    -------
    [shape=(..., n_chroma, t)]

    Examples
    --------
    >>> y = np.sin(2 * np.pi * 440 * np.arange(22050) / 22050)
    >>> corsmal_feat.feature.chroma_cqt(y=y, sr=22050, tuning=0)[:, 20].argmax()
    np.int64(9)
    """
    if cqt_mode != "full":
        raise ParameterError(f"cqt_mode must be 'full', not {cqt_mode!r}")
    n_chroma = size("n_chroma", n_chroma)
    room("a chromagram", n_chroma)
    bins_per_octave = n_chroma if bins_per_octave is None else bins_per_octave
    bins_per_octave = size("bins_per_octave", bins_per_octave)
    weights = None if window is None else np.ravel(window)
    chroma = CqtChromaParams(
        bins_per_octave=bins_per_octave,
        n_chroma=n_chroma,
        fmin=C1 if fmin is None else number("fmin", fmin),
        window=None if weights is None else [float(w) for w in weights],
        threshold=None if threshold is None else number("threshold", threshold),
        norm=None if norm is None else number("norm", norm),
    )
    if C is not None:
        c = floats("C", C, 2)
        return _promoted(unrows(_core.chroma_of_cqt(rows(c, 2), chroma), c, 2), weights)
    if y is None:
        raise ParameterError("y or C is needed")
    y = audio(y)
    if tuning is None:
        tuning = estimate_tuning(y=y, sr=sr, bins_per_octave=bins_per_octave)
    n_bins = size("n_octaves", n_octaves) * bins_per_octave
    room("a folding", n_chroma, n_bins)
    params = _cqt_params(sr, hop_length, fmin, n_bins, bins_per_octave, tuning)
    return _promoted(unrows(_core.chroma_cqt(rows(y, 1), params, chroma), y, 1), weights)


def _promoted(chroma: Floats, weights: Any) -> Floats:
    """A double-precision window makes librosa's folding matrix double, and with it the result."""
    if weights is None:
        return chroma
    promoted: Floats = chroma.astype(np.result_type(chroma, weights.dtype), copy=False)
    return promoted


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
        A chromagram to use instead of `chroma_cqt(y=y, sr=sr, **kwargs)`.
    **kwargs
        Of `chroma_cqt`.

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
            raise ParameterError("y or chroma is needed")
        chroma = chroma_cqt(y=y, sr=sr, **kwargs)
    c = floats("chroma", chroma, 2)
    return unrows(_core.tonnetz(rows(c, 2)), c, 2)


def hpss_masks(S: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Harmonic and percussive mask, stacked.

    Parameters
    ----------
    S : [shape=(..., bins, frames)]
        A spectrogram.
    **kwargs
        See `decompose.hpss`.

    Returns
    -------
    array [shape=(2, ..., bins, frames)]

    Examples
    --------
    >>> corsmal_feat.corsmal.hpss_masks(np.ones((9, 5))).shape
    (2, 9, 5)
    """
    return np.stack(hpss(S, mask=True, **kwargs))


def hpss_mags(S: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Harmonic and percussive part of a spectrogram, stacked.

    Parameters
    ----------
    S : [shape=(..., bins, frames)]
        A spectrogram.
    **kwargs
        See `decompose.hpss`.

    Returns
    -------
    array [shape=(2, ..., bins, frames)]

    Examples
    --------
    >>> corsmal_feat.corsmal.hpss_mags(np.ones((9, 5))).sum(axis=0).max()
    np.float64(1.0)
    """
    return np.stack(hpss(S, **kwargs))


def hpss_audio(y: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Harmonic and percussive part of a signal, stacked.

    Parameters
    ----------
    y : [shape=(..., n)]
        A signal.
    **kwargs
        See `effects.hpss`.

    Returns
    -------
    array [shape=(2, ..., n)]

    Examples
    --------
    >>> corsmal_feat.corsmal.hpss_audio(np.sin(np.arange(4096.0))).shape
    (2, 4096)
    """
    return np.stack(effects_hpss(y, **kwargs))


def abs_cqt(y: npt.ArrayLike, **kwargs: Any) -> Floats:
    """Constant-Q magnitudes.

    Parameters
    ----------
    y : [shape=(..., n)]
        A signal.
    **kwargs
        See `cqt`.

    Returns
    -------
    array [shape=(..., bins, frames)]

    Examples
    --------
    >>> corsmal_feat.corsmal.abs_cqt(np.sin(np.arange(22050.0)), n_bins=24).shape
    (24, 44)
    """
    return np.abs(cqt(y, **kwargs))


def af193(y: npt.ArrayLike, sr: float, *, librosa: str = "0.11") -> Floats:
    """The baseline's vector: means over time of 40 MFCC, 12 chroma, 128 mel, 7 spectral contrast
    and 6 tonnetz rows; leading axes are independent.

    Chroma and contrast take magnitudes (not powers), tonnetz the harmonic part of the signal.

    Parameters
    ----------
    y : [shape=(..., n)]
        A signal.
    sr : float
        Its sample rate in Hz.
    librosa : {"0.11", "0.8"}
        "0.8" gives the published numbers: reflect padding, the constant-Q transform and the end of
        the harmonic part as they were then, in single precision whatever the input.

    Returns
    -------
    array [shape=(..., 193)]

    Examples
    --------
    >>> y = np.sin(np.arange(22050, dtype=np.float32) / 9)
    >>> corsmal_feat.corsmal.af193(y, 22050).shape
    (193,)
    """
    y = audio(y)
    channels = rows(y, 1)
    if y.dtype == np.float32 or librosa != "0.11":
        return unrows(_core.af193(channels.astype(np.float32), number("sr", sr), librosa), y, 1)
    return unrows(np.stack([_af193_composed(channel, sr) for channel in channels]), y, 1)


def _af193_composed(y: Any, sr: float) -> Any:
    """The vector of one channel out of the features that it consists of, in double precision."""
    s = np.abs(stft(y))
    parts = [
        mfcc(y=y, sr=sr, n_mfcc=40),
        chroma_stft(S=s, sr=sr),
        melspectrogram(y=y, sr=sr),
        spectral_contrast(S=s, sr=sr),
        tonnetz(y=harmonic(y), sr=sr),
    ]
    return np.concatenate([part.mean(axis=-1) for part in parts])
