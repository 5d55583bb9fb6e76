"""Outputs in Parquet files."""

from __future__ import annotations

import json
import math
import os
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import numpy.typing as npt

from ._core import check_parquet, is_statistic
from ._warnings import warn
from .errors import ParameterError

Values = npt.NDArray[Any]


def _is_text(types: Any, kind: Any) -> bool:
    kind = kind.value_type if types.is_dictionary(kind) else kind
    return bool(types.is_string(kind) or types.is_large_string(kind))


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


def of_partitions(name: str) -> dict[str, Any]:
    """The fields of `Features` from a partitioned output, in the order of its inputs."""
    files = sorted(Path(name).glob("*=*/part.parquet"))
    if not files:
        raise ParameterError(f"{name} is a folder without parts (label=value/part.parquet)")
    read = [_read(os.fspath(file)) for file in files]
    parts = [found for found, _ in read]
    places: list[tuple[int, int, int]] = []
    for number, (file, (found, of)) in enumerate(zip(files, read, strict=True)):
        if not _is_part(of) or len(of["places"]) != len(found["outcomes"]):
            raise ParameterError(f"{file} is not a part of an output of corsmal-feat")
        if file.parent.name != _folder(of["label"], of["value"]):
            raise ParameterError(
                f"{file} holds the part {_folder(of['label'], of['value'])}: rename its folder"
            )
        if _run(read[number]) != _run(read[0]):
            raise ParameterError(f"{file} and {files[0]} are parts of different outputs")
        places += [(place, number, at) for at, place in enumerate(of["places"])]
        found["labels"][of["label"]] = np.array([of["value"]] * len(found["ids"]), dtype=np.str_)
        with_features = set(found["ids"])
        for row in found["outcomes"]:
            if row["id"] not in with_features:
                row["labels"] = row.get("labels", {}) | {of["label"]: of["value"]}
    first, label = parts[0], read[0][1]["label"]
    places.sort()
    whole = len(places) == read[0][1]["inputs"]
    if not whole or any(place != i for i, (place, _, _) in enumerate(places)):
        raise ParameterError(f"{name}: a part of the output is missing")
    outcomes = [parts[number]["outcomes"][at] for _, number, at in places]
    rows = {i: row for row, i in enumerate(i for part in parts for i in part["ids"])}
    ids = [row["id"] for row in outcomes if row["id"] in rows]
    order = np.array([rows[i] for i in ids], dtype=np.intp)

    def joined(key: str) -> Values:
        values: Values = np.concatenate([part["labels"][key] for part in parts])[order]
        return values

    def of_ids(key: str) -> dict[str, Any]:
        all_parts = {k: v for part in parts for k, v in part[key].items()}
        return {i: all_parts[i] for i in ids if i in all_parts}

    keys = [key for key in first["labels"] if key != label]
    keys.insert(read[0][1]["column"], label)
    summary = None
    if first["summary"] is not None:
        summary = np.concatenate([part["summary"] for part in parts])[order]
    return first | {
        "ids": ids,
        "arrays": of_ids("arrays"),
        "times": of_ids("times"),
        "summary": summary,
        "labels": {key: joined(key) for key in keys},
        "outcomes": outcomes,
    }


def _is_part(of: Any) -> bool:
    """Whether metadata describe a part of a partitioned output, with values of the right types."""

    def is_count(value: Any) -> bool:
        return type(value) is int and value >= 0

    return (
        isinstance(of, dict)
        and all(isinstance(of.get(key), str) for key in ("label", "value"))
        and all(is_count(of.get(key)) for key in ("column", "inputs"))
        and isinstance(of.get("places"), list)
        and all(is_count(place) for place in of["places"])
    )


def _folder(label: str, value: str) -> str:
    """The folder of a part, named as in Hive."""
    none = "__HIVE_DEFAULT_PARTITION__"
    return f"{quote(label, safe='')}={quote(value, safe='') if value else none}"


def _run(read: tuple[dict[str, Any], dict[str, Any]]) -> tuple[Any, ...]:
    """What parts of one output have in common."""
    found, part = read
    return found["names"], [part[k] for k in ("label", "column", "inputs", "run")]


def of_parquet(name: str) -> dict[str, Any]:
    """The fields of `Features` from a Parquet file."""
    return _read(name)[0]


def _read(name: str) -> tuple[dict[str, Any], Any]:
    """The fields of `Features` from a file, and which part of a partitioned output it is, from its
    metadata, with the run that wrote it."""
    try:
        parquet = import_module("pyarrow.parquet")
        failed = import_module("pyarrow").ArrowInvalid
    except ImportError as error:
        raise ImportError(
            f"{name}: reading Parquet needs pyarrow (pip install pyarrow); "
            "pandas.read_parquet and polars.read_parquet read the table, too"
        ) from error
    check_parquet(name)
    try:
        # Of one file: its folder, `label=value`, says nothing here.
        table = parquet.ParquetFile(name, page_checksum_verification=True).read()
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
        if field.name in {"id", *frames, *(f"__times__/{k}" for k in frames)}:
            continue
        whole = types.is_integer(field.type)
        # pandas makes a column of whole values one of integers; ours have such names.
        if types.is_floating(field.type) or (whole and is_statistic(field.name)):
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
    fields = {
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
    part = meta.pop("part", None)
    return fields, part | {"run": meta} if isinstance(part, dict) else part


def _holds_frames(schema: Any, feature: str) -> bool:
    pair = (feature, f"__times__/{feature}")
    return all(k in schema.names and schema.field(k).type.num_fields == 1 for k in pair)


def _lists(file: str, table: Any, ids: list[str], columns: dict[str, str]) -> dict[str, Any]:
    """Arrays from columns of nested lists, by id and then by feature if there are several."""
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
                    f"{file}: the lists of {name} differ in length in the row of {recording!r}"
                )
            values = np.array(lists).reshape(lengths)
            if len(columns) > 1:
                found.setdefault(recording, {})[feature] = values
            else:
                found[recording] = values
    return found
