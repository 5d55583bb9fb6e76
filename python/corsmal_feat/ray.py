"""Extraction on a Ray cluster, with every recording accounted for.

Needs Ray and pyarrow (`pip install 'corsmal-feat[ray]'`). Also available as a command:
`python -m corsmal_feat.ray --help`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from . import _core
from ._accounting import Accounting, account
from ._batch_columns import arrow as pyarrow
from ._batch_rows import absolute, rows_of
from ._batches import Job
from ._extract import Config, StrPath
from ._parts import ATTEMPTS, DEATHS, PARTS, compute_part, write_whole
from ._pieces import cut
from ._refusals import refuses
from ._warnings import warn
from .errors import CorsmalFeatError, ParameterError, RunError

__all__ = ["Accounting", "extract", "manifest"]

_JOB = "job.json"
#: Batches that are queued for each core.
_AHEAD = 2
#: Seconds without a finished part after which a warning says so.
_SILENCE = 300.0


@refuses
def manifest(paths: StrPath | Iterable[StrPath], *, longest: float | None = None) -> Any:
    """The recordings that `paths` stand for, as in the command `corsmal-feat extract`.

    Parameters
    ----------
    paths : folders, globs, files, manifests (`.csv`, `.jsonl`), tar shards such as
        `shards/{000..999}.tar`; or one `.parquet` file with the columns of the table below
    longest : seconds; longer recordings of uncompressed audio (WAV, AIFF, ...) are cut into pieces,
        one row each. Joined by `corsmal_feat.arrow.join_pieces`, their frames are those of the
        whole recording, bit for bit. Statistics, and features that depend on the whole recording,
        cannot be computed on pieces: `extract_batch` refuses them

    Returns
    -------
    pyarrow.Table
        `id`, `path`, `start`, `end`, labels and, if recordings are in tars, `archive`, `offset`,
        `size` and `fault`; with `longest` also `recording`, `first_sample` and `end_sample`. Web
        addresses keep their query, which may be a signature: then treat the table as a secret.

    Raises
    ------
    RunError : there are no recordings, or a manifest is wrong
    """
    pa = pyarrow()
    names = [os.fspath(p) for p in ([paths] if isinstance(paths, str | os.PathLike) else paths)]
    if len(names) == 1 and names[0].lower().endswith(".parquet"):
        try:
            table = import_module("pyarrow.parquet").read_table(
                names[0], page_checksum_verification=True
            )
        except (OSError, pa.ArrowInvalid) as error:
            raise RunError(f"{names[0]}: {error}") from error
        return table if longest is None else cut(table, longest)
    found, warning = _core.collect(names)
    if warning is not None:
        warn(warning)
    text, seconds, bytes_ = pa.string(), pa.float64(), pa.uint64()
    columns = {
        "id": pa.array([row[0] for row in found], text),
        "path": pa.array([absolute(row[1]) for row in found], text),
    }
    if any(row[2] is not None for row in found):
        places = [row[2] or (None,) * 4 for row in found]
        archives = [None if p[0] is None else absolute(p[0]) for p in places]
        columns["archive"] = pa.array(archives, text)
        for i, (name, kind) in enumerate((("offset", bytes_), ("size", bytes_), ("fault", text))):
            columns[name] = pa.array([place[i + 1] for place in places], kind)
    columns["start"] = pa.array([row[3] for row in found], seconds)
    columns["end"] = pa.array([row[4] for row in found], seconds)
    for i, (name, _) in enumerate(found[0][5] if found else ()):
        if name in columns:
            raise ParameterError(f"the label {name!r} has the name of another column: rename it")
        columns[name] = pa.array([row[5][i][1] for row in found], text)
    table = pa.table(columns)
    return table if longest is None else cut(table, longest)


@refuses
def extract(
    paths: Any,
    out: StrPath,
    *,
    preset: str | None = None,
    config: Config | None = None,
    set: Mapping[str, Any] | None = None,
    projection: StrPath | None = None,
    model: StrPath | None = None,
    summary: str = "columns",
    frames: str | None = None,
    channels: int | None = None,
    longest: float | None = None,
    rows: int = 64,
    address: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Accounting:
    """Extracts on a cluster into a folder of Parquet files, one row per recording.

    Each task uses one core and computes `rows` recordings into one file, which appears when it is
    complete. Call this again after a failure, even of the driver: finished files are kept, the
    others are computed again. Where a process has crashed, its recordings are then computed one by
    one; a recording that crashes its process twice alone gets the status `crashed`.

    Parameters
    ----------
    paths : what `manifest` takes, or a pyarrow.Table like those it returns
    out : output folder, shared by all nodes
    preset, config, set, projection, model, summary, frames : see `corsmal_feat.arrow.extract_batch`
    channels : as in `extract_batch`; by default the number that most recordings have, for which
        this process reads their headers
    longest : seconds above which recordings are cut into pieces, see `manifest`
    rows : recordings per task, and per file
    address : address of a running cluster; by default the one that Ray finds, or a new one on this
        machine
    progress : called with the number of files done and of all files

    Returns
    -------
    Accounting

    Raises
    ------
    ParameterError : configuration, model or manifest cannot be used; two recordings have the same
        id
    RunError : `out` holds another job, or the ids in its files are not those of the manifest

    Examples
    --------
    >>> import corsmal_feat.ray
    >>> shards = "shards/{000..999}.tar"
    >>> found = corsmal_feat.ray.extract(shards, "features/", preset="esc26")  # doctest: +SKIP
    >>> found.recordings, found.statuses  # doctest: +SKIP
    (1000000, {'ok': 999998, 'truncated': 1, 'crashed': 1})
    """
    pa = pyarrow()
    if rows < 1:
        raise ParameterError(f"rows must be at least 1, not {rows}")
    job = Job.of(preset, config, set, projection, model, summary, frames, channels)
    if longest is not None:
        job.require_pieces()
    if isinstance(paths, pa.Table):
        _require_paths(paths)
        table = paths if longest is None else cut(paths, longest)
    else:
        table = manifest(paths, longest=longest)
    _require_paths(table)
    known = rows_of(table)
    ids = [row[0] for row in known]
    twice = [name for name, count in Counter(ids).items() if count > 1]
    if twice:
        raise ParameterError(f"{len(twice)} ids occur more than once, such as {twice[0]!r}")
    table = table.select([name for name in table.schema.names if name != "id"])
    table = table.add_column(0, "id", pa.array(ids, pa.string())).combine_chunks()
    # Workers have other current folders, and files there may be others.
    projection, model = (None if p is None else os.path.abspath(p) for p in (projection, model))
    if channels is None:
        channels = job.computation.recordings.usual_channels(known)
    options = {
        "config": json.loads(job.computation.config),
        "model": model,
        "summary": summary,
        "channels": channels,
    }
    folder = Path(out).absolute()
    _claim(folder, job, table, channels, rows)
    parts = dict(_parts(table, job, rows))
    done = {path.name for path in (folder / PARTS).glob("*.parquet")}
    strange = sorted(done - parts.keys())
    if strange:
        raise RunError(f"{folder / PARTS}: {strange[0]} is not a part of this job")
    left = {name: part for name, part in parts.items() if name not in done}
    if left:
        _compute(left, folder, options, address, (len(done), progress))
    return account(folder, list(parts), ids, len(done))


def _require_paths(table: Any) -> None:
    if "bytes" in table.schema.names:
        raise ParameterError("a manifest must have paths, not bytes: workers read files in place")


def _claim(folder: Path, job: Job, table: Any, channels: int | None, rows: int) -> None:
    """Claims the folder for this job, or checks that it already belongs to it."""
    digest = hashlib.blake2b(digest_size=32)
    for batch in table.to_batches(1 << 16):
        rows_here = [{k: _known_by(v) for k, v in row.items()} for row in batch.to_pylist()]
        digest.update(json.dumps(rows_here, default=str).encode())
    model = None if job.model is None else _digest(job.model.path)
    this = {
        "tool_version": _core.__version__,
        "config_hash": job.computation.config_hash,
        "manifest": digest.hexdigest(),
        "model": model,
        "summary": "list" if job.as_list else "columns",
        "channels": channels,
        "rows": rows,
    }
    for name in (PARTS, ATTEMPTS):
        (folder / name).mkdir(parents=True, exist_ok=True)
    path = folder / _JOB
    if not path.exists():
        write_whole(path, json.dumps(this, indent=1).encode())
        return
    try:
        that = json.loads(path.read_bytes())
    except ValueError as error:
        raise RunError(f"{path} cannot be read: {error}") from error
    other = [key for key in this if that.get(key) != this[key]]
    if other:
        raise RunError(
            f"{folder} holds another job: {other[0]} is {that.get(other[0])!r} there, but"
            f" {this[other[0]]!r} here; choose another folder, or empty this one"
        )


def _known_by(value: Any) -> Any:
    """A value without the signature of a web address, which changes while the recording stays."""
    return _core.shown(value) if isinstance(value, str) and _core.is_stored(value) else value


def _digest(path: str) -> str:
    return hashlib.blake2b(Path(path).read_bytes(), digest_size=32).hexdigest()


def _parts(table: Any, job: Job, rows: int) -> Iterator[tuple[str, Any]]:
    """The rows of each file and its name: number, and a hash of ids and configuration."""
    for number, start in enumerate(range(0, table.num_rows, rows)):
        part = table.slice(start, rows)
        digest = hashlib.blake2b(job.computation.config_hash.encode(), digest_size=8)
        digest.update(json.dumps(part["id"].to_pylist()).encode())
        yield f"{number:08d}-{digest.hexdigest()}.parquet", part


def _compute(
    parts: dict[str, Any],
    folder: Path,
    options: dict[str, Any],
    address: str | None,
    told: tuple[int, Callable[[int, int], object] | None],
) -> None:
    try:
        ray = import_module("ray")
    except ImportError as error:
        raise ImportError("corsmal_feat.ray needs Ray (pip install 'corsmal-feat[ray]')") from error
    if not ray.is_initialized():
        ray.init(address=address, include_dashboard=None if address else False)
    # Ray's own retries know nothing of recordings that kill: ours do.
    task = ray.remote(num_cpus=1, max_retries=0)(compute_part)
    waiting = list(reversed(parts.items()))
    tries: Counter[str] = Counter()
    running: dict[Any, tuple[str, Any]] = {}
    done_before, progress = told
    done, total = done_before, done_before + len(parts)
    while waiting or running:
        cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
        while waiting and len(running) < _AHEAD * cores:
            name, part = waiting.pop()
            running[task.remote(part, str(folder), name, options)] = (name, part)
        finished, _ = ray.wait(list(running), num_returns=1, timeout=_SILENCE)
        if not finished:
            warn(f"no part was finished in {_SILENCE:.0f} s: `ray status` shows what the cores do")
            continue
        ready = finished[0]
        name, part = running.pop(ready)
        try:
            ray.get(ready)
        except ray.exceptions.RayTaskError as error:
            # Raised by our code: wrong with the job, and so with all that is to come.
            for other in running:
                ray.cancel(other)
            cause = error.cause if isinstance(error.cause, CorsmalFeatError) else error
            raise RunError(f"{name}: {cause}") from error
        except ray.exceptions.RayError as error:
            # The process died, or its node. Each of its recordings can do that so many times.
            tries[name] += 1
            if tries[name] > DEATHS * part.num_rows + DEATHS:
                raise RunError(f"{name}: gave up after {tries[name]} tries: {error}") from error
            waiting.append((name, part))
        else:
            done += 1
            if progress is not None:
                progress(done, total)


def _main(arguments: list[str] | None = None) -> int:
    """The command: 0 done, 1 recordings without features, 2 could not run, 130 interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m corsmal_feat.ray",
        description="Extracts on a Ray cluster into a folder of Parquet files.",
    )
    parser.add_argument(
        "paths", nargs="+", help="recordings, folders, globs, manifests, tar shards"
    )
    parser.add_argument("--out", required=True, help="output folder, shared by all nodes")
    parser.add_argument("--preset", help="configuration that comes with the package")
    parser.add_argument("--config", help="TOML file with a configuration")
    parser.add_argument("--projection", help="file of fitted principal components")
    parser.add_argument("--model", help="classifier file; adds predictions")
    parser.add_argument("--summary", choices=("columns", "list"), default="columns")
    parser.add_argument("--frames", choices=("list",), help="frames instead of statistics")
    parser.add_argument("--channels", type=int, help="number of channels that recordings must have")
    parser.add_argument(
        "--longest",
        type=float,
        help="cut longer recordings into pieces of this many seconds (frames only)",
    )
    parser.add_argument("--rows", type=int, default=64, help="recordings per task (64)")
    parser.add_argument("--address", help="address of a running cluster, such as auto")
    given = vars(parser.parse_args(arguments))

    def tell(done: int, total: int) -> None:
        print(f"\r{done} of {total} parts", end="", file=sys.stderr, flush=True)

    try:
        found = extract(given.pop("paths"), given.pop("out"), progress=tell, **given)
    except (CorsmalFeatError, ImportError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    counts = ", ".join(f"{status} {count}" for status, count in found.statuses.items())
    print(f"\n{found.recordings} recordings: {counts}", file=sys.stderr)
    return 1 if found.failed else 0


if __name__ == "__main__":
    # Under its own name, so that workers can import what they run.
    sys.exit(import_module("corsmal_feat.ray")._main())
