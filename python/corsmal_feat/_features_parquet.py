"""Outputs in Parquet files."""

from __future__ import annotations

import json
import math
from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

from ._warnings import warn
from .errors import ParameterError

Values = npt.NDArray[Any]


def _is_text(types: Any, kind: Any) -> bool:
    kind = kind.value_type if types.is_dictionary(kind) else kind
    return bool(types.is_string(kind) or types.is_large_string(kind))


def _is_statistic(column: str) -> bool:
    """Whether a column is called as values of a summary are: `mfcc[0].mean`, `rms.std`."""
    return "[" in column or "." in column


def _ids(name: str, column: list[Any]) -> list[str]:
    ids: dict[str, int] = {}
    for row, value in enumerate(column):
        if value is None:
            raise ParameterError(f"{name}: row {row} has no id")
        if str(value) in ids:
            raise ParameterError(
                f"{name}: rows {ids[str(value)]} and {row} have the same id, {str(value)!r}"
            )
        ids[str(value)] = row
    return list(ids)


def of_parquet(name: str) -> dict[str, Any]:
    """The fields of `Features` of a Parquet file."""
    try:
        parquet = import_module("pyarrow.parquet")
        failed = import_module("pyarrow").ArrowInvalid
    except ImportError as error:
        raise ImportError(
            f"{name}: reading Parquet needs pyarrow (pip install pyarrow); "
            "pandas.read_parquet and polars.read_parquet give the table, too"
        ) from error
    try:
        table = parquet.read_table(name)
    except failed as error:
        raise ParameterError(f"{name} is not a readable Parquet file: {error}") from error
    metadata = table.schema.metadata or {}
    if "id" not in table.column_names:
        raise ParameterError(f"{name} is not an output of corsmal-feat: it has no column id")
    config = json.loads(metadata.get(b"corsmal.config", b"{}"))
    frames = [k for k in config.get("features", ()) if _holds_frames(table.schema, k)]
    types = import_module("pyarrow").types
    columns: dict[str, Values] = {}
    names: list[str] = []
    for field in table.schema:
        if field.name in {"id", *frames} or field.name.startswith("__"):
            continue
        whole = types.is_integer(field.type)
        # pandas makes a column of whole values one of integers; ours have such names.
        if types.is_floating(field.type) or (whole and _is_statistic(field.name)):
            names.append(field.name)
            columns[field.name] = table.column(field.name).to_numpy()
        elif whole or types.is_boolean(field.type) or _is_text(types, field.type):
            texts = ["" if v is None else str(v) for v in table.column(field.name).to_pylist()]
            columns[field.name] = np.asarray(texts, dtype=np.str_)
        else:
            warn(f"{name}: the column {field.name} is left out: it holds {field.type}")
    ids = _ids(name, table.column("id").to_pylist())
    rows = np.zeros((len(ids), 0), np.float32)
    if names:
        rows = np.stack([columns[k] for k in names], axis=1).astype(np.float32)
    outcomes = metadata.get(b"corsmal.outcomes", b"").splitlines()
    meta = json.loads(metadata.get(b"corsmal.meta", b"{}"))
    return {
        "ids": ids,
        "arrays": _lists(name, table, ids, {k: k for k in frames}),
        "times": _lists(name, table, ids, {k: f"__times__/{k}" for k in frames}),
        "summary": None if frames else rows,
        "names": names,
        "labels": {k: v for k, v in columns.items() if k not in names},
        "config": config,
        "config_hash": meta.get("config_hash", ""),
        "outcomes": [json.loads(line) for line in outcomes if line],
    }


def _holds_frames(schema: Any, feature: str) -> bool:
    pair = (feature, f"__times__/{feature}")
    return all(k in schema.names and schema.field(k).type.num_fields == 1 for k in pair)


def _lists(file: str, table: Any, ids: list[str], columns: dict[str, str]) -> dict[str, Any]:
    """Arrays by id, and then by feature where there are several, of columns of nested lists."""
    found: dict[str, Any] = {}
    for feature, name in columns.items():
        rows = (row for chunk in table.column(name).chunks for row in chunk)
        for recording, row in zip(ids, rows, strict=True):
            if not row.is_valid or not len(row.values):
                continue  # too short for any frame: as in an .npz, not there
            lists, shape = row.values, []
            even = True
            while lists.type.num_fields:
                shape.append(len(lists))
                even = even and len(lists.value_lengths().unique()) <= 1
                lists = lists.flatten()
            counts = [*shape, len(lists)]
            # Each axis has the lengths of the lists in it; an empty one ends them.
            lengths = [n // max(outer, 1) for outer, n in zip([1, *shape], counts, strict=True)]
            if not even or math.prod(lengths) != len(lists) or lists.null_count:
                raise ParameterError(
                    f"{file}: the lists of {name} are not of one length in the row of {recording!r}"
                )
            values = np.array(lists).reshape(lengths)
            if len(columns) > 1:
                found.setdefault(recording, {})[feature] = values
            else:
                found[recording] = values
    return found
