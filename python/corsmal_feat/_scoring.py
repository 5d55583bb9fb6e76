"""Prediction files: cross-validation, fusion, scores."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from . import _core
from ._by_name import ByName
from ._predictions import Predictions, StrPath, parse
from ._refusals import existing, refuses, seed_of, whole
from ._warnings import warn
from .errors import DataTypeError, ParameterError

__all__ = [
    "CrossValidation",
    "ScoreReport",
    "cross_validate",
    "fuse",
    "score",
]

#: Value of `labels` if each recording is in a folder named after its class.
FOLDERS = "folders"


@dataclass(frozen=True, eq=False)
class CrossValidation:
    """Scores on held-out rows.

    Attributes
    ----------
    accuracy, weighted_f1, macro_f1 : `mean` and `std` over folds, and the ends `low` and `high` of
        the 95 % interval (Student's t)
    predictions : predictions for the held-out rows
    report : everything, as `corsmal-feat cross-validate --json` prints it; `report["held_out"]` has
        the bootstrap intervals and the calibration of all held-out rows

    Examples
    --------
    >>> result = corsmal_feat.cross_validate("features.npz", labels="folders", cv=3)
    >>> result.accuracy["mean"], result.report["held_out"]["rows"]
    (1.0, 12)
    """

    accuracy: dict[str, float]
    weighted_f1: dict[str, float]
    macro_f1: dict[str, float]
    predictions: Predictions
    report: dict[str, Any] = field(repr=False)


@dataclass(frozen=True)
class ScoreReport(ByName):
    """Scores of a prediction file.

    Attributes
    ----------
    kind : "classes" or "numbers"
    values : scores over all rows by name: `accuracy`, `weighted_f1`, `macro_f1` and, if there are
        probabilities, `brier`, `ece`, `roc_auc`, `average_precision`; for numbers,
        `mean_absolute_error`, `root_mean_squared_error`, `mean_relative_error`, `r2`, `score`
    report : everything, as `corsmal-feat score --json` prints it: classes, confusion, intervals,
        curves

    Examples
    --------
    >>> scored = corsmal_feat.score("rf.csv", labels="folders")
    >>> scored.kind, scored["accuracy"]
    ('classes', 1.0)
    """

    kind: str
    values: dict[str, float]
    report: dict[str, Any] = field(repr=False)


@refuses
def cross_validate(
    features: StrPath,
    target: str = "class",
    *,
    labels: StrPath | None = None,
    id_column: str | None = None,
    groups: str | None = None,
    cv: int | str | None = None,
    classifier: str = "rf",
    parameters: Mapping[str, Any] | None = None,
    standardize: bool = False,
    pca: float | None = None,
    tune: Mapping[str, Iterable[Any]] | None = None,
    seed: int = 0,
) -> CrossValidation:
    """Scores a classifier on held-out rows, as `corsmal-feat cross-validate` does.

    Parameters
    ----------
    features : path
        Feature file of `extract` with statistics, or any `.npz` with a member `X`.
    target : str
        Label column to predict.
    labels : path or "folders", optional
        CSV with labels, or "folders" if the folders of the recordings are their classes; by
        default the label columns of the feature file.
    id_column : str, optional
        Column of the label file that names the recordings by id, path or file name.
    groups : str, optional
        Label column of groups that must not be split between training and test.
    cv : int or str, optional
        Number of folds, or a plan: "group=COLUMN", "fold=COLUMN", "lists=1,4,7/2,5,8".
    classifier : str
        "knn", "svm", "tree", "rf", "et" or "logistic".
    parameters : mapping, optional
        Parameters of the classifier; scikit-learn's names work, too.
    standardize, pca : bool, int or float
        Steps before the classifier, which are fitted on training rows only.
    tune : mapping, optional
        Values to try for each parameter; they are compared on folds inside the training rows.
    seed : int
        Seed of the classifier and of shuffled folds.

    Returns
    -------
    CrossValidation

    Raises
    ------
    ParameterError
        A file cannot be read, labels do not fit the recordings, or a parameter is out of range.

    Examples
    --------
    >>> result = corsmal_feat.cross_validate("features.npz", labels="folders", cv=3)
    >>> result.accuracy["mean"], result.predictions.labels
    (1.0, ['rice', 'water'])
    """
    if hasattr(features, "outcomes"):
        raise DataTypeError(
            "features must be the path of a feature file: extract(..., out=PATH) writes one"
        )
    plan = str(cv) if cv is not None else None
    recipe = {
        "classifier": classifier,
        "parameters": [f"{key}={_value(value)}" for key, value in (parameters or {}).items()],
        "standardize": bool(standardize),
        "pca": None if pca is None else repr(_plain(pca)),
        "tune": [
            f"{key}={json.dumps([_plain(value) for value in values])}"
            for key, values in (tune or {}).items()
        ],
        "seed": whole("seed", seed, 2**32),
    }
    text, held_out = _core.cross_validate(
        existing(features), target, _labels(labels, id_column, target), groups, plan, recipe
    )
    result = validated(text, held_out)
    for told in result.report["warnings"]:
        warn(told)
    return result


def validated(text: str, held_out: str) -> CrossValidation:
    """The result, from the report as JSON and the predictions for the held-out rows as CSV."""
    report = json.loads(text)
    result = report["result"]
    return CrossValidation(
        accuracy=result["accuracy"],
        weighted_f1=result["weighted_f1"],
        macro_f1=result["macro_f1"],
        predictions=parse(held_out),
        report=report,
    )


@refuses
def fuse(
    predictions: StrPath | Iterable[StrPath],
    *,
    weights: Iterable[float] | None = None,
    vote: Literal["majority", "mean"] | None = None,
    background: str | None = None,
    least: int = 1,
) -> Predictions:
    """Combines predictions of several files, or of windows, as `corsmal-feat fuse` does.

    Parameters
    ----------
    predictions : path or paths
        Prediction files of the same recordings and classes, to be averaged.
    weights : iterable of float, optional
        One positive number per file.
    vote : {"majority", "mean"}, optional
        How to combine the windows of each recording into one decision first.
    background : str, optional
        With a majority: this class wins only if no other class has `least` windows.
    least : int
        Windows that a class other than `background` needs.

    Returns
    -------
    Predictions

    Raises
    ------
    ParameterError
        Files differ in recordings or classes, or weights are not one positive number per file.

    Examples
    --------
    >>> both = corsmal_feat.fuse(["rf.csv", "knn.csv"], weights=[2, 1])
    >>> len(both), both.proba.shape
    (12, (12, 2))
    """
    if isinstance(predictions, (str, os.PathLike)):
        predictions = [predictions]
    paths = [existing(path) for path in predictions]
    if not paths:
        raise ParameterError("predictions must name at least one file")
    chosen = None if weights is None else [float(weight) for weight in weights]
    least = whole("least", least, 2**32)
    fused, warnings = _core.fuse(paths, chosen, vote, background, least)
    for told in warnings:
        warn(told)
    return parse(fused)


@refuses
def score(
    predictions: StrPath,
    *,
    labels: StrPath | None = None,
    id_column: str | None = None,
    target: str | None = None,
    groups: str | None = None,
    reject: float = 0.0,
    numeric: bool = False,
    resamples: int = 2000,
    seed: int = 0,
) -> ScoreReport:
    """Scores predictions against true classes or numbers, as `corsmal-feat score` does.

    Parameters
    ----------
    predictions : path
        Prediction file of `classify`, `cross_validate` or `fuse`.
    labels : path or "folders", optional
        Source of the true classes, if not the file itself.
    id_column : str, optional
        Column of the label file that names the recordings by id, path or file name.
    target : str, optional
        Column of the true classes; by default the only label column of `labels`, else `true`.
    groups : str, optional
        Column of groups that the bootstrap draws together; by default `group`, `container` or
        `recording` if there is one.
    reject : float
        Predictions with a highest probability below this are unknown, and count as wrong.
    numeric : bool
        Whether to treat the target as a number even if all its values are whole.
    resamples, seed : int
        Number of bootstrap resamples, and the seed.

    Returns
    -------
    ScoreReport

    Raises
    ------
    ParameterError
        A column is missing, or a recording has no label.
    MissingFileError
        A file does not exist.

    Examples
    --------
    >>> corsmal_feat.score("rf.csv")["weighted_f1"]
    1.0
    """
    if not 0.0 <= reject <= 1.0:
        raise ParameterError(f"reject must be a probability from 0 to 1, not {reject}")
    if labels is not None and os.fspath(labels) == FOLDERS and target is None:
        target = "class"
    count = whole("resamples", resamples, 1_000_001)
    if count == 0:
        raise ParameterError("resamples must be at least 1, not 0")
    text = _core.score(
        existing(predictions),
        _labels(labels, id_column, target or "class"),
        target,
        groups,
        float(reject),
        bool(numeric),
        count,
        seed_of(seed),
    )
    report = json.loads(text)
    for doubt in report.get("warnings", ()):
        warn(f"{os.fspath(predictions)}: {doubt}")
    if report["kind"] == "numbers":
        names = ("mean_absolute_error", "root_mean_squared_error", "mean_relative_error", "r2")
        return ScoreReport("numbers", {name: report[name] for name in (*names, "score")}, report)
    values = {name: report["scores"][name] for name in ("accuracy", "weighted_f1", "macro_f1")}
    if report["calibration"] is not None:
        values |= {name: report["calibration"][name] for name in ("brier", "ece")}
    areas = {name: report[name] for name in ("roc_auc", "average_precision")}
    values |= {name: area for name, area in areas.items() if area is not None}
    return ScoreReport("classes", values, report)


def _labels(labels: StrPath | None, id_column: str | None, target: str) -> dict[str, str | None]:
    folders = labels is not None and os.fspath(labels) == FOLDERS
    if id_column is not None and (labels is None or folders):
        raise ParameterError("id_column needs a label file")
    return {
        "file": None if labels is None or folders else existing(labels),
        "folders": target if folders else None,
        "id_column": id_column,
    }


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _value(value: Any) -> str:
    return json.dumps(_plain(value))
