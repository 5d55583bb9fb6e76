"""Scores of CORSMAL submissions."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

from . import _core
from ._arrays import size
from ._by_name import ByName
from ._refusals import existing, refuses, seed_of
from .errors import ParameterError

__all__ = ["Scores", "evaluate"]

StrPath = str | os.PathLike[str]


@dataclass(frozen=True)
class Scores(ByName):
    """Scores of a submission under a rule set.

    Attributes
    ----------
    values : the scores in percent, by name (`s1` to `s10`, `overall`, `JFLT`, `CMD` of the toolkit;
        `T1`, `T2`, `T3`, `mass` of the paper)
    rules : name of the rule set
    recordings : number of recordings that were scored
    notes : remarks that a reader of the scores should know

    Examples
    --------
    >>> scores = corsmal_feat.evaluate("team.csv", "annotations.csv")
    >>> scores.recordings, scores.rules
    (2, 'toolkit')
    """

    values: dict[str, float]
    rules: str
    recordings: int
    notes: list[str]


@refuses
def evaluate(
    submission: StrPath,
    annotations: StrPath,
    *,
    rules: str = "toolkit",
    baseline: StrPath | None = None,
    seed: int | None = None,
    containers: Iterable[int] | None = None,
) -> Scores:
    """Scores a CORSMAL submission, as the command `corsmal-feat evaluate` does.

    Parameters
    ----------
    submission : path
        CSV in the official format of 2020 or 2022.
    annotations : path
        Official annotation file.
    rules : {"paper", "toolkit-2020-10", "toolkit-2021-11", "toolkit"}
        Rule set; docs/ccm.md describes each with its quirks.
    baseline : path, optional
        Submission that fills in unaddressed tasks, in the filling mass only; by default the
        official random1.csv or random123.csv, which come with this package.
    seed : int, optional
        Seed of pseudo-random estimates to use instead of `baseline`.
    containers : iterable of int, optional
        Score only the recordings of these containers.

    Returns
    -------
    Scores

    Raises
    ------
    ParameterError
        A file is damaged or of another form, its rows do not fit the annotations, or a number is
        out of range.
    MissingFileError
        A file does not exist.

    Examples
    --------
    >>> scores = corsmal_feat.evaluate("team.csv", "annotations.csv", rules="paper")
    >>> scores.recordings, scores["T1"]
    (2, 100.0)
    """
    chosen = None if containers is None else [size("containers", c, 0) for c in containers]
    if seed is not None:
        if baseline is not None:
            raise ParameterError("seed draws estimates instead of baseline: give one of them")
        seed = seed_of(seed)
    for container in chosen or ():
        if not 0 <= container <= 255:
            raise ParameterError(f"containers must be numbers from 0 to 255, not {container}")
    reference = None if baseline is None else existing(baseline)
    values, recordings, notes = _core.evaluate(
        existing(submission), existing(annotations), rules, reference, seed, chosen
    )
    return Scores(dict(values), rules, recordings, notes)
