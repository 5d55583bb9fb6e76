"""Runs over files, and features of signals that arrive in blocks."""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import audio, size
from ._features import Features, load_features
from ._refusals import refuses
from ._warnings import warn
from .errors import DataTypeError, ParameterError

StrPath = str | os.PathLike[str]
Config = StrPath | Mapping[str, Any]
Progress = Callable[[int, int], object]

#: Most channels of a recording.
MAX_CHANNELS = 64
#: Most worker threads.
MOST_JOBS = 4096


@refuses
def extract(
    paths: StrPath | Iterable[StrPath],
    *,
    preset: str | None = None,
    config: Config | None = None,
    set: Mapping[str, Any] | None = None,
    window: float | None = None,
    hop: float | None = None,
    jobs: int | None = None,
    out: StrPath | None = None,
    work: StrPath | None = None,
    partition_by: str | None = None,
    resume: bool = False,
    overwrite: bool = False,
    progress: bool | Progress = False,
) -> Features:
    """Extracts features of recordings, as the command `corsmal-feat extract` does.

    Parameters
    ----------
    paths : files, folders, globs and manifests
    preset : name of a configuration that comes with the package; "logmel" by default
    config : instead of a preset, a TOML file, TOML text, or the tables as a dict
    set : single keys to change, such as {"mfcc.n_mels": 64, "signal.channels": "mean"}
    window : seconds; recordings are cut into windows of this length, each with a row or arrays of
        its own. The label "recording" has the id of the recording
    hop : seconds from the start of one window to the start of the next; half a window by default
    jobs : worker threads; by default one per core
    out : where to write the output, `.npz` or `.parquet`, a file or an object in a store
        ("s3://bucket/features.npz"); by default a temporary file, which is removed once it is
        loaded
    work : folder in which an output for a store is made, so that `resume` can continue it; by
        default the current folder
    partition_by : label that divides `out`, which is then a folder with a file
        `label=value/part.parquet` for each value of the label
    resume : continue an interrupted run to `out`, with `overwrite` also one that replaces it
    overwrite : replace `out`
    progress : True shows on standard error how many recordings are done; a function is called with
        this number and the total

    A bad recording raises no error: its row of `outcomes` says what is wrong. Ctrl-C stops the run,
    and `resume=True` continues it.

    Returns
    -------
    Features
        The arrays of an output in a store are all read into memory, unlike with the command.

    Examples
    --------
    >>> features = corsmal_feat.extract(["audio/"], preset="mfcc-zcr")
    >>> features.summary.shape, features.ids[:2]
    ((12, 42), ['rice/0', 'rice/1'])

    Raises
    ------
    ParameterError : the configuration or a parameter is wrong
    RunError : the recordings do not exist, or the output cannot be written
    """
    chosen, overrides = configuration(preset, config, set)
    names = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if not names:
        raise ParameterError("paths must name at least one recording")
    inputs = [os.fspath(name) for name in names]
    jobs = None if jobs is None else size("jobs", jobs)
    if jobs is not None and jobs > MOST_JOBS:
        raise ParameterError(f"jobs must be 1 to {MOST_JOBS}, not {jobs}")
    if window is None and hop is not None:
        raise ParameterError("hop needs window: the length of the windows in seconds")
    span = None
    if window is not None:
        length = float(window)
        span = (length, length / 2 if hop is None else float(hop))
    if out is not None:
        places = (os.fspath(out), None if work is None else os.fspath(work), partition_by)
        return _run(inputs, chosen, overrides, span, places, jobs, resume, overwrite, progress)
    if resume or overwrite or work is not None or partition_by is not None:
        raise ParameterError(
            "resume, overwrite, work and partition_by need out: nothing is kept without it"
        )
    with tempfile.TemporaryDirectory(prefix="corsmal_feat_") as folder:
        temporary = str(Path(folder, "features.npz"))
        places = (temporary, None, None)
        features = _run(inputs, chosen, overrides, span, places, jobs, False, False, progress)
        # The file goes with its folder.
        features.arrays, features.times = dict(features.arrays), dict(features.times)
        return features


def _run(
    inputs: list[str],
    config: tuple[str, str],
    overrides: list[str],
    window: tuple[float, float] | None,
    places: tuple[str, str | None, str | None],
    jobs: int | None,
    resume: bool,
    overwrite: bool,
    progress: bool | Progress,
) -> Features:
    tell: Progress | None = progress if callable(progress) else None
    if not callable(progress) and progress not in (None, False, True):
        raise ParameterError(f"progress must be True, False or a function, not {progress!r}")
    if progress in (True,):
        tell = _to_stderr
    found = _core.extract(inputs, config, overrides, window, places, jobs, resume, overwrite, tell)
    if tell is _to_stderr:
        print(file=sys.stderr)
    for message in found:
        warn(message)
    return load_features(places[0])


def _to_stderr(done: int, total: int) -> None:
    print(f"\r{done} of {total} recordings", end="", file=sys.stderr, flush=True)


def configuration(
    preset: str | None, config: Config | None, set: Mapping[str, Any] | None
) -> tuple[tuple[str, str], list[str]]:
    """A configuration and its overrides in the form that the Rust side takes."""
    if preset is not None and config is not None:
        raise ParameterError("give either preset or config, not both")
    overrides = [f"{key}={_toml(key, value)}" for key, value in (set or {}).items()]
    if config is None:
        return ("preset", preset or "logmel"), overrides
    if isinstance(config, Mapping):
        try:
            return ("json", _json(config)), overrides
        except TypeError as error:
            raise ParameterError(f"config: {error}") from error
    text = os.fspath(config)
    # TOML text has an assignment or a table in it; a path to a file may, too, but then it exists.
    is_text = isinstance(config, str) and ("\n" in text or "=" in text) and not _exists(text)
    return ("toml" if is_text else "path", text), overrides


def _exists(text: str) -> bool:
    return "\n" not in text and os.path.exists(text)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise TypeError(f"expected numbers, strings, booleans, lists or mappings, not {value!r}")


def _toml(key: str, value: Any) -> str:
    """A value as TOML, which for the types allowed here is the same as JSON."""
    if value is None or isinstance(value, Mapping):
        raise ParameterError(f"{key} must be a number, string, boolean or list, not {value!r}")
    try:
        return _json(value)
    except TypeError as error:
        raise ParameterError(f"{key}: {error}") from error


def _json(value: Any) -> str:
    """JSON, in which infinity is the word that configurations have for it."""
    return json.dumps(_worded(json.loads(json.dumps(value, default=_plain))))


def _worded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _worded(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_worded(inner) for inner in value]
    return "inf" if value == float("inf") else value


class SignalExtractor:
    """Extracts features of one signal that arrives in blocks; any split gives the same bits.

    Parameters
    ----------
    sr : sample rate in Hz, a whole number
    channels : number of channels of every block
    preset, config, set : see `extract`

    Examples
    --------
    >>> signal = corsmal_feat.SignalExtractor(44100, channels=8, preset="mfcc-zcr")
    >>> for _ in range(10):
    ...     signal.push(np.zeros((8, 4410), np.float32))
    >>> signal.finish().shape
    (336,)
    """

    @refuses
    def __init__(
        self,
        sr: float,
        channels: int = 1,
        *,
        preset: str | None = None,
        config: Config | None = None,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        if not 1 <= channels <= MAX_CHANNELS or channels != int(channels):
            raise ParameterError(f"channels must be 1 to {MAX_CHANNELS}, not {channels}")
        signals = _core.Signals(*configuration(preset, config, set))
        self._signal = signals.start(whole_rate(sr), channels)
        self._channels = channels
        #: names of the values of a summary; empty where frames are asked for
        self.names = self._signal.summary_names()

    @refuses
    def push(self, block: npt.ArrayLike) -> None:
        """Takes the next samples, float [shape=(channels, n)], or [shape=(n,)] for one channel."""
        samples = interleaved(block)
        if samples.shape[1] != self._channels:
            turned = len(samples) == self._channels
            hint = f" [shape=({self._channels}, n)]: transpose it" if turned else ""
            raise ParameterError(
                f"block has {samples.shape[1]} channels, expected {self._channels}{hint}"
            )
        self._signal.push(samples)

    def __reduce__(self) -> NoReturn:
        raise DataTypeError("a SignalExtractor cannot be copied or pickled: make another one")

    def finish(self) -> npt.NDArray[np.float32] | dict[str, npt.NDArray[Any]]:
        """The summary [shape=(len(names),)], or a dict of the frames of each feature
        [shape=(channels, coefficients, frames)]."""
        summary, features = self._signal.finish()
        if summary is not None:
            return summary
        return {
            name: (values.view(np.complex64) if is_complex else values).T
            for name, is_complex, values in features
        }


def whole_rate(sr: Any) -> int:
    """A sample rate as files store it."""
    if sr is None or not 1 <= sr < 2**32 or int(sr) != sr:
        raise ParameterError(f"sr must be a whole number of at least 1 Hz, not {sr}")
    return int(sr)


def interleaved(y: Any) -> npt.NDArray[np.float32]:
    """`y` [shape=(n,) or (channels, n)] as [shape=(n, channels)]."""
    samples = np.atleast_2d(audio(y))
    if samples.ndim > 2:
        raise ParameterError(f"y has {samples.ndim} dimensions, expected (n,) or (channels, n)")
    with np.errstate(over="ignore"):
        narrow = np.ascontiguousarray(samples.T, dtype=np.float32)
    if samples.dtype == np.float64:
        # What overflows was finite, and is too loud.
        beyond = np.isinf(narrow)
        narrow[beyond] = np.copysign(np.finfo(np.float32).max, narrow[beyond])
    return narrow
