"""pyAudioAnalysis features, scikit-image resizing, scikit-learn PCA."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Doubles, Floats, as_array, floats, number, room, rows, size, unrows
from ._params import PaaFrames
from ._refusals import refuses
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
    array = as_array(name, value)
    if array.dtype.kind not in "iuf":
        raise ParameterError(f"{name} has dtype {array.dtype}, expected real numbers")
    if array.ndim < ndim or (ndim == 2 and array.ndim != 2):
        raise ParameterError(f"{name} has {array.ndim} dimensions, expected {ndim}")
    return array.astype(np.float64, copy=False)


@refuses
def paa_fbank(sr: float, num_fft: int) -> Doubles:
    """pyAudioAnalysis' mel filters (`mfcc_filter_banks`).

    Parameters
    ----------
    sr : float
        Sample rate in Hz.
    num_fft : int
        Number of bins of a spectrum.

    Returns
    -------
    float64 [shape=(40, num_fft)]

    Examples
    --------
    >>> corsmal_feat.corsmal.paa_fbank(16000, 400).shape
    (40, 400)
    """
    room("filters", 40, size("num_fft", num_fft))
    return _core.paa_fbank(number("sr", sr), int(num_fft))


@refuses
def a34_short(y: npt.ArrayLike, sr: float, window: int, step: int, deltas: bool = True) -> Doubles:
    """pyAudioAnalysis' short-term features (`feature_extraction`).

    Parameters
    ----------
    y : [shape=(..., n)]
        Recordings, 16-bit counts or samples in -1..1. Each is centred and peak-normalised as a
        whole.
    sr : float
        Sample rate in Hz.
    window, step : int
        Samples per frame, and from one frame to the next.
    deltas : bool
        Whether to append the differences from the previous frame to the 34 values.

    Returns
    -------
    float64 [shape=(..., 68 or 34, frames)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 16000)
    >>> corsmal_feat.corsmal.a34_short(y, 16000, 800, 400).shape
    (68, 39)
    """
    y = _doubles("y", y, 1)
    window, step = size("window", window), size("step", step)
    room("filters", 40, window)
    return unrows(_core.a34_short(rows(y, 1), number("sr", sr), window, step, bool(deltas)), y, 1)


@refuses
def a34f136(
    y: npt.ArrayLike, sr: float, mid_window: int, mid_step: int, window: int, step: int
) -> Doubles:
    """Means, then standard deviations, of the 68 short-term features over mid-term windows
    (pyAudioAnalysis' `mid_feature_extraction`).

    Parameters
    ----------
    y : [shape=(..., n)]
        Recordings, 16-bit counts or samples in -1..1. Each is centred and peak-normalised as a
        whole.
    sr : float
        Sample rate in Hz.
    mid_window, mid_step : int
        Samples per mid-term window, and from one window to the next.
    window, step : int
        Samples per frame, and from one frame to the next.

    Returns
    -------
    float64 [shape=(..., 136, windows)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 32000)
    >>> corsmal_feat.corsmal.a34f136(y, 16000, 16000, 16000, 800, 400).shape
    (136, 2)
    """
    y = _doubles("y", y, 1)
    room("filters", 40, size("window", window))
    frames = PaaFrames(
        window=size("window", window),
        step=size("step", step),
        mid_window=size("mid_window", mid_window),
        mid_step=size("mid_step", mid_step),
    )
    return unrows(_core.a34f136(rows(y, 1), number("sr", sr), frames), y, 1)


@refuses
def a34f136_mean(
    y: npt.ArrayLike, sr: float, mid_window: int, mid_step: int, window: int, step: int
) -> Doubles:
    """The vector of a recording: the mean of `a34f136` over its windows.

    Parameters
    ----------
    y : [shape=(..., n)]
        Recordings, 16-bit counts or samples in -1..1. Each is centred and peak-normalised as a
        whole.
    sr : float
        Sample rate in Hz.
    mid_window, mid_step : int
        Samples per mid-term window, and from one window to the next.
    window, step : int
        Samples per frame, and from one frame to the next.

    Returns
    -------
    float64 [shape=(..., 136)]

    Examples
    --------
    >>> y = np.random.default_rng(0).uniform(-0.5, 0.5, 32000)
    >>> corsmal_feat.corsmal.a34f136_mean(y, 16000, 16000, 16000, 800, 400).shape
    (136,)
    """
    return np.asarray(a34f136(y, sr, mid_window, mid_step, window, step).mean(axis=-1))


@refuses
def sk_resize(
    S: npt.ArrayLike,
    shape: tuple[int, int],
    *,
    mode: str = "reflect",
    anti_aliasing: bool | None = None,
) -> Floats:
    """Resizes a matrix, like scikit-image's `transform.resize` with linear interpolation.

    Parameters
    ----------
    S : [shape=(rows, columns)]
        The matrix.
    shape : (int, int)
        Rows and columns of the result.
    mode : str
        How to extend the matrix at its edges: "reflect", "constant", "edge", "symmetric" or "wrap".
    anti_aliasing : bool, optional
        Whether to smooth with a Gaussian first; by default, if an axis shrinks.

    Returns
    -------
    array [shape=shape]

    Examples
    --------
    >>> corsmal_feat.corsmal.sk_resize(np.eye(4), (2, 2), anti_aliasing=False).tolist()
    [[0.5, 0.0], [0.0, 0.5]]
    """
    s = floats("S", S, 2)
    if s.ndim != 2 or len(shape) != 2:
        raise ParameterError(
            f"S has {s.ndim} dimensions and shape has {len(shape)} values, expected 2 of each"
        )
    height, width = size("shape", shape[0]), size("shape", shape[1])
    room("an image", 4, height + s.shape[0], width + s.shape[1])
    return _core.sk_resize(
        rows(s, 1), height, width, mode, None if anti_aliasing is None else bool(anti_aliasing)
    )


@refuses
def pca_fit(X: npt.ArrayLike, n_components: int) -> Doubles:
    """Fits principal components. The rows of the result are the components, the column means and
    the explained variances (padded with zeros). The largest entry of each component is positive.

    Parameters
    ----------
    X : [shape=(rows, columns)]
        The data.
    n_components : int
        Number of components.

    Returns
    -------
    float64 [shape=(n_components + 2, columns)]

    Examples
    --------
    >>> x = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    >>> corsmal_feat.corsmal.pca_fit(x, 1).round(6).tolist()
    [[1.0, 0.0], [2.0, 0.0], [4.0, 0.0]]
    """
    components, mean, variance = _fit(X, n_components)
    padded = np.zeros_like(mean)
    padded[: len(variance)] = variance
    return np.vstack([components, mean, padded])


@refuses
def pca_fit_transform(X: npt.ArrayLike, n_components: int) -> Doubles:
    """Fits principal components and returns the coordinates of the same data.

    To project other data, use `pca_fit` and `pca_project`: fitting again on test data gives
    coordinates that are unrelated to those of the training data.

    Parameters
    ----------
    X : [shape=(rows, columns)]
        The data.
    n_components : int
        Number of components.

    Returns
    -------
    float64 [shape=(rows, n_components)]

    Examples
    --------
    >>> x = np.array([[0.0, 0.0], [2.0, 0.0], [4.0, 0.0]])
    >>> corsmal_feat.corsmal.pca_fit_transform(x, 1).ravel().tolist()
    [-2.0, 0.0, 2.0]
    """
    components, mean, _ = _fit(X, n_components)
    return pca_project(X, components, mean)


@refuses
def pca_project(
    X: npt.ArrayLike,
    components: npt.ArrayLike,
    mean: npt.ArrayLike,
    variance: npt.ArrayLike | None = None,
    whiten: bool = False,
) -> Doubles:
    """Projects data on fitted principal components.

    Parameters
    ----------
    X : [shape=(rows, columns)]
        The data.
    components : [shape=(k, columns)]
        Directions of unit length.
    mean : [shape=(columns,)]
        Column means, which are subtracted first.
    variance : [shape=(k,)], optional
        Variance along each component; needed with `whiten=True`.
    whiten : bool
        Whether to divide each coordinate by its standard deviation; without any, it is 0.

    Returns
    -------
    float64 [shape=(rows, k)]

    Examples
    --------
    >>> corsmal_feat.corsmal.pca_project([[3.0, 5.0]], [[1.0, 0.0]], [1.0, 1.0]).tolist()
    [[2.0]]
    """
    if whiten and variance is None:
        raise ParameterError("whiten=True needs variance")
    x = np.ascontiguousarray(_doubles("X", X, 2))
    components = np.ascontiguousarray(_doubles("components", components, 2))
    scale = _doubles("variance", variance, 1).ravel().tolist() if whiten else None
    return _core.pca_project(x, components, _doubles("mean", mean, 1).ravel().tolist(), scale)


@refuses
def fit_projection(
    features: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    n_components: int | None = None,
    overwrite: bool = False,
) -> None:
    """Fits principal components to the summary in a file of `extract` (training recordings only)
    and writes them as an .npz with `components`, `mean` and `explained_variance`.

    The configuration key `projection.file` applies the file to other recordings; features of
    another configuration are refused.

    Parameters
    ----------
    features : path
        Output of `extract` with a summary.
    out : path
        The file to write.
    n_components : int, optional
        Number of components; by default 128, or as many as the rows and features allow.
    overwrite : bool
        Whether to replace `out` if it exists.

    Examples
    --------
    >>> corsmal_feat.corsmal.fit_projection("features.npz", "projection.npz", n_components=4)
    >>> np.load("projection.npz")["components"].shape
    (4, 26)
    """
    if not overwrite and os.path.exists(out):
        raise ParameterError(f"out = {os.fspath(out)!r} already exists: overwrite=True replaces it")
    wanted = None if n_components is None else size("n_components", n_components)
    _core.fit_projection(features, wanted, out)


def _fit(X: Any, n_components: int) -> tuple[Doubles, Doubles, Doubles]:
    x = np.ascontiguousarray(_doubles("X", X, 2))
    components, mean, variance = _core.pca_fit(x, size("n_components", n_components))
    return components, mean, variance
