"""Features of the rows of Arrow tables, as columns."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _core
from ._batch_columns import Flags, Singles, arrow, nested, no_rows, scalars, vectors
from ._batch_rows import BYTES, ID, PATH, PLACE, require_stores, rows_of
from ._computation import Computation, stamp_of
from ._extract import Config, StrPath, configuration
from ._features import GOOD
from ._model import TrainedModel
from .errors import ModelError, ParameterError

#: Columns of the outcome, as in the ledger of a run.
_OUTCOME = {
    "path": "string",
    "status": "string",
    "reason": "string",
    "byte_offset": "int64",
    "start_frame": "int64",
    "declared_frames": "int64",
    "decoded_frames": "int64",
    "sample_rate": "int64",
    "channels": "int64",
    "identity": "string",
}
_REPAIRS, _LIST, _PREDICTED = "repairs", "features", "predicted"


def failed_batch(
    batch: Any,
    status: str,
    reason: str,
    *,
    config: Config,
    model: StrPath | None,
    summary: str,
    channels: int | None,
) -> Any:
    """Rows for recordings that are not read at all, as `extract_batch` would return them."""
    job = Job.of(None, config, None, None, model, summary, None, channels)
    return job.failed(batch, status, reason)


@dataclass(frozen=True)
class Job:
    """What is computed for every row, and in which columns."""

    computation: Computation
    model: TrainedModel | None
    as_list: bool
    channels: int | None

    @classmethod
    def of(
        cls,
        preset: str | None,
        config: Config | None,
        set: Any,
        projection: StrPath | None,
        model: StrPath | None,
        summary: str,
        frames: str | None,
        channels: int | None,
    ) -> Job:
        """Checks the arguments; keeps what takes long to make."""
        if summary not in ("columns", "list"):
            raise ParameterError(f"summary must be 'columns' or 'list', not {summary!r}")
        if frames not in (None, "list"):
            raise ParameterError(f"frames must be 'list' or None, not {frames!r}")
        if frames and not (projection is None and model is None):
            raise ParameterError("projection and model need statistics: leave out frames")
        if channels is not None and not 1 <= channels <= 64:
            raise ParameterError(f"channels must be 1 to 64, not {channels}")
        trained = None if model is None else _model(model)
        if trained is not None and preset is None and config is None:
            if not trained.feature_config:
                raise ModelError(
                    f"{model} holds no feature configuration, so it cannot predict recordings: save"
                    " it with save(path, features=...)"
                )
            config = trained.feature_config
        changes = dict(set or {})
        if projection is not None:
            changes["projection.file"] = os.fspath(projection)
        chosen, overrides = configuration(preset, config, changes)
        computation = Computation.of(chosen, overrides)
        if frames:
            tree = json.loads(computation.config) | {"summary": None}
            computation = Computation.of(*configuration(None, tree, None))
        if trained is not None and computation.config_hash != trained.header["feature_config_hash"]:
            raise ModelError(
                f"{model} was trained on features of another configuration: leave out preset,"
                " config and set to use its own"
            )
        return cls(computation, trained, summary == "list", channels)

    def extract(self, batch: Any, jobs: int) -> Any:
        """Computes a batch."""
        extract = self.computation.recordings.extract
        rows = rows_of(batch)
        require_stores(rows)
        lines, names, values, frames = extract(rows, self.channels, jobs)
        outcomes = [json.loads(line) for line in lines.splitlines()]
        _keep_paths(batch, outcomes)
        return self._assemble(batch, outcomes, names, values, frames)

    def require_pieces(self) -> None:
        """Refuses configurations that cannot be computed on pieces of recordings."""
        reason = self.computation.recordings.piece_refusal()
        if reason is not None:
            raise ParameterError(f"recordings cannot be cut into pieces: {reason}")

    def failed(self, batch: Any, status: str, reason: str) -> Any:
        """Rows for recordings that are not read at all."""
        _, names, values, _ = self.computation.recordings.extract([], self.channels, 1)
        outcomes: list[dict[str, Any]] = [
            {"id": row[0], "status": status, "reason": reason, "repairs": []}
            for row in rows_of(batch)
        ]
        _keep_paths(batch, outcomes)
        return self._assemble(batch, outcomes, names, values, [None] * len(outcomes))

    def _assemble(
        self,
        batch: Any,
        outcomes: list[dict[str, Any]],
        names: list[str],
        values: Singles,
        frames: list[list[Singles] | None],
    ) -> Any:
        pa = arrow()
        columns = {ID: pa.array([row["id"] for row in outcomes], pa.string())}
        for name in batch.schema.names:
            if name not in (ID, PATH, BYTES, *PLACE):
                columns[name] = batch.column(name)
        predictions = self._predictions(outcomes, names, values)
        has_features = np.array([row["status"] in GOOD for row in outcomes], dtype=bool)
        if predictions is not None:
            values = values[predictions[0]]
        new = {
            name: pa.array([row.get(name) for row in outcomes], getattr(pa, kind)())
            for name, kind in _OUTCOME.items()
        }
        new[_REPAIRS] = pa.array([row["repairs"] for row in outcomes], pa.list_(pa.string()))
        if self.computation.features:
            for i, name in enumerate(self.computation.features):
                new[name] = nested([None if row is None else row[i] for row in frames])
        elif self.as_list:
            new[_LIST] = vectors(values, has_features)
        else:
            new |= dict(zip(names, scalars(values, has_features), strict=True))
        if predictions is not None:
            new |= predictions[1]
        taken = [name for name in new if name in columns]
        if taken:
            raise ParameterError(
                f"the label column {taken[0]!r} has the same name as an output column: rename it"
            )
        config_hash = self.computation.config_hash
        meta = {"tool_version": _core.__version__, "config_hash": config_hash}
        metadata = {"corsmal.meta": json.dumps(meta), "corsmal.config": self.computation.config}
        if self.as_list:
            metadata["corsmal.names"] = json.dumps(names)
        table = pa.Table.from_pydict(columns | new).replace_schema_metadata(metadata)
        if isinstance(batch, pa.Table):
            return table
        return table.combine_chunks().to_batches()[0] if table.num_rows else no_rows(table.schema)

    def _predictions(
        self, outcomes: list[dict[str, Any]], names: list[str], values: Singles
    ) -> tuple[Flags, dict[str, Any]] | None:
        """Which rows of `values` the model accepts, and the columns of its predictions. The outcome
        of a row that it does not accept becomes a mismatch."""
        if self.model is None:
            return None
        pa, model = arrow(), self.model
        known = model.header["feature_names"]
        if len(names) == len(known) and names != known:
            at = next(i for i, (a, b) in enumerate(zip(names, known, strict=True)) if a != b)
            raise ModelError(f"feature {at} must be {known[at]}, as in training, not {names[at]}")
        good = [row for row in outcomes if row["status"] in GOOD]
        taken = np.zeros(len(good), dtype=bool)
        for i, row in enumerate(good):
            reason = model.refusal(row["sample_rate"], row["channels"])
            if reason is None and len(names) != len(known):
                reason = f"gives {len(names)} features; the model was trained on {len(known)}"
            if reason is None and not np.isfinite(values[i]).all():
                row |= {"status": "non_finite", "reason": "features that are not finite"}
            elif reason is not None:
                row |= {"status": "mismatch", "reason": reason}
            else:
                taken[i] = True
        places = np.flatnonzero([row["status"] in GOOD for row in outcomes])
        rows = values[taken].astype(np.float64)
        predicted: list[Any] = [None] * len(outcomes)
        if len(places):
            for place, label in zip(places, model.predict(rows), strict=True):
                predicted[place] = str(label)
        columns = {_PREDICTED: pa.array(predicted, pa.string())}
        if model.has_probabilities():
            shape = (len(outcomes), len(model.classes_))
            proba = np.full(shape, np.nan)
            if len(places):
                proba[places] = model.predict_proba(rows)
            for label, column in zip(model.classes_, proba.T, strict=True):
                columns[f"p_{label}"] = pa.array(column, mask=np.isnan(column))
        return taken, columns


_models: dict[str, tuple[tuple[int, int], TrainedModel]] = {}


def _model(path: StrPath) -> TrainedModel:
    """A model file, read again only if it has changed."""
    name = os.fspath(path)
    stamp = stamp_of(name)
    if stamp is None:
        raise ModelError(f"{name}: no such file")
    if name not in _models or _models[name][0] != stamp:
        _models[name] = (stamp, TrainedModel(name))
    return _models[name][1]


def _keep_paths(batch: Any, outcomes: list[dict[str, Any]]) -> None:
    """Gives outcomes the paths as given, but without the query of a web address, which may be a
    signature. Content in memory has no path."""
    given = [None] * len(outcomes)
    if PATH in batch.schema.names:
        given = batch.column(PATH).to_pylist()
    for row, path in zip(outcomes, given, strict=True):
        row["path"] = None if path is None else _core.shown(path)
