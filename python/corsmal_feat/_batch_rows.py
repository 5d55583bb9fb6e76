"""What to read for each row of an Arrow batch."""

from __future__ import annotations

import os
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np

from . import _core
from ._batch_columns import arrow
from .errors import ParameterError

#: Columns that say what to read.
ID, PATH, BYTES, START, END = "id", "path", "bytes", "start", "end"
#: Columns that say where in an archive a recording lies, as `corsmal_feat.ray.manifest` has them.
PLACE = ("archive", "offset", "size", "fault")
#: Columns that say which samples the frames of a piece are anchored at.
PIECE = ("first_sample", "end_sample")


def rows_of(batch: Any) -> list[Any]:
    """The rows of a batch as the extension takes them: id, source, start, end, piece."""
    pa = arrow()
    if not isinstance(batch, pa.RecordBatch | pa.Table):
        raise ParameterError(f"batch must be a pyarrow RecordBatch or Table, not {type(batch)}")
    names = batch.schema.names
    if len({*names}) != len(names):
        raise ParameterError(f"batch has two columns with the same name: {', '.join(names)}")
    for name in names:
        if name.lower() in (ID, START, END) and name not in (ID, START, END):
            raise ParameterError(
                f"the column {name!r} must be called {name.lower()!r}; "
                "a label must be called otherwise"
            )
    if PATH not in names and BYTES not in names:
        raise ParameterError(f"batch needs a column path or bytes, but has only {', '.join(names)}")

    def column(name: str, kind: Any) -> list[Any]:
        if name not in names:
            return [None] * batch.num_rows
        try:
            values: list[Any] = batch.column(name).cast(kind).to_pylist()
        except (pa.ArrowInvalid, pa.ArrowNotImplementedError) as error:
            raise ParameterError(f"the column {name}: {error}") from error
        return values

    paths, contents = column(PATH, pa.string()), column(BYTES, pa.large_binary())
    # Without an archive, these are labels.
    places = zip(PLACE, (pa.string(), pa.uint64(), pa.uint64(), pa.string()), strict=True)
    archives, offsets, sizes, faults = (
        column(name, kind) if PLACE[0] in names else [None] * batch.num_rows
        for name, kind in places
    )
    ids = column(ID, pa.string())
    starts, ends = column(START, pa.float64()), column(END, pa.float64())
    _require_own_times(batch, starts, ends)
    firsts, lasts = (column(name, pa.uint64()) for name in PIECE)
    rows = []
    for i in range(batch.num_rows):
        path = "" if paths[i] is None else _local(paths[i])
        source: Any = path
        if contents[i] is not None:
            source = contents[i]
        elif archives[i] is not None:
            source = (path, archives[i], offsets[i] or 0, sizes[i] or 0, faults[i])
        for time in (starts[i], ends[i]):
            if time is not None and not 0 <= time < np.inf:
                raise ParameterError(
                    f"row {i}: start and end must be finite and at least 0 seconds, not {time}"
                )
        # Without the query of a web address, which may be a signature.
        name = ids[i] if ids[i] is not None else (_core.shown(path) or str(i))
        piece = None if firsts[i] is None else (firsts[i], lasts[i])
        if piece is not None and piece[1] is not None and piece[1] <= piece[0]:
            raise ParameterError(
                f"row {i}: end_sample must be above first_sample ({piece[0]}), not {piece[1]}"
            )
        rows.append((name, source, starts[i], ends[i], piece))
    return rows


def _require_own_times(batch: Any, starts: list[Any], ends: list[Any]) -> None:
    """Refuses rows with times in other columns than `start` and `end`."""
    names = batch.schema.names
    # In an archive, `offset` is a place.
    own = {ID, PATH, BYTES, START, END, *PIECE, *(PLACE if PLACE[0] in names else ())}
    halves = ((True, True, False), (True, False, True))
    columns = {
        name: batch.column(name).to_pylist()
        for name in names
        if name not in own and any(_core.times_refusal(half, [name]) for half in halves)
    }
    any_column = START in names or END in names
    for i in range(batch.num_rows if columns else 0):
        numbers = [name for name, values in columns.items() if _is_number(values[i])]
        given = (any_column, starts[i] is not None, ends[i] is not None)
        if refusal := _core.times_refusal(given, numbers):
            raise ParameterError(f"row {i}: {refusal}")


def _is_number(value: Any) -> bool:
    try:
        return bool(np.isfinite(float(value)))
    except (TypeError, ValueError):
        return False


#: Stores that this process has asked for an object.
_asked: set[str] = set()


def require_stores(rows: list[Any]) -> None:
    """Refuses rows of stores that this process cannot access, for example without credentials.

    That is a fault of the job; otherwise each recording would take seconds to fail.
    """
    for _, source, *_ in rows:
        name = source[1] if isinstance(source, tuple) else source
        if isinstance(name, str) and _core.is_stored(name):
            store = "/".join(name.split("/", 3)[:3])
            if store not in _asked:
                _core.require_store(name)
                _asked.add(store)


def _local(path: str) -> str:
    """The path in a `file://` URI; URIs of objects in stores stay as they are."""
    if "://" not in path or _core.is_stored(path):
        return path
    parts = urlsplit(path)
    if parts.netloc not in ("", "localhost"):
        raise ParameterError(f"{path}: a file:// URI must not name another machine")
    return unquote(parts.path)


def absolute(path: str | os.PathLike[str]) -> str:
    """An absolute path, for workers in another current folder; URIs of objects stay as they are."""
    name = os.fspath(path)
    return name if _core.is_stored(name) else os.path.abspath(name)
