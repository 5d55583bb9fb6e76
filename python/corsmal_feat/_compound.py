"""pyAudioAnalysis features, scikit-image resizing, scikit-learn PCA."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from . import _core
from ._arrays import Doubles, floats, rows, unrows
from .errors import ParameterError

__all__ = [
    "a34_short",
    "a34f136",
    "a34f136_mean",
    "fit_projection",
    "paa_fbank",
    "pca_fit",
    "pca_fit_transform",
    "pca_project",
    "sk_resize",
]


def _doubles(name: str, value: Any, ndim: int) -> Doubles:
    """`value` in double precision, with at least `ndim` dimensions (exactly two for a matrix)."""
    array = np.asarray(value)
    if array.dtype.kind not in "iuf":
        raise ParameterError(f"{name} has dtype {array.dtype}, expected real numbers")
    if array.ndim < ndim or (ndim == 2 and array.ndim != 2):
        raise ParameterError(f"{name} has {array.ndim} dimensions, expected {ndim}")
    return array.astype(np.float64, copy=False)


def paa_fbank(sr: float, num_fft: int) -> Doubles:
    """pyAudioAnalysis' mel filters [shape=(40, num_fft)] (`mfcc_filter_banks`)."""
    return _core.paa_fbank(float(sr), int(num_fft))


def a34_short(y: Any, sr: float, window: int, step: int, deltas: bool = True) -> Doubles:
    """pyAudioAnalysis' short-term features [shape=(..., 68 or 34, frames)] of recordings `y`
    [shape=(..., n)], 16-bit counts or samples in -1..1 (`feature_extraction`).

    Each recording is centred and peak-normalised as a whole. `window` and `step` are in samples.
    """
    y = _doubles("y", y, 1)
    frame = (int(window), int(step))
    return unrows(_core.a34_short(rows(y, 1), float(sr), frame, bool(deltas)), y, 1)


def a34f136(y: Any, sr: float, mid_window: int, mid_step: int, window: int, step: int) -> Doubles:
    """Means, then standard deviations of the 68 short-term features over mid-term windows
    [shape=(..., 136, windows)] (pyAudioAnalysis `mid_feature_extraction`). All in samples."""
    y = _doubles("y", y, 1)
    mid, frame = (int(mid_window), int(mid_step)), (int(window), int(step))
    return unrows(_core.a34f136(rows(y, 1), float(sr), mid, frame), y, 1)


def a34f136_mean(
    y: Any, sr: float, mid_window: int, mid_step: int, window: int, step: int
) -> Doubles:
    """The vector of a recording [shape=(..., 136)]: the mean of `a34f136` over its windows."""
    return np.asarray(a34f136(y, sr, mid_window, mid_step, window, step).mean(axis=-1))


def sk_resize(
    S: Any,
    shape: tuple[int, int],
    *,
    mode: str = "reflect",
    anti_aliasing: bool | None = None,
) -> Any:
    """`S` [shape=(rows, columns)] at another size, as scikit-image's `transform.resize` with linear
    interpolation; Gaussian smoothing first if an axis shrinks."""
    s = floats("S", S, 2)
    if s.ndim != 2 or len(shape) != 2:
        raise ParameterError(f"S has {s.ndim} dimensions and shape {len(shape)}, expected 2 and 2")
    size = (int(shape[0]), int(shape[1]))
    return _core.sk_resize(rows(s, 1), size, mode, anti_aliasing)


def pca_fit(X: Any, n_components: int) -> Doubles:
    """Principal components of `X` [shape=(rows, columns)] in one matrix
    [shape=(n_components + 2, columns)]: the components, the column means, the explained variances
    (padded with zeros). The largest entry of each component is positive."""
    components, mean, variance = _fit(X, n_components)
    padded = np.zeros_like(mean)
    padded[: len(variance)] = variance
    return np.vstack([components, mean, padded])


def pca_fit_transform(X: Any, n_components: int) -> Doubles:
    """Coordinates [shape=(rows, n_components)] of the very data that the components are fitted to.

    For other data project on the fitted components: fitting them again on test data gives
    coordinates that have nothing to do with those of the training data.
    """
    components, mean, _ = _fit(X, n_components)
    return pca_project(X, components, mean)


def pca_project(
    X: Any, components: Any, mean: Any, variance: Any = None, whiten: bool = False
) -> Doubles:
    """`X` [shape=(rows, columns)] on fitted components [shape=(k, columns)], each coordinate
    divided by its standard deviation if `whiten`."""
    if whiten and variance is None:
        raise ParameterError("variance = None is not possible with whiten=True")
    x = np.ascontiguousarray(_doubles("X", X, 2))
    components = np.ascontiguousarray(_doubles("components", components, 2))
    scale = _doubles("variance", variance, 1).ravel().tolist() if whiten else None
    return _core.pca_project(x, components, _doubles("mean", mean, 1).ravel().tolist(), scale)


def fit_projection(
    features: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    n_components: int = 128,
    overwrite: bool = False,
) -> None:
    """Fits principal components to the summary in a file of `extract` (training recordings only)
    and writes them to `out`, an .npz with `components`, `mean` and `explained_variance`.

    The configuration key `projection.file` applies the file to other recordings, of whose features
    it accepts no other configuration.
    """
    if not overwrite and os.path.exists(out):
        raise ParameterError(f"out = {os.fspath(out)!r} exists: overwrite=True replaces it")
    _core.fit_projection(features, int(n_components), out)


def _fit(X: Any, n_components: int) -> tuple[Doubles, Doubles, Doubles]:
    x = np.ascontiguousarray(_doubles("X", X, 2))
    components, mean, variance = _core.pca_fit(x, int(n_components))
    return components, mean, variance
