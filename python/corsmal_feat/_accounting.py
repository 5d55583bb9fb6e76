"""Checks that every recording of a manifest has one row."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from ._batch_columns import arrow
from ._features import GOOD
from ._parts import PARTS, write_whole
from .errors import RunError

_ACCOUNTING = "accounting.json"


@dataclass(frozen=True)
class Accounting:
    """The outcome of every recording of a manifest.

    Attributes
    ----------
    parts : list of str
        The Parquet files, in the order of the manifest.
    recordings : int
        Number of recordings: rows of the manifest, and of all parts together.
    statuses : dict
        Number of recordings with each status.
    done_before : int
        Number of parts that an earlier call had finished.
    """

    parts: list[str]
    recordings: int
    statuses: dict[str, int]
    done_before: int

    @property
    def failed(self) -> int:
        """Number of recordings without features."""
        return sum(n for status, n in self.statuses.items() if status not in GOOD)


def account(folder: Path, parts: list[str], ids: list[str], done_before: int) -> Accounting:
    """Compares the ids of all files with those of the manifest.

    Raises
    ------
    RunError : the ids differ
    """
    read = import_module("pyarrow.parquet").read_table
    statuses: Counter[str] = Counter()
    at = 0
    for name in parts:
        path = folder / PARTS / name
        try:
            found = read(path, columns=["id", "status"], page_checksum_verification=True)
        except (OSError, arrow().ArrowInvalid) as error:
            raise RunError(f"{path} cannot be read: {error}; remove it and run again") from error
        there = found["id"].to_pylist()
        wanted = ids[at : at + len(there)]
        if there != wanted:
            missing = sorted({*wanted} - {*there})[:3]
            raise RunError(
                f"{path} does not hold the recordings of the manifest (missing: {missing}); remove"
                " it and run again"
            )
        at += len(there)
        statuses.update(found["status"].to_pylist())
    if at != len(ids):
        raise RunError(
            f"{folder} holds {at} of the {len(ids)} recordings of the manifest; remove the last"
            " part and run again"
        )
    accounting = Accounting(
        [str(folder / PARTS / name) for name in parts], at, dict(statuses), done_before
    )
    text = json.dumps({"recordings": at, "statuses": accounting.statuses}, indent=1)
    write_whole(folder / _ACCOUNTING, text.encode())
    return accounting
