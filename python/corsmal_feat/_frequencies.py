"""Frequencies of the bins of transforms, mel bands and tempograms."""

from __future__ import annotations

import numpy as np

from ._arrays import size
from ._pitches import hz_to_mel, mel_to_hz
from ._refusals import refuses
from ._times import Doubles
from .errors import ParameterError

#: Longest table of frequencies; bounds the memory that a number from the caller can take.
_MOST_BINS = 1 << 26


def _count(name: str, value: int) -> int:
    if not 0 <= value <= _MOST_BINS:
        raise ParameterError(f"{name} must be 0 to {_MOST_BINS}, not {value}")
    return size(name, value, 0)


@refuses
def fft_frequencies(*, sr: float = 22050, n_fft: int = 2048) -> Doubles:
    """Frequencies of the bins of `stft` (librosa.fft_frequencies).

    Parameters
    ----------
    sr : float
        Sample rate in Hz.
    n_fft : int
        Length of the transform.

    Returns
    -------
    Hz, float64 [shape=(1 + n_fft // 2,)]

    Examples
    --------
    >>> corsmal_feat.fft_frequencies(sr=8000, n_fft=4)
    array([   0., 2000., 4000.])
    """
    if not sr > 0 or not 0 < n_fft <= _MOST_BINS:
        raise ParameterError(
            f"sr must be above 0 and n_fft 1 to {_MOST_BINS}, not {sr} and {n_fft}"
        )
    return np.asarray(np.fft.rfftfreq(size("n_fft", n_fft), 1.0 / sr), dtype=np.float64)


@refuses
def cqt_frequencies(
    n_bins: int, *, fmin: float, bins_per_octave: int = 12, tuning: float = 0.0
) -> Doubles:
    """Centre frequencies of the bins of `cqt` (librosa.cqt_frequencies).

    Parameters
    ----------
    n_bins : int
        Number of bins.
    fmin : float
        Frequency of the lowest bin in Hz.
    bins_per_octave : int
        Bins per octave.
    tuning : float
        Deviation from A440 in fractions of a bin.

    Returns
    -------
    Hz, float64 [shape=(n_bins,)]

    Examples
    --------
    >>> corsmal_feat.cqt_frequencies(3, fmin=110, bins_per_octave=1)
    array([110., 220., 440.])
    """
    steps = np.arange(0, _count("n_bins", n_bins), dtype=np.float64) / bins_per_octave
    correction: float = 2.0 ** (float(tuning) / bins_per_octave)
    return np.asarray(correction * fmin * 2.0**steps)


@refuses
def mel_frequencies(
    n_mels: int = 128, *, fmin: float = 0.0, fmax: float = 11025.0, htk: bool = False
) -> Doubles:
    """Frequencies that are evenly spaced on the mel scale (librosa.mel_frequencies).

    Parameters
    ----------
    n_mels : int
        Number of frequencies.
    fmin, fmax : float
        Lowest and highest frequency in Hz.
    htk : bool
        Whether to use HTK's mel scale instead of Slaney's.

    Returns
    -------
    Hz, float64 [shape=(n_mels,)]

    Examples
    --------
    >>> corsmal_feat.mel_frequencies(3, fmin=0, fmax=1000)
    array([   0.,  500., 1000.])
    """
    low, high = hz_to_mel(fmin, htk=htk), hz_to_mel(fmax, htk=htk)
    return mel_to_hz(np.linspace(low, high, _count("n_mels", n_mels)), htk=htk)


@refuses
def tempo_frequencies(n_bins: int, *, hop_length: int = 512, sr: float = 22050) -> Doubles:
    """Tempi of the rows of a tempogram (librosa.tempo_frequencies).

    Parameters
    ----------
    n_bins : int
        Number of rows.
    hop_length : int
        Samples between frames.
    sr : float
        Sample rate in Hz.

    Returns
    -------
    beats per minute, float64 [shape=(n_bins,)]; the first one is infinite

    Examples
    --------
    >>> corsmal_feat.tempo_frequencies(3, hop_length=500, sr=1000)
    array([ inf, 120.,  60.])
    """
    count = _count("n_bins", n_bins)
    if count == 0:
        raise ParameterError("n_bins must be at least 1, not 0")
    tempi = 60.0 * sr / (size("hop_length", hop_length) * np.arange(1.0, count))
    return np.concatenate([[np.inf], tempi])


@refuses
def fourier_tempo_frequencies(
    *, sr: float = 22050, win_length: int = 384, hop_length: int = 512
) -> Doubles:
    """Tempi of the rows of a Fourier tempogram (librosa.fourier_tempo_frequencies).

    Parameters
    ----------
    sr : float
        Sample rate in Hz.
    win_length : int
        Length of the analysis window in frames.
    hop_length : int
        Samples between frames.

    Returns
    -------
    beats per minute, float64 [shape=(win_length // 2 + 1,)]

    Examples
    --------
    >>> corsmal_feat.fourier_tempo_frequencies(sr=1000, win_length=4, hop_length=500)
    array([ 0., 30., 60.])
    """
    return fft_frequencies(sr=sr * 60 / size("hop_length", hop_length), n_fft=win_length)
