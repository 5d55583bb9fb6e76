"""AF193, the vector of the CORSMAL baseline."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Floats, audio, number, rows, unrows
from ._chroma import chroma_stft
from ._hpss import harmonic
from ._mel import melspectrogram, mfcc
from ._refusals import refuses
from ._spectral import spectral_contrast
from ._spectrum import stft
from ._tonnetz import tonnetz


@refuses
def af193(y: npt.ArrayLike, sr: float, *, librosa: str = "0.11") -> Floats:
    """The vector of the baseline: means over time of 40 MFCC, 12 chroma, 128 mel, 7 spectral
    contrast and 6 tonnetz rows. Leading axes are independent.

    Chroma and contrast use magnitudes (not powers); tonnetz uses the harmonic part of the signal.

    Parameters
    ----------
    y : [shape=(..., n)]
        Signal.
    sr : float
        Its sample rate in Hz.
    librosa : {"0.11", "0.8"}
        "0.8" reproduces the published numbers: reflect padding, and the constant-Q transform and
        the end of the harmonic part as in that version, always in single precision.

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
    """The vector of one channel, composed of its features in double precision."""
    s = np.abs(stft(y))
    parts = [
        mfcc(y=y, sr=sr, n_mfcc=40),
        chroma_stft(S=s, sr=sr),
        melspectrogram(y=y, sr=sr),
        spectral_contrast(S=s, sr=sr),
        tonnetz(y=harmonic(y), sr=sr),
    ]
    return np.concatenate([part.mean(axis=-1) for part in parts])
