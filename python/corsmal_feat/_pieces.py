"""Cuts long recordings into pieces, and joins their frames again."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import numpy as np

from . import _core
from ._batch_columns import Singles, arrow, nested
from ._batch_rows import ID, PIECE, rows_of
from ._features import GOOD
from ._refusals import refuses
from .errors import ParameterError

#: Column with the id of the recording that a piece is of.
RECORDING = "recording"
#: Values of a column of nested lists.
_VALUES = 2**31 - 1
#: Pieces of a recording above which it stays whole.
_MOST = 100_000
#: Bounds of a piece, in seconds: shorter ones would be mostly context, longer ones cut nothing.
_SHORTEST, _LONGEST = 0.1, 3e8


def cut(table: Any, longest: float) -> Any:
    """A manifest with a row for each piece of recordings of more than `longest` seconds.

    All pieces have the same number of whole samples, except the last, which goes to the end.
    Compressed audio stays whole, because its samples can only be reached by decoding, as do
    stretches that end after the recording.
    """
    pa = arrow()
    if not _SHORTEST <= longest <= _LONGEST:
        raise ParameterError(
            f"longest must be {_SHORTEST} to {_LONGEST:.0f} seconds, not {longest}"
        )
    taken = [name for name in (RECORDING, *PIECE) if name in table.schema.names]
    if taken:
        raise ParameterError(
            f"the manifest has a column {taken[0]}, but pieces need that name: rename it"
        )
    rows = rows_of(table)
    twice = next((i for i, n in Counter(row[0] for row in rows).items() if n > 1), None)
    if twice is not None:
        raise ParameterError(
            f"the manifest has the id {twice!r} more than once: pieces need unique ids"
        )
    places: list[int] = []
    ids: list[str] = []
    samples: list[tuple[int | None, int | None]] = []
    for i, (row, header) in enumerate(zip(rows, _core.lengths(rows), strict=True)):
        bounds = [] if header is None else _bounds(*header, row[2], row[3], longest)
        for first, last in bounds:
            places.append(i)
            ids.append(f"{row[0]}@{_place(header[0], row[2], first)}" if header else row[0])
            samples.append((first, last))
        if not bounds:
            places.append(i)
            ids.append(row[0])
            samples.append((None, None))
    names = [name for name in table.schema.names if name != ID]
    pieces = table.select(names).take(pa.array(places, pa.int64()))
    pieces = pieces.add_column(0, ID, pa.array(ids, pa.string()))
    recordings = pa.array([rows[i][0] for i in places], pa.string())
    pieces = pieces.append_column(RECORDING, recordings)
    for k, name in enumerate(PIECE):
        pieces = pieces.append_column(name, pa.array([s[k] for s in samples], pa.uint64()))
    return pieces


def _bounds(
    rate: int, frames: int, start: float | None, end: float | None, longest: float
) -> list[tuple[int, int | None]]:
    """First sample and end of each piece, from the start of the stretch; empty if not cut."""

    first = _sample(start, rate)
    last = frames if end is None else _sample(end, rate)
    length, step = last - first, max(1, round(longest * rate))
    if last > frames or length <= step or length // step > _MOST:
        return []
    firsts = list(range(0, length, step))
    return [(a, b) for a, b in zip(firsts, [*firsts[1:], None], strict=True)]


def _sample(time: float | None, rate: int) -> int:
    """The last sample that does not begin after `time`, as in the engine."""
    return int(min((time or 0) * rate, 2.0**63) + 1e-3)


def _place(rate: int, start: float | None, first: int) -> str:
    """Seconds from the start of the recording to a piece."""
    return repr(round((_sample(start, rate) + first) / rate, 6))


@refuses
def join_pieces(found: Any) -> Any:
    """Joins the frames of pieces: one row per recording, as `extract_batch` returns it uncut.

    Parameters
    ----------
    found : pyarrow.Table
        The result of `extract_batch` for a manifest with `longest`. All pieces of a recording must
        be consecutive rows, in order. Other rows stay as they are.

    Returns
    -------
    pyarrow.Table
        The table without the columns of pieces. If a piece has no features, neither has its
        recording, with the status and reason of that piece.

    Raises
    ------
    ParameterError : pieces are missing or out of order

    Examples
    --------
    >>> from corsmal_feat.arrow import extract_batch, join_pieces
    >>> from corsmal_feat.ray import manifest
    >>> cut = manifest("rice.wav", longest=0.5)
    >>> cut["id"].to_pylist()
    ['rice@0.0', 'rice@0.5']
    >>> found = extract_batch(cut, config={"features": {"rms": {}}})
    >>> join_pieces(found)["id"].to_pylist()
    ['rice']
    """
    pa = arrow()
    if not isinstance(found, pa.Table):
        raise ParameterError(f"found must be a pyarrow.Table, not {type(found)}")
    for name in (RECORDING, *PIECE):
        if name not in found.schema.names:
            raise ParameterError(f"found has no column {name}: none of its recordings was cut")
    recordings = found[RECORDING].to_pylist()
    starts = [i for i, name in enumerate(recordings) if i == 0 or recordings[i - 1] != name]
    groups = [range(a, b) for a, b in zip(starts, [*starts[1:], len(recordings)], strict=True)]
    if len({recordings[group[0]] for group in groups}) != len(groups):
        raise ParameterError("the pieces of a recording must be consecutive rows: sort the table")
    config = json.loads((found.schema.metadata or {}).get(b"corsmal.config", b"{}"))
    features = {name for name in config.get("features", ()) if _is_nested(found, name)}
    columns: dict[str, Any] = {}
    arrays: dict[str, list[Singles | None]] = {}
    #: Recordings without a frame of a feature, and that feature.
    empty: dict[int, str] = {}
    statuses = found["status"].to_pylist()
    bad = [next((i for i in group if statuses[i] not in GOOD), None) for group in groups]
    # What every piece says of its recording, the worst first: it is cut short where any of them is.
    told = [
        fault if fault is not None else next((i for i in group if statuses[i] != "ok"), group[0])
        for group, fault in zip(groups, bad, strict=True)
    ]
    _require_whole(found, groups, recordings)
    for field in found.schema:
        name = field.name
        if name in (RECORDING, *PIECE):
            continue
        column = found[name]
        if name == ID:
            columns[name] = pa.array([recordings[group[0]] for group in groups], field.type)
        elif name in features:
            rows = _joined(column, groups, bad)
            for k, row in enumerate(rows):
                if row is not None and len(groups[k]) > 1 and not len(row):
                    empty.setdefault(k, name)
            arrays[name] = rows
            columns[name] = None
        elif name == "decoded_frames":
            counts = column.to_pylist()
            sums = [_sum([counts[i] for i in group]) for group in groups]
            columns[name] = pa.array(sums, field.type)
        elif name == "repairs":
            repairs = column.to_pylist()
            unions = [
                repairs[g[0]]
                if len(g) == 1
                else list(dict.fromkeys(r for i in g for r in repairs[i] or ()))
                for g in groups
            ]
            columns[name] = pa.array(unions, field.type)
        else:
            columns[name] = column.take(pa.array(told, pa.int64()))
    for name, rows in arrays.items():
        columns[name] = nested([None if k in empty else row for k, row in enumerate(rows)])
    if empty:
        _fail(columns, empty)
    return pa.table(columns).replace_schema_metadata(found.schema.metadata)


def _fail(columns: dict[str, Any], empty: dict[int, str]) -> None:
    """Recordings without a frame of one feature have no features at all, as when uncut."""
    pa = arrow()
    told = {name: columns[name].to_pylist() for name in ("status", "reason", "decoded_frames")}
    for k, name in empty.items():
        if told["decoded_frames"][k]:
            told["status"][k], told["reason"][k] = "too_short", f"no frame of {name}"
        else:
            told["status"][k], told["reason"][k] = "empty", "no samples"
    for name in ("status", "reason"):
        columns[name] = pa.array(told[name], pa.string())


def _sum(counts: list[int | None]) -> int | None:
    known = [count for count in counts if count is not None]
    return sum(known) if known else None


def _require_whole(found: Any, groups: list[range], recordings: list[str]) -> None:
    """Refuses recordings unless all pieces from the first sample to the end are there in order."""
    firsts, ends = (found[name].to_pylist() for name in PIECE)
    for group in groups:
        bounds = [(firsts[i], ends[i]) for i in group]
        if bounds == [(None, None)]:
            continue
        reached: int | None = 0
        for first, end in bounds:
            if first != reached:
                break
            reached = end
        else:
            if reached is None:
                continue
        raise ParameterError(f"pieces of {recordings[group[0]]!r} are missing or out of order")


def _is_nested(table: Any, name: str) -> bool:
    if name not in table.schema.names:
        return False
    types, kind = arrow().types, table.schema.field(name).type
    return bool(types.is_list(kind) and types.is_list(kind.value_type))


def _joined(column: Any, groups: list[range], bad: list[int | None]) -> list[Singles | None]:
    """Frames [channels][coefficients][frames], one piece after another."""
    rows: list[Singles | None] = []
    for group, fault in zip(groups, bad, strict=True):
        pieces = [] if fault is not None else [_array(column[i]) for i in group]
        rows.append(np.concatenate(pieces) if pieces else None)
    values = sum(row.size for row in rows if row is not None)
    if values > _VALUES:
        raise ParameterError(
            f"the frames have {values} values, but an Arrow column holds at most {_VALUES}: join"
            " fewer recordings at a time"
        )
    return rows


def _array(row: Any) -> Singles:
    """A row [channels][coefficients][frames] as an array [frames, coefficients, channels]."""
    channels = row.values
    coefficients = channels.flatten()
    values = coefficients.flatten()
    shape = (len(channels), len(coefficients) // max(1, len(channels)))
    frames = len(values) // max(1, len(coefficients))
    return np.asarray(values, dtype=np.float32).reshape(*shape, frames).T
