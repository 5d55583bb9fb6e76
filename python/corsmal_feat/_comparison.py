"""Whether two classifiers differ, from their prediction files."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

from . import _core
from ._predictions import StrPath
from ._refusals import existing, refuses, seed_of, whole
from ._warnings import warn

__all__ = ["Comparison", "compare_predictions"]


@dataclass(frozen=True)
class Comparison:
    """Whether two classifiers differ on the same recordings.

    Attributes
    ----------
    only_first, only_second : number of recordings that only one of the two got right
    p_value : p value of McNemar's exact test, which takes rows as independent
    difference, low, high : weighted F1 of the second minus that of the first, with its 95 %
        bootstrap interval over groups, or else over rows
    report : everything, as `corsmal-feat compare-predictions --json` prints it

    Examples
    --------
    >>> compared = corsmal_feat.compare_predictions("rf.csv", "knn.csv")
    >>> compared.only_first, compared.only_second, compared.p_value
    (0, 0, 1.0)
    """

    only_first: int
    only_second: int
    p_value: float
    difference: float
    low: float
    high: float
    report: dict[str, Any] = field(repr=False)


@refuses
def compare_predictions(
    first: StrPath,
    second: StrPath,
    *,
    target: str | None = None,
    groups: str | None = None,
    resamples: int = 2000,
    seed: int = 0,
) -> Comparison:
    """Tests whether two classifiers differ, as `corsmal-feat compare-predictions` does.

    Parameters
    ----------
    first, second : path
        Prediction files of the same recordings with true classes.
    target : str, optional
        Column of the true classes; `true` by default.
    groups : str, optional
        Column of groups that are drawn together, since their rows are not independent; by default
        a column `group`, `container` or `recording`.
    resamples, seed : int
        Number of bootstrap resamples, and the seed.

    Returns
    -------
    Comparison

    Warns
    -----
    UserWarning
        Rows have groups, so McNemar's test overstates the evidence, or classes differ only in case.

    Raises
    ------
    ParameterError
        Recordings are in only one file, true classes differ, or columns are missing.

    Examples
    --------
    >>> comparison = corsmal_feat.compare_predictions("rf.csv", "knn.csv")
    >>> comparison.only_first, comparison.only_second, comparison.p_value
    (0, 0, 1.0)
    """
    count = whole("resamples", resamples, 1_000_001)
    text = _core.compare_predictions(
        existing(first), existing(second), target, groups, count, seed_of(seed)
    )
    report = json.loads(text)
    for warning in report["warnings"]:
        warn(warning)
    test, interval = report["mcnemar"], report["bootstrap_groups"] or report["bootstrap_rows"]
    return Comparison(
        test["only_first"],
        test["only_second"],
        test["p_value"],
        interval["difference"],
        interval["low"],
        interval["high"],
        report,
    )
