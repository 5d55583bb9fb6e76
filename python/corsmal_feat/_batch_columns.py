"""Arrow columns from arrays."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import numpy.typing as npt

Singles = npt.NDArray[np.float32]
Flags = npt.NDArray[np.bool_]


def arrow() -> Any:
    """The package pyarrow."""
    try:
        return import_module("pyarrow")
    except ImportError as error:
        raise ImportError("corsmal_feat.arrow needs pyarrow (pip install pyarrow)") from error


def scalars(values: Singles, rows: Flags) -> list[Any]:
    """One column for each column of `values`; `rows` says which rows have values."""
    pa = arrow()
    if rows.all():
        # Views of one array: nothing is copied but to lay columns out one after the other.
        return [pa.array(column) for column in np.ascontiguousarray(values.T)]
    whole = np.zeros((values.shape[1], len(rows)), dtype=np.float32)
    whole[:, rows] = values.T
    return [pa.array(column, mask=~rows) for column in whole]


def vectors(values: Singles, rows: Flags) -> Any:
    """Lists of fixed size."""
    pa = arrow()
    whole = np.zeros((len(rows), values.shape[1]), dtype=np.float32)
    whole[rows] = values
    mask = pa.array(~rows)
    return pa.FixedSizeListArray.from_arrays(pa.array(whole.ravel()), whole.shape[1], mask=mask)


def nested(rows: list[Singles | None]) -> Any:
    """Lists [channels][coefficients][frames] of arrays [frames, coefficients, channels]."""
    pa = arrow()
    arrays = [row.T for row in rows if row is not None]
    flat = [np.ascontiguousarray(a).ravel() for a in arrays]
    values = np.concatenate(flat) if flat else np.zeros(0, dtype=np.float32)
    lengths = (
        [a.shape[2] for a in arrays for _ in range(a.shape[0] * a.shape[1])],
        [a.shape[1] for a in arrays for _ in range(a.shape[0])],
        [0 if row is None else row.shape[2] for row in rows],
    )
    lists = pa.array(values)
    for level, counts in enumerate(lengths):
        offsets = pa.array(np.concatenate([[0], np.cumsum(counts, dtype=np.int64)]), pa.int32())
        mask = pa.array([row is None for row in rows], pa.bool_()) if level == 2 else None
        lists = pa.ListArray.from_arrays(offsets, lists, mask=mask)
    return lists


def no_rows(schema: Any) -> Any:
    pa = arrow()
    return pa.RecordBatch.from_arrays([pa.array([], field.type) for field in schema], schema=schema)
