"""Features for the rows of Arrow tables: a function that Ray, Dask, Spark and others can call.

Needs pyarrow (`pip install pyarrow`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ._batches import Job
from ._extract import MOST_JOBS, Config, StrPath
from ._pieces import join_pieces
from ._refusals import refuses
from .errors import ParameterError

__all__ = ["extract_batch", "join_pieces"]


@refuses
def extract_batch(
    batch: Any,
    *,
    preset: str | None = None,
    config: Config | None = None,
    set: Mapping[str, Any] | None = None,
    projection: StrPath | None = None,
    model: StrPath | None = None,
    summary: str = "columns",
    frames: str | None = None,
    channels: int | None = None,
    jobs: int = 1,
) -> Any:
    """Extracts features of the recordings in a batch: one row for each row, in the same order.

    Parameters
    ----------
    batch : pyarrow.RecordBatch or Table
        Columns: `path` (a path or `file://` URI) or `bytes` (the file's content); optionally `id`,
        `start` and `end` in seconds; `archive`, `offset` and `size` of a member of a tar. All
        others are labels, which are copied to the output unchanged.
    preset, config, set : see `corsmal_feat.extract`; by default the configuration of `model`
    projection : file from `corsmal_feat.corsmal.fit_projection` by which to project statistics
    model : file of a classifier with a feature configuration; adds the columns `predicted` and, if
        the classifier gives probabilities, `p_<label>`
    summary : "columns" gives each statistic a column with its name; "list" gives one column
        `features` of lists of fixed size, with the names in the schema's metadata
    frames : "list" returns frames instead of statistics, without the configuration's summary
    channels : number of channels that recordings must have, if the width of the table depends on
        it; others have the status mismatch. By default the number that most recordings of this
        batch have; for batches of one table, set it
    jobs : number of threads

    A bad recording raises no error: its row says what is wrong, and its features are null.
    Transforms and filter banks are made once per process and kept.

    Returns
    -------
    pyarrow.RecordBatch or Table
        `id`, `start` and `end` if given, labels, the outcome as in the ledger (`path`, `status`,
        `reason`, ...), then the features: statistics, or for a configuration without a summary a
        column for each feature of lists [channels][coefficients][frames]. The schema's metadata has
        the configuration, its hash and the version of this package.

    Raises
    ------
    ParameterError : a column, the configuration or the model cannot be used
    RunError : a temporary file failed

    Examples
    --------
    >>> import pyarrow as pa
    >>> from corsmal_feat.arrow import extract_batch
    >>> batch = pa.RecordBatch.from_pydict({"path": ["rice.wav", "none.wav"], "type": ["a", "b"]})
    >>> found = extract_batch(batch, preset="esc26", channels=1)
    >>> found["status"].to_pylist(), found["type"].to_pylist()
    (['ok', 'io'], ['a', 'b'])
    """
    job = Job.of(preset, config, set, projection, model, summary, frames, channels)
    if not 1 <= jobs <= MOST_JOBS:
        raise ParameterError(f"jobs must be 1 to {MOST_JOBS}, not {jobs}")
    return job.extract(batch, jobs)
