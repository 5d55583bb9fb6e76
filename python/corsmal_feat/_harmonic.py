"""Inverse STFT, harmonic-percussive separation, constant-Q features and AF193."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import audio, floats, rows, unrows
from ._chroma import chroma_stft
from ._mel import melspectrogram, mfcc
from ._pitch import estimate_tuning
from ._spectral import spectral_contrast
from .errors import ParameterError
from .filters import window_name
from .spectrum import stft, stft_params, warn_short

C1 = 440.0 * 2.0 ** ((24.0 - 69.0) / 12.0)

HpssParams = tuple[int, int, float, float, float]
CqtParams = tuple[float, int, float, int, int, float, float, float | None, float, str, bool, str]
CqtChromaParams = tuple[int, int, float, list[float] | None, float | None, float | None]


def _pair(value: Any) -> tuple[Any, Any]:
    """A value for the harmonic and one for the percussive side."""
    if isinstance(value, tuple | list):
        if len(value) < 2:
            raise ParameterError(f"{value!r} is not possible: a number or a pair")
        return value[0], value[1]
    return value, value


def _hpss_params(kernel_size: Any, power: float, margin: Any) -> HpssParams:
    kernels, margins = _pair(kernel_size), _pair(margin)
    if any(kernel < 1 for kernel in kernels):
        raise ParameterError(f"kernel_size = {kernel_size} is not possible: at least 1")
    return int(kernels[0]), int(kernels[1]), float(power), float(margins[0]), float(margins[1])


def istft(
    stft_matrix: Any,
    *,
    hop_length: int | None = None,
    win_length: int | None = None,
    n_fft: int | None = None,
    window: Any = "hann",
    center: bool = True,
    dtype: npt.DTypeLike | None = None,
    length: int | None = None,
    out: Any = None,
) -> Any:
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
    y = _core.istft(np.ascontiguousarray(d.reshape(-1, *d.shape[-2:])), params, length or None)
    y = y.reshape(*d.shape[:-2], y.shape[-1])
    if dtype is not None:
        y = y.astype(dtype, copy=False)
    if out is None:
        return y
    if out.shape != y.shape:
        raise ParameterError(f"out has shape {out.shape}, expected {y.shape}")
    out[...] = y
    return out


def hpss(
    S: Any,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
) -> tuple[Any, Any]:
    """Harmonic and percussive part, or mask, of a spectrogram [shape=(..., d, n)], real or complex
    (librosa.decompose.hpss).

    An axis of two values is filtered as defined; scipy 1.17 reads beyond such rows.
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
) -> list[Any]:
    """The asked ones of the harmonic and the percussive part."""
    y = audio(y)
    stft_tuple = stft_params(n_fft, hop_length, win_length, "hann", center, pad_mode)
    params = _hpss_params(kernel_size, power, margin)
    warn_short(y, n_fft, stacklevel=3)
    separated = _core.separate(rows(y, 1), stft_tuple, params, bool(mask), *parts)
    return [unrows(part, y, 1) for part in separated]


def effects_hpss(
    y: Any,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> tuple[Any, Any]:
    """Harmonic and percussive part of `y` [shape=(..., n)] (librosa.effects.hpss).

    `window` is ignored, as in librosa: both transforms take a Hann window.
    """
    harmonic, percussive = _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (True, True),
    )  # fmt: skip
    return harmonic, percussive


def harmonic(
    y: Any,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Any:
    """Harmonic part of `y` [shape=(..., n)] (librosa.effects.harmonic); `window` is ignored."""
    return _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (True, False),
    )[0]  # fmt: skip


def percussive(
    y: Any,
    *,
    kernel_size: int | Sequence[int] = 31,
    power: float = 2.0,
    mask: bool = False,
    margin: float | Sequence[float] = 1.0,
    n_fft: int = 2048,
    hop_length: int | None = None,
    win_length: int | None = None,
    window: Any = "hann",
    center: bool = True,
    pad_mode: str = "constant",
) -> Any:
    """Percussive part of `y` [shape=(..., n)] (librosa.effects.percussive); `window` is ignored."""
    return _separate(
        y, kernel_size, power, mask, margin, n_fft, hop_length, win_length, center, pad_mode,
        (False, True),
    )[0]  # fmt: skip


def _positive(name: str, value: int) -> int:
    if value < 1:
        raise ParameterError(f"{name} = {value} is not possible: at least 1")
    return int(value)


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
    window: Any = "hann",
    scale: bool = True,
    pad_mode: str = "constant",
) -> CqtParams:
    return (
        float(sr),
        _positive("hop_length", hop_length),
        C1 if fmin is None else float(fmin),
        _positive("n_bins", n_bins),
        _positive("bins_per_octave", bins_per_octave),
        float(tuning),
        float(filter_scale),
        None if norm is None else float(norm),
        float(sparsity),
        window_name(window),
        bool(scale),
        str(pad_mode),
    )


def cqt(
    y: Any,
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
    window: Any = "hann",
    scale: bool = True,
    pad_mode: str = "constant",
    res_type: str | None = "soxr_hq",
    dtype: npt.DTypeLike | None = None,
) -> Any:
    """Constant-Q transform [shape=(..., n_bins, t)] of `y` [shape=(..., n)] (librosa.cqt).

    `tuning=None` estimates one for all channels. The octaves are decimated by a filter equal to
    soxr's "HQ" to 1e-6; no other `res_type` exists here.
    """
    y = audio(y)
    if res_type is None:
        warnings.warn("res_type=None stands for 'soxr_hq'", FutureWarning, stacklevel=2)
    elif res_type != "soxr_hq":
        raise ParameterError(f"res_type = {res_type!r} is not possible: 'soxr_hq'")
    if tuning is None:
        tuning = estimate_tuning(y=y, sr=sr, bins_per_octave=bins_per_octave)
    params = _cqt_params(
        sr, hop_length, fmin, n_bins, bins_per_octave, tuning, filter_scale, norm, sparsity,
        window, scale, pad_mode,
    )  # fmt: skip
    result = unrows(_core.cqt(rows(y, 1), params), y, 1)
    return result if dtype is None else result.astype(dtype, copy=False)


def chroma_cqt(
    *,
    y: Any = None,
    sr: float = 22050,
    C: Any = None,
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
) -> Any:
    """Chromagram [shape=(..., n_chroma, t)] of the constant-Q transform of `y`, or of constant-Q
    magnitudes `C` (librosa.feature.chroma_cqt). Only `cqt_mode="full"` exists here."""
    if cqt_mode != "full":
        raise ParameterError(f"cqt_mode = {cqt_mode!r} is not possible: 'full'")
    n_chroma = _positive("n_chroma", n_chroma)
    bins_per_octave = n_chroma if bins_per_octave is None else bins_per_octave
    bins_per_octave = _positive("bins_per_octave", bins_per_octave)
    weights = None if window is None else np.ravel(window)
    chroma = (
        bins_per_octave,
        n_chroma,
        C1 if fmin is None else float(fmin),
        None if weights is None else [float(w) for w in weights],
        None if threshold is None else float(threshold),
        None if norm is None else float(norm),
    )
    if C is not None:
        c = floats("C", C, 2)
        return _promoted(unrows(_core.chroma_of_cqt(rows(c, 2), chroma), c, 2), weights)
    if y is None:
        raise ParameterError("y or C is needed")
    y = audio(y)
    if tuning is None:
        tuning = estimate_tuning(y=y, sr=sr, bins_per_octave=bins_per_octave)
    n_bins = _positive("n_octaves", n_octaves) * bins_per_octave
    params = _cqt_params(sr, hop_length, fmin, n_bins, bins_per_octave, tuning)
    return _promoted(unrows(_core.chroma_cqt(rows(y, 1), params, chroma), y, 1), weights)


def _promoted(chroma: Any, weights: Any) -> Any:
    """A double-precision window makes librosa's folding matrix double, and with it the result."""
    if weights is None:
        return chroma
    return chroma.astype(np.result_type(chroma, weights.dtype), copy=False)


def tonnetz(*, y: Any = None, sr: float = 22050, chroma: Any = None, **kwargs: Any) -> Any:
    """Tonal centroids [shape=(..., 6, t)] of a chromagram, by default of
    `chroma_cqt(y=y, **kwargs)` (librosa.feature.tonnetz)."""
    if chroma is None:
        if y is None:
            raise ParameterError("y or chroma is needed")
        chroma = chroma_cqt(y=y, sr=sr, **kwargs)
    c = floats("chroma", chroma, 2)
    return unrows(_core.tonnetz(rows(c, 2)), c, 2)


def hpss_masks(S: Any, **kwargs: Any) -> Any:
    """Harmonic and percussive mask, stacked (see `decompose.hpss`)."""
    return np.stack(hpss(S, mask=True, **kwargs))


def hpss_mags(S: Any, **kwargs: Any) -> Any:
    """Harmonic and percussive part of a spectrogram, stacked (see `decompose.hpss`)."""
    return np.stack(hpss(S, **kwargs))


def hpss_audio(y: Any, **kwargs: Any) -> Any:
    """Harmonic and percussive part of a signal, stacked (see `effects.hpss`)."""
    return np.stack(effects_hpss(y, **kwargs))


def abs_cqt(y: Any, **kwargs: Any) -> Any:
    """Constant-Q magnitudes (see `cqt`)."""
    return np.abs(cqt(y, **kwargs))


def af193(y: Any, sr: float, *, librosa: str = "0.11") -> Any:
    """The baseline's vector [shape=(..., 193)] of `y` [shape=(..., n)]: means over time of 40 MFCC,
    12 chroma, 128 mel, 7 spectral contrast and 6 tonnetz rows; leading axes are independent.

    Chroma and contrast take magnitudes (not powers), tonnetz the harmonic part of the signal.
    `librosa="0.8"` gives the published numbers: reflect padding, the constant-Q transform and the
    end of the harmonic part as they were then, in single precision whatever the input.
    """
    y = audio(y)
    channels = rows(y, 1)
    if y.dtype == np.float32 or librosa != "0.11":
        return unrows(_core.af193(channels.astype(np.float32), float(sr), librosa), y, 1)
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
