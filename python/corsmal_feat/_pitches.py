"""Hertz, mel, octaves, notes and tuning (librosa.core.convert)."""

from __future__ import annotations

import re
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from ._refusals import refuses
from ._times import Doubles, Number
from .errors import ParameterError

#: Slaney's scale is linear below 1000 Hz (3 mel in 200 Hz) and logarithmic above.
_MEL_HZ = 200.0 / 3
_BREAK_HZ = 1000.0
_BREAK_MEL = _BREAK_HZ / _MEL_HZ
_LOG_STEP = np.log(6.4) / 27.0


@overload
def hz_to_mel(frequencies: Number, *, htk: bool = False) -> np.float64: ...
@overload
def hz_to_mel(frequencies: npt.ArrayLike, *, htk: bool = False) -> Doubles: ...
@refuses
def hz_to_mel(frequencies: npt.ArrayLike, *, htk: bool = False) -> Any:
    """Hertz to mel (librosa.hz_to_mel).

    Parameters
    ----------
    frequencies : number or [shape=(n,)]
        Hz.
    htk : bool
        Whether to use HTK's formula instead of Slaney's.

    Returns
    -------
    mel, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.hz_to_mel([200.0, 1000.0])
    array([ 3., 15.])
    """
    hz = np.asanyarray(frequencies)
    if htk:
        return 2595.0 * np.log10(1.0 + hz / 700.0)
    mel = hz / _MEL_HZ
    above = hz >= _BREAK_HZ
    if hz.ndim:
        mel[above] = _BREAK_MEL + np.log(hz[above] / _BREAK_HZ) / _LOG_STEP
    elif above:
        mel = _BREAK_MEL + np.log(hz / _BREAK_HZ) / _LOG_STEP
    return mel


@overload
def mel_to_hz(mels: Number, *, htk: bool = False) -> np.float64: ...
@overload
def mel_to_hz(mels: npt.ArrayLike, *, htk: bool = False) -> Doubles: ...
@refuses
def mel_to_hz(mels: npt.ArrayLike, *, htk: bool = False) -> Any:
    """Mel to hertz (librosa.mel_to_hz).

    Parameters
    ----------
    mels : number or [shape=(n,)]
        Mel.
    htk : bool
        Whether to use HTK's formula instead of Slaney's.

    Returns
    -------
    Hz, in the shape of `mels`

    Examples
    --------
    >>> corsmal_feat.mel_to_hz([3, 15])
    array([ 200., 1000.])
    """
    mel = np.asanyarray(mels)
    if htk:
        return 700.0 * (10.0 ** (mel / 2595.0) - 1.0)
    hz = _MEL_HZ * mel
    above = mel >= _BREAK_MEL
    if mel.ndim:
        hz[above] = _BREAK_HZ * np.exp(_LOG_STEP * (mel[above] - _BREAK_MEL))
    elif above:
        hz = _BREAK_HZ * np.exp(_LOG_STEP * (mel - _BREAK_MEL))
    return hz


@overload
def hz_to_midi(frequencies: Number) -> np.float64: ...
@overload
def hz_to_midi(frequencies: npt.ArrayLike) -> Doubles: ...
@refuses
def hz_to_midi(frequencies: npt.ArrayLike) -> Any:
    """Hertz to MIDI note numbers with fractions (librosa.hz_to_midi).

    Parameters
    ----------
    frequencies : number or [shape=(n,)]
        Hz.

    Returns
    -------
    note numbers, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.hz_to_midi([440.0, 880.0])
    array([69., 81.])
    """
    return 12 * (np.log2(np.asanyarray(frequencies)) - np.log2(440.0)) + 69


@overload
def midi_to_hz(notes: Number) -> np.float64: ...
@overload
def midi_to_hz(notes: npt.ArrayLike) -> Doubles: ...
@refuses
def midi_to_hz(notes: npt.ArrayLike) -> Any:
    """MIDI note numbers to hertz (librosa.midi_to_hz).

    Parameters
    ----------
    notes : number or [shape=(n,)]
        Note numbers, fractions allowed.

    Returns
    -------
    Hz, in the shape of `notes`

    Examples
    --------
    >>> corsmal_feat.midi_to_hz([57, 69])
    array([220., 440.])
    """
    return 440.0 * (2.0 ** ((np.asanyarray(notes) - 69.0) / 12.0))


@overload
def hz_to_octs(
    frequencies: Number, *, tuning: float = 0.0, bins_per_octave: int = 12
) -> np.float64: ...
@overload
def hz_to_octs(
    frequencies: npt.ArrayLike, *, tuning: float = 0.0, bins_per_octave: int = 12
) -> Doubles: ...
@refuses
def hz_to_octs(
    frequencies: npt.ArrayLike, *, tuning: float = 0.0, bins_per_octave: int = 12
) -> Any:
    """Hertz to octaves; A0 is 0 (librosa.hz_to_octs).

    Parameters
    ----------
    frequencies : number or [shape=(n,)]
        Hz.
    tuning : float
        Deviation from A440 in fractions of a bin.
    bins_per_octave : int
        Bins per octave.

    Returns
    -------
    octaves, in the shape of `frequencies`

    Examples
    --------
    >>> corsmal_feat.hz_to_octs([27.5, 440.0])
    array([0., 4.])
    """
    return np.log2(np.asanyarray(frequencies) / (_a440(tuning, bins_per_octave) / 16))


@overload
def octs_to_hz(octs: Number, *, tuning: float = 0.0, bins_per_octave: int = 12) -> np.float64: ...
@overload
def octs_to_hz(
    octs: npt.ArrayLike, *, tuning: float = 0.0, bins_per_octave: int = 12
) -> Doubles: ...
@refuses
def octs_to_hz(octs: npt.ArrayLike, *, tuning: float = 0.0, bins_per_octave: int = 12) -> Any:
    """Octaves to hertz (librosa.octs_to_hz).

    Parameters
    ----------
    octs : number or [shape=(n,)]
        Octaves; A0 is 0.
    tuning, bins_per_octave
        See `hz_to_octs`.

    Returns
    -------
    Hz, in the shape of `octs`

    Examples
    --------
    >>> corsmal_feat.octs_to_hz([0, 4])
    array([ 27.5, 440. ])
    """
    return (_a440(tuning, bins_per_octave) / 16) * (2.0 ** np.asanyarray(octs))


def _a440(tuning: float, bins_per_octave: int) -> float:
    return float(440.0 * 2.0 ** (tuning / bins_per_octave))


@overload
def A4_to_tuning(A4: Number, *, bins_per_octave: int = 12) -> np.float64: ...
@overload
def A4_to_tuning(A4: npt.ArrayLike, *, bins_per_octave: int = 12) -> Doubles: ...
@refuses
def A4_to_tuning(A4: npt.ArrayLike, *, bins_per_octave: int = 12) -> Any:
    """Frequency of A4 to tuning (librosa.A4_to_tuning).

    Parameters
    ----------
    A4 : number or [shape=(n,)]
        Hz.
    bins_per_octave : int
        Bins per octave.

    Returns
    -------
    deviations from A440 in fractions of a bin, in the shape of `A4`

    Examples
    --------
    >>> corsmal_feat.A4_to_tuning([440.0, 880.0])
    array([ 0., 12.])
    """
    return bins_per_octave * (np.log2(np.asanyarray(A4)) - np.log2(440.0))


@overload
def tuning_to_A4(tuning: Number, *, bins_per_octave: int = 12) -> np.float64: ...
@overload
def tuning_to_A4(tuning: npt.ArrayLike, *, bins_per_octave: int = 12) -> Doubles: ...
@refuses
def tuning_to_A4(tuning: npt.ArrayLike, *, bins_per_octave: int = 12) -> Any:
    """Tuning to frequency of A4 (librosa.tuning_to_A4).

    Parameters
    ----------
    tuning : number or [shape=(n,)]
        Deviation from A440 in fractions of a bin.
    bins_per_octave : int
        Bins per octave.

    Returns
    -------
    Hz, in the shape of `tuning`

    Examples
    --------
    >>> corsmal_feat.tuning_to_A4([0.0, 12.0])
    array([440., 880.])
    """
    return 440.0 * 2.0 ** (np.asanyarray(tuning) / bins_per_octave)


#: several note names
Names = list[str] | tuple[str, ...] | npt.NDArray[Any]

_NOTE = re.compile(
    r"(?P<note>[A-Ga-g])(?P<accidental>[#♯𝄪b!♭𝄫♮]*)(?P<octave>[+-]?\d+)?(?P<cents>[+-]\d+)?$"
)
_PITCHES = {"C": 0, "D": 2, "E": 4, "F": 5, "G": 7, "A": 9, "B": 11}
_ACCIDENTALS = {"#": 1, "♯": 1, "𝄪": 2, "b": -1, "!": -1, "♭": -1, "𝄫": -2, "♮": 0}


@overload
def note_to_midi(note: str, *, round_midi: bool = True) -> float: ...
@overload
def note_to_midi(note: Names, *, round_midi: bool = True) -> npt.NDArray[Any]: ...
@refuses
def note_to_midi(note: str | Names, *, round_midi: bool = True) -> Any:
    """Note names to MIDI note numbers (librosa.note_to_midi).

    Parameters
    ----------
    note : str or iterable of str
        Such as "C4", "A#3", "B!3" (a flat) or "C4-32" (cents). A missing octave is 0.
    round_midi : bool
        Whether to round to whole numbers; otherwise, cents are kept.

    Returns
    -------
    a number, or an array of them

    Examples
    --------
    >>> corsmal_feat.note_to_midi(["A4", "C#4"])
    array([69, 61])
    """
    if not isinstance(note, str):
        if np.ndim(note) == 0:
            raise ParameterError(f"note must be a string or a sequence of strings, not {note!r}")
        return np.array([note_to_midi(one, round_midi=round_midi) for one in note])
    found = _NOTE.match(note)
    if found is None:
        raise ParameterError(f"note must be a name such as 'C4' or 'F#3+20', not {note!r}")
    shift = sum(_ACCIDENTALS[sign] for sign in found["accidental"])
    octave, cents = int(found["octave"] or 0), int(found["cents"] or 0)
    value = 12 * (octave + 1) + _PITCHES[found["note"].upper()] + shift + cents * 0.01
    return int(np.round(value)) if round_midi else value


@overload
def note_to_hz(note: str, *, round_midi: bool = True) -> np.float64: ...
@overload
def note_to_hz(note: Names, *, round_midi: bool = True) -> Doubles: ...
@refuses
def note_to_hz(note: str | Names, *, round_midi: bool = True) -> Any:
    """Note names to hertz (librosa.note_to_hz).

    Parameters
    ----------
    note, round_midi
        See `note_to_midi`.

    Returns
    -------
    Hz: a number, or an array of them

    Examples
    --------
    >>> corsmal_feat.note_to_hz("A3")
    np.float64(220.0)
    """
    return midi_to_hz(note_to_midi(note, round_midi=round_midi))
