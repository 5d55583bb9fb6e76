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
        "0.8" gives the published numbers: reflect padding, with the constant-Q transform and the
        end of the harmonic part as in that version, in single precision whatever the input.

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
