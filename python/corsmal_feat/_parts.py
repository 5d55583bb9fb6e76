"""The files of a job on a cluster, and the task that computes one of them."""

from __future__ import annotations

import os
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any

from . import arrow
from ._batch_columns import arrow as pyarrow
from ._batches import failed_batch

#: Folders of a job.
PARTS, ATTEMPTS = "parts", "attempts"
#: Times that a recording may take its process with it.
DEATHS = 2
_CRASHED = f"its process ended {DEATHS} times while it computed only this recording"


def compute_part(table: Any, folder: str, name: str, options: dict[str, Any]) -> None:
    """Computes a file in a worker: all recordings at once or, after a crash, one by one."""
    log = Path(folder, ATTEMPTS, name).with_suffix(".log")
    if log.exists():
        whole = _one_by_one(table, log, options)
    else:
        log.write_bytes(b"all\n")
        try:
            whole = arrow.extract_batch(table, **options).combine_chunks()
        except Exception:
            log.unlink()
            raise
    sink = pyarrow().BufferOutputStream()
    import_module("pyarrow.parquet").write_table(
        whole, sink, compression="zstd", write_page_checksum=True
    )
    write_whole(Path(folder, PARTS, name), sink.getvalue())
    log.unlink(missing_ok=True)


def _one_by_one(table: Any, log: Path, options: dict[str, Any]) -> Any:
    """The log of attempts says which recording was open when a process ended."""
    opened: Counter[int] = Counter()
    for line in log.read_text().splitlines():
        kind, _, number = line.partition(" ")
        if number.isdigit():
            opened[int(number)] += 1 if kind == "open" else -1
    pieces = []
    # Lines are short and appended at once: one that a kill has cut is none.
    with log.open("ab", buffering=0) as attempts:
        attempts.write(b"\n")
        for row in range(table.num_rows):
            one = table.slice(row, 1)
            if opened[row] >= DEATHS:
                pieces.append(failed_batch(one, "crashed", _CRASHED, **options))
                continue
            attempts.write(b"open %d\n" % row)
            pieces.append(arrow.extract_batch(one, **options))
            attempts.write(b"done %d\n" % row)
    return pyarrow().concat_tables(pieces).combine_chunks()


def write_whole(path: Path, content: Any) -> None:
    """Writes a file that appears only when it is complete and on the disk."""
    draft = path.with_name(f".{path.name}.{os.getpid()}.draft")
    with draft.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)
