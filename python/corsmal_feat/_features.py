"""The output of a run."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from html import escape
from importlib import import_module
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from . import _core
from ._features_npz import of_npz
from ._features_parquet import of_parquet, of_partitions
from ._fingerprints import Fingerprints, fingerprints
from ._refusals import refuses
from .errors import ParameterError, UnknownIdError

StrPath = str | os.PathLike[str]
Values = npt.NDArray[Any]

#: Statuses of recordings that have features.
GOOD = ("ok", "truncated")


def lengths(outcomes: list[dict[str, Any]]) -> list[tuple[str, float]]:
    """Path and seconds of the recordings that have features, as far as they are known."""
    good = [row for row in outcomes if row["status"] in GOOD and row.get("sample_rate")]
    return [(row["path"], row["decoded_frames"] / row["sample_rate"]) for row in good]


@dataclass(repr=False, eq=False)
class Features:
    """The output of a run (see `load_features`).

    `features[id]` gives the row of a summary, or the frames of a recording: an array
    [shape=(channels, coefficients, frames)] or, if there are several features, a dict of one array
    per feature.

    Attributes
    ----------
    ids : list of str
        Ids of the recordings that have features, in the order of the inputs.
    arrays : dict
        Frames by id, and then by feature if there are several; empty for summaries.
    times : dict
        Time of every frame in seconds, arranged like `arrays`.
    summary : float32 [shape=(len(ids), len(names))], or None
        Statistics of each recording.
    names : list of str
        Name of each column of `summary`.
    labels : dict
        Values of each label column of the manifest, in the order of `ids`.
    config, config_hash : dict, str
        Full configuration and its hash.
    outcomes : list of dict
        One row per input, including those without features: id, path, status, ...; those without
        features keep their labels here.

    Examples
    --------
    >>> features = corsmal_feat.Features.load("features.npz")
    >>> len(features), features.ids[0], features.outcomes[0]["status"]
    (12, 'rice/0', 'ok')
    >>> features["rice/0"].shape
    (26,)
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

    @classmethod
    @refuses
    def load(cls, path: StrPath) -> Self:
        """Reads an output of `extract` or of the command `corsmal-feat extract`; the frames of an
        `.npz` are read when you access them.

        Parameters
        ----------
        path : path
            `.npz`, or `.parquet` (needs pyarrow), or the folder of a partitioned output.

        Returns
        -------
        Features
        """
        name = os.fspath(path)
        if os.path.isdir(name):
            return cls(**of_partitions(name))
        with open(name, "rb") as file:
            parquet = file.read(4) == b"PAR1"
        return cls(**(of_parquet(name) if parquet else of_npz(name)))

    def __repr__(self) -> str:
        # A table that another program wrote again has no outcomes.
        failed = "outcomes unknown"
        if self.outcomes:
            failed = f"{len(self.outcomes) - len(self.ids)} failed"
        return f"<Features: {len(self.ids)} recordings, {failed}, {self._what()}>"

    def _what(self) -> str:
        if not self.ids:
            return "no features"
        if self.summary is None:
            return "frames of " + ", ".join(self.config["features"])
        return f"summary of {len(self.names)} values"

    def _repr_html_(self) -> str:
        """The outcomes as a table, for notebooks; if there are many, the first ones."""
        shown = self.outcomes[:20]
        rows = "".join(
            "<tr>" + "".join(f"<td>{escape(str(row.get(k, '')))}</td>" for k in _COLUMNS) + "</tr>"
            for row in shown
        )
        head = "".join(f"<th>{k}</th>" for k in _COLUMNS)
        left = len(self.outcomes) - len(shown)
        more = f"<p>{left} more</p>" if left else ""
        return f"<p>{escape(repr(self)[1:-1])}</p><table><tr>{head}</tr>{rows}</table>{more}"

    def __len__(self) -> int:
        return len(self.ids)

    def __iter__(self) -> Iterator[str]:
        return iter(self.ids)

    def __contains__(self, recording: object) -> bool:
        try:
            return recording in self._rows
        except TypeError:  # lists, slices
            return False

    @cached_property
    def _rows(self) -> dict[object, int]:
        """The position of each id."""
        return {recording: row for row, recording in enumerate(self.ids)}

    def __getitem__(self, recording: str) -> Any:
        if recording not in self:
            near = isinstance(recording, str)
            close = [i for i in self.ids if near and (recording in i or i in recording)][:3]
            hint = f"; did you mean {', '.join(map(repr, close))}?" if close else ""
            raise UnknownIdError(
                f"none of the {len(self.ids)} recordings has the id {recording!r}{hint}"
            )
        if self.summary is None and recording in self.arrays:
            return self.arrays[recording]
        if self.summary is None:
            # A recording may be too short for any frame.
            return {} if len(self.config["features"]) > 1 else np.empty((0, 0, 0), np.float32)
        return self.summary[self._rows[recording]]

    def to_frame(self) -> Any:
        """The features as a pandas data frame with index (file, start, end), as in opensmile.

        A summary has one row per recording; frames have one row per frame. Columns have the names
        of the summary, or are called `feature[channel][coefficient]`; label columns follow.

        Returns
        -------
        pandas.DataFrame
        """
        try:
            pandas = import_module("pandas")
        except ImportError as error:
            raise ImportError("to_frame needs pandas (pip install pandas)") from error
        paths = {row["id"]: row["path"] for row in self.outcomes}
        files = [paths.get(i, i) for i in self.ids]
        if self.summary is not None:
            starts = self._starts()
            ends = starts + self._durations()
            counts = [1] * len(files)
            columns = dict(zip(self.names, self.summary.T, strict=True))
        else:
            tables = [self._columns(i) for i in self.ids]
            counts = [len(times) for times, _ in tables]
            names = list(dict.fromkeys(name for _, table in tables for name in table))
            columns = {
                name: np.concatenate([table.get(name, _missing(len(t))) for t, table in tables])
                for name in names
            }
            offsets = np.repeat(self._starts(), counts)
            starts = np.concatenate([t for t, _ in tables]) if tables else np.zeros(0)
            starts = starts + offsets
            steps = [np.diff(t, append=_next(t)) for t, _ in tables]
            ends = starts + (np.concatenate(steps) if steps else np.zeros(0))
        columns |= {k: np.repeat(np.asarray(v), counts) for k, v in self.labels.items()}
        index = pandas.MultiIndex.from_arrays(
            [
                np.repeat(np.asarray(files, dtype=object), counts),
                pandas.to_timedelta(starts, unit="s"),
                pandas.to_timedelta(ends, unit="s"),
            ],
            names=["file", "start", "end"],
        )
        return pandas.DataFrame(columns, index=index)

    def _made_of(self) -> dict[str, Any]:
        """What a model file says about features."""
        if self.summary is None:
            raise ParameterError("features holds frames, but a model needs rows of a summary")
        if not self.config:
            raise ParameterError(
                "features has no configuration, because another program rewrote the table: pass the"
                " table that corsmal_feat wrote"
            )
        if (wanted := self._names_of_recordings()) not in (None, self.names):
            raise ParameterError(
                f"features has {len(self.names)} columns, expected the {len(wanted or ())} that its"
                " configuration gives, in that order: otherwise the model cannot predict"
                " recordings; fit on all columns as corsmal_feat wrote them"
            )
        return {
            "feature_names": self.names,
            "feature_config": self.config,
            "feature_config_hash": self.config_hash,
            "formats": [
                (row.get("sample_rate"), row.get("channels"))
                for row in self.outcomes
                if row["status"] in GOOD
            ],
            "seconds": [seconds for _, seconds in lengths(self.outcomes)],
        }

    def _fingerprints(self) -> Fingerprints:
        """Those of the rows of the summary."""
        return fingerprints(np.zeros((0, 0)) if self.summary is None else self.summary)

    def _names_of_recordings(self) -> list[str] | None:
        """The names of the columns for recordings like these, if the format of one is known."""
        row = next((row for row in self.outcomes if row["status"] in GOOD), None)
        if row is None or not row.get("sample_rate"):
            return None
        signals = _core.Signals(("json", json.dumps(self.config)), [])
        return signals.start(row["sample_rate"], row["channels"]).summary_names()

    def _durations(self) -> npt.NDArray[np.float64]:
        rows = {row["id"]: row for row in self.outcomes}

        def seconds(recording: str) -> float:
            row = rows.get(recording, {})
            rate = row.get("sample_rate")
            return row["decoded_frames"] / rate if rate else np.nan

        return np.array([seconds(i) for i in self.ids], dtype=np.float64)

    def _starts(self) -> npt.NDArray[np.float64]:
        """Where each row begins in its recording, in seconds."""
        of_all = float(self.config.get("signal", {}).get("start", 0.0))
        rows = {row["id"]: row for row in self.outcomes}

        def seconds(recording: str) -> float:
            row = rows.get(recording, {})
            start, rate = row.get("start_frame"), row.get("sample_rate")
            return start / rate if start is not None and rate else of_all

        return np.array([seconds(i) for i in self.ids], dtype=np.float64)

    def _columns(self, recording: str) -> tuple[Values, dict[str, Values]]:
        """Times and named columns of the frames of a recording; a feature with another number of
        frames than the first one cannot share its rows."""
        arrays, times = self[recording], self.times.get(recording, np.zeros(0))
        if not isinstance(arrays, dict):
            arrays, times = {next(iter(self.config["features"])): arrays}, {None: times}
        shared = next(iter(times.values()), np.zeros(0))
        columns = {}
        for feature, values in arrays.items():
            if values.shape[-1] != len(shared):
                raise ParameterError(
                    f"{recording}: {feature} has {values.shape[-1]} frames, but the first feature"
                    f" has {len(shared)}: to_frame needs features with the same hop"
                )
            for c, k in np.ndindex(values.shape[:2]):
                columns[f"{feature}[{c}][{k}]"] = values[c, k]
        return shared, columns


def _missing(count: int) -> Values:
    return np.full(count, np.nan, dtype=np.float32)


def _next(times: Values) -> Values:
    """The time at which the frame after the last one would begin."""
    return times[-1:] + (times[-1:] - times[-2:-1] if len(times) > 1 else 0)


_COLUMNS = ("id", "status", "reason", "sample_rate", "channels", "decoded_frames")


@refuses
def load_features(path: StrPath) -> Features:
    """Reads an output of `extract` or of the command `corsmal-feat extract`.

    The frames of a recording in an `.npz` are read when you first access them, and then kept: do
    not change the file before.

    Parameters
    ----------
    path : path
        `.npz`, or `.parquet` (needs pyarrow; pandas and polars read such files, too); the folder
        of a partitioned output; or an object in a store, "s3://bucket/features.npz", which is read
        into memory.

    Returns
    -------
    Features

    Examples
    --------
    >>> features = corsmal_feat.load_features("features.npz")
    >>> features
    <Features: 12 recordings, 0 failed, summary of 26 values>
    >>> features["water/3"].shape
    (26,)
    """
    name = os.fspath(path)
    if not _core.is_stored(name):
        return Features.load(path)
    with tempfile.TemporaryDirectory(prefix="corsmal_feat_") as folder:
        copy = os.path.join(folder, "features")
        _core.fetch(name, copy)
        features = Features.load(copy)
        # The file goes with its folder.
        features.arrays, features.times = dict(features.arrays), dict(features.times)
        return features
