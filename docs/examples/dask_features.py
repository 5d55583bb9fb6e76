"""Features of a manifest on a Dask cluster.

    python dask_features.py manifest.parquet features/ [scheduler:8786]

Needs dask, distributed, pyarrow and corsmal-feat on all machines, and a shared file system.
"""

import hashlib
import json
import sys
import uuid
from pathlib import Path

import corsmal_feat
import pyarrow as pa
import pyarrow.parquet as pq
from corsmal_feat.arrow import extract_batch
from dask.distributed import Client, as_completed

ROWS = 64
OPTIONS = {"preset": "mfcc-zcr", "channels": 2}


def name(number: int, batch: pa.Table) -> str:
    """The file name of a part: it depends on position, recordings and options, so on the job."""
    text = json.dumps([batch.to_pylist(), OPTIONS, corsmal_feat.__version__], default=str)
    return f"{number:08d}-{hashlib.blake2b(text.encode(), digest_size=8).hexdigest()}.parquet"


def part(batch: pa.Table, path: str) -> int:
    """Computes some rows into a file, completely or not at all; returns the number of rows."""
    found = extract_batch(batch, **OPTIONS)
    # Dask may run a task twice at the same time.
    draft = Path(path).with_suffix(f".{uuid.uuid4().hex}.draft")
    pq.write_table(found, draft, compression="zstd")
    draft.replace(path)
    return found.num_rows


def main(manifest: str, out: str, scheduler: str | None = None) -> None:
    """Computes the missing parts, and compares their rows with the manifest."""
    table, folder = pq.read_table(manifest), Path(out).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    batches = [table.slice(at, ROWS) for at in range(0, table.num_rows, ROWS)]
    parts = {str(folder / name(i, batch)): batch for i, batch in enumerate(batches)}
    others = {str(path) for path in folder.glob("*.parquet")} - {*parts}
    if others:
        sys.exit(f"{folder} holds parts of another job, such as {min(others)}")
    # Without a scheduler: processes of one thread on this machine.
    with Client(scheduler) if scheduler else Client(threads_per_worker=1) as client:
        open_parts = {path: rows for path, rows in parts.items() if not Path(path).exists()}
        futures = [client.submit(part, rows, path, retries=2) for path, rows in open_parts.items()]
        for done in as_completed(futures):
            done.result()
    found = [i for path in parts for i in pq.read_table(path, columns=["path"])["path"].to_pylist()]
    if found != table["path"].to_pylist():
        sys.exit(f"the {len(found)} rows are not the {table.num_rows} of the manifest")
    print(f"{len(found)} rows in {len(parts)} parts")


if __name__ == "__main__":
    main(*sys.argv[1:])
