"""Runs over files, what they wrote, and features of signals that arrive in blocks."""

from __future__ import annotations

import json
import os
import tempfile
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import audio
from .errors import ParameterError

__all__ = ["Features", "SignalExtractor", "extract", "load"]

StrPath = str | os.PathLike[str]
Config = StrPath | Mapping[str, Any]
Values = npt.NDArray[Any]


@dataclass(repr=False)
class Features:
    """What a run wrote (see `load`).

    Attributes
    ----------
    ids : ids of the recordings that have features, in the order of the inputs
    arrays : by id the frames [shape=(channels, coefficients, frames)], or by id and then by feature
        where there are several; empty for summaries
    times : for each of them the time of every frame in seconds, arranged alike
    summary : statistics [shape=(len(ids), len(names))], or None
    names : name of each column of `summary`
    labels : by label column of the manifest the text of each of `ids`
    config, config_hash : the whole configuration and its hash
    outcomes : one row for each input, also for those without features: id, path, status, ...
    """

    ids: list[str]
    arrays: dict[str, Any]
    times: dict[str, Any]
    summary: npt.NDArray[np.float32] | None
    names: list[str]
    labels: dict[str, npt.NDArray[np.str_]]
    config: dict[str, Any]
    config_hash: str
    outcomes: list[dict[str, Any]]

    def __repr__(self) -> str:
        failed = len(self.outcomes) - len(self.ids)
        if self.summary is None:
            what = "frames of " + ", ".join(self.config["features"])
        else:
            what = f"summary of {len(self.names)} values"
        return f"<Features: {len(self.ids)} recordings, {failed} failed, {what}>"

    def __len__(self) -> int:
        return len(self.ids)


def load(path: StrPath) -> Features:
    """Reads an output of `extract` or of the command `corsmal-feat extract`, whole.

    `.parquet` needs pyarrow; pandas and polars read such files, too.
    """
    name = os.fspath(path)
    if name.lower().endswith(".parquet"):
        return _load_parquet(name)
    with np.load(name, allow_pickle=False) as archive:
        if "__meta__" not in archive.files:
            raise ParameterError(f"{name} is not an output of corsmal-feat: it has no __meta__")
        run = {k: archive[k] for k in archive.files if not _is_frames(k)}
        frames = {k: archive[k] for k in archive.files if _is_frames(k)}
    ids = [str(i) for i in run["__ids__"]]
    config = json.loads(run["__config__"].tobytes())
    several = len(config["features"]) > 1
    arrays: dict[str, Any] = {}
    times: dict[str, Any] = {}
    for member, values in frames.items():
        key = member.removeprefix("__times__/")
        into = arrays if key == member else times
        if several:
            recording, _, feature = key.rpartition("/")
            into.setdefault(recording, {})[feature] = values
        else:
            into[key] = values
    prefix = "__labels__/"
    return Features(
        ids=ids,
        arrays=arrays,
        times=times,
        summary=run.get("__summary__"),
        names=[str(n) for n in run.get("__summary_names__", ())],
        labels={k.removeprefix(prefix): v for k, v in run.items() if k.startswith(prefix)},
        config=config,
        config_hash=json.loads(run["__meta__"].tobytes())["config_hash"],
        outcomes=_lines(run["__outcomes__"].tobytes()),
    )


def _is_frames(member: str) -> bool:
    return member.startswith("__times__/") or not member.startswith("__")


def _lines(text: str | bytes) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines() if line]


def _load_parquet(name: str) -> Features:
    try:
        parquet = import_module("pyarrow.parquet")
    except ImportError as error:
        raise ImportError(
            f"{name}: reading Parquet needs pyarrow (pip install pyarrow); "
            "pandas.read_parquet and polars.read_parquet give the table, too"
        ) from error
    table = parquet.read_table(name)
    metadata = table.schema.metadata or {}
    if b"corsmal.meta" not in metadata:
        raise ParameterError(f"{name} is not an output of corsmal-feat: it has no corsmal.meta")
    columns = {k: table.column(k).to_numpy() for k in table.column_names if k != "id"}
    names = [k for k, v in columns.items() if v.dtype == np.float32]
    rows = table.num_rows
    summary = np.stack([columns[k] for k in names], axis=1) if names else np.zeros((rows, 0), "f4")
    return Features(
        ids=table.column("id").to_pylist(),
        arrays={},
        times={},
        summary=summary,
        names=names,
        labels={k: v.astype(np.str_) for k, v in columns.items() if k not in names},
        config=json.loads(metadata[b"corsmal.config"]),
        config_hash=json.loads(metadata[b"corsmal.meta"])["config_hash"],
        outcomes=_lines(metadata[b"corsmal.outcomes"]),
    )


def extract(
    paths: StrPath | Iterable[StrPath],
    *,
    preset: str | None = None,
    config: Config | None = None,
    set: Mapping[str, Any] | None = None,
    jobs: int | None = None,
    out: StrPath | None = None,
    resume: bool = False,
    overwrite: bool = False,
) -> Features:
    """Features of recordings, as the command `corsmal-feat extract` computes them.

    Parameters
    ----------
    paths : files, folders, globs and manifests
    preset : name of a configuration that comes with the package; "logmel" by default
    config : instead of a preset a TOML file, TOML text, or the tables as a dict
    set : single keys to change, as {"mfcc.n_mels": 64, "signal.channels": "mean"}
    jobs : worker threads; by default one for each core
    out : where to keep the output, `.npz` or `.parquet`; by default in a temporary file, removed
        once it is loaded
    resume : continue an interrupted run to `out`
    overwrite : replace `out`

    A bad recording is no error: its row of `outcomes` says what is wrong. Ctrl-C stops the run, and
    `resume=True` continues it.

    Raises
    ------
    ParameterError : the configuration is impossible
    RunError : no such recordings, or an output that cannot be written
    """
    chosen, overrides = configuration(preset, config, set)
    names = [paths] if isinstance(paths, str | os.PathLike) else list(paths)
    if not names:
        raise ParameterError("paths = [] is not possible: at least one recording is needed")
    inputs = [os.fspath(name) for name in names]
    if jobs is not None and jobs < 1:
        raise ParameterError(f"jobs = {jobs} is not possible: at least 1")
    if out is not None:
        return _run(inputs, chosen, overrides, os.fspath(out), jobs, resume, overwrite)
    if resume or overwrite:
        raise ParameterError("resume and overwrite need out: nothing is kept without it")
    with tempfile.TemporaryDirectory(prefix="corsmal_feat_") as folder:
        temporary = str(Path(folder, "features.npz"))
        return _run(inputs, chosen, overrides, temporary, jobs, False, False)


def _run(
    inputs: list[str],
    config: tuple[str, str],
    overrides: list[str],
    out: str,
    jobs: int | None,
    resume: bool,
    overwrite: bool,
) -> Features:
    for message in _core.extract(inputs, config, overrides, out, jobs, resume, overwrite):
        warnings.warn(message, stacklevel=3)
    return load(out)


def configuration(
    preset: str | None, config: Config | None, set: Mapping[str, Any] | None
) -> tuple[tuple[str, str], list[str]]:
    """A configuration and its overrides as the Rust side takes them."""
    if preset is not None and config is not None:
        raise ParameterError("preset and config are not possible together: one of them")
    overrides = [f"{key}={_toml(key, value)}" for key, value in (set or {}).items()]
    if config is None:
        return ("preset", preset or "logmel"), overrides
    if isinstance(config, Mapping):
        try:
            return ("json", json.dumps(config, default=_plain)), overrides
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
    raise TypeError(f"{value!r} is not possible: numbers, text, booleans, lists and tables are")


def _toml(key: str, value: Any) -> str:
    """A value as TOML: for what is allowed here its JSON is the same."""
    if value is None or isinstance(value, Mapping):
        raise ParameterError(f"{key} = {value!r} is not possible: a number, text, boolean or list")
    try:
        return json.dumps(value, default=_plain)
    except TypeError as error:
        raise ParameterError(f"{key}: {error}") from error


class SignalExtractor:
    """Features of one signal that arrives in blocks; any split gives the same bits.

    Parameters
    ----------
    sr : sample rate in Hz, a whole number
    channels : channels of every block
    preset, config, set : see `extract`
    """

    def __init__(
        self,
        sr: float,
        channels: int = 1,
        *,
        preset: str | None = None,
        config: Config | None = None,
        set: Mapping[str, Any] | None = None,
    ) -> None:
        signals = _core.Signals(*configuration(preset, config, set))
        self._signal = signals.start(whole_rate(sr), channels)
        self._channels = channels
        #: names of the values of a summary; empty where frames are asked for
        self.names = self._signal.summary_names()

    def push(self, block: Any) -> None:
        """Takes the next samples, float [shape=(channels, n)], or [shape=(n,)] of one channel."""
        samples = interleaved(block)
        if samples.shape[1] != self._channels:
            raise ParameterError(
                f"block has {samples.shape[1]} channels, expected {self._channels}"
            )
        self._signal.push(samples)

    def finish(self) -> Any:
        """The summary [shape=(len(names),)], or by feature its frames
        [shape=(channels, coefficients, frames)]."""
        summary, features = self._signal.finish()
        if summary is not None:
            return summary
        return {
            name: (values.view(np.complex64) if is_complex else values).T
            for name, is_complex, values in features
        }


def whole_rate(sr: Any) -> int:
    """A sample rate as files have it."""
    if sr is None or not 1 <= sr < 2**32 or int(sr) != sr:
        raise ParameterError(f"sr = {sr} is not possible: a whole number of Hz, at least 1")
    return int(sr)


def interleaved(y: Any) -> npt.NDArray[np.float32]:
    """`y` [shape=(n,) or (channels, n)] as [shape=(n, channels)]."""
    samples = np.atleast_2d(audio(y))
    if samples.ndim > 2:
        raise ParameterError(f"y has {samples.ndim} dimensions, expected (n,) or (channels, n)")
    return np.ascontiguousarray(samples.T, dtype=np.float32)
