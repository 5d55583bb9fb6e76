"""Features of a manifest on a cluster of Dask.

    python dask_features.py manifest.parquet features/ [scheduler:8786]

Needs dask, distributed, pyarrow and corsmal-feat on all machines, and a file system that they share.
"""

import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from corsmal_feat.arrow import extract_batch
from dask.distributed import Client, as_completed

ROWS = 64


def part(batch: pa.Table, path: str) -> int:
    """Computes some rows into a file, whole or not at all; gives its rows."""
    found = extract_batch(batch, preset="mfcc-zcr", channels=2)
    draft = Path(path).with_suffix(".draft")
    pq.write_table(found, draft, compression="zstd")
    draft.replace(path)
    return found.num_rows


def main(manifest: str, out: str, scheduler: str | None = None) -> None:
    """Computes what is not there yet, and compares the rows with the manifest."""
    table, folder = pq.read_table(manifest), Path(out).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    parts = {
        str(folder / f"{at:09d}.parquet"): table.slice(at, ROWS)
        for at in range(0, table.num_rows, ROWS)
    }
    # Without a scheduler: processes of one thread on this machine.
    with Client(scheduler) if scheduler else Client(threads_per_worker=1) as client:
        open_parts = {path: rows for path, rows in parts.items() if not Path(path).exists()}
        futures = [client.submit(part, rows, path, retries=2) for path, rows in open_parts.items()]
        for done in as_completed(futures):
            done.result()
    counted = sum(pq.read_metadata(path).num_rows for path in parts)
    if counted != table.num_rows:
        sys.exit(f"{counted} rows of {table.num_rows}")
    print(f"{counted} rows in {len(parts)} parts")


if __name__ == "__main__":
    main(*sys.argv[1:])
