"""Chromagram of a constant-Q transform (librosa.feature.chroma_cqt)."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, as_array, audio, floats, number, room, rows, size, unrows
from ._cqt import C1, cqt_params
from ._params import CqtChromaParams
from ._pitch import estimate_tuning
from ._refusals import refuses
from .errors import ParameterError


@refuses
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
    window: npt.ArrayLike | None = None,
    bins_per_octave: int | None = 36,
    cqt_mode: str = "full",
) -> Floats:
    """Chromagram of a constant-Q transform (librosa.feature.chroma_cqt).

    Parameters
    ----------
    y : float32 or float64 [shape=(..., n)], optional
        Signal at the sample rate `sr` in Hz.
    C : [shape=(..., d, t)], optional
        Constant-Q magnitudes to use instead of `y`.
    hop_length, fmin, tuning
        See `cqt`; by default, the tuning is estimated.
    norm : float, optional
        Norm by which each frame is divided; None for none.
    threshold : float, optional
        Smaller values are set to zero.
    n_chroma, n_octaves, bins_per_octave : int
        Number of pitch classes and of octaves, and bins per octave (None: `n_chroma`).
    window : [shape=(any,)], optional
        Weights of neighbouring bins.
    cqt_mode : {"full"}
        librosa's other modes are not available.

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
    weights = None if window is None else as_array("window", window).ravel()
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
        raise ParameterError("y or C must be given")
    y = audio(y)
    if tuning is None:
        tuning = estimate_tuning(y=y, sr=sr, bins_per_octave=bins_per_octave)
    n_bins = size("n_octaves", n_octaves) * bins_per_octave
    room("a folding", n_chroma, n_bins)
    params = cqt_params(sr, hop_length, fmin, n_bins, bins_per_octave, tuning)
    return _promoted(unrows(_core.chroma_cqt(rows(y, 1), params, chroma), y, 1), weights)


def _promoted(chroma: Floats, weights: Any) -> Floats:
    """The result in double precision if the window is, as librosa's folding matrix is then."""
    if weights is None:
        return chroma
    promoted: Floats = chroma.astype(np.result_type(chroma, weights.dtype), copy=False)
    return promoted
