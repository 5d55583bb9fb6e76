"""Checks of features and labels, in the words that scikit-learn's own checks expect."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, unmasked
from ._class_labels import check_named
from ._sklearn import DataConversionWarning
from ._warnings import warn
from .errors import DataTypeError, ParameterError

Matrix = npt.NDArray[np.float64]


def names_of(X: Any) -> npt.NDArray[np.object_] | None:
    """Column names of a data frame, if all are strings."""
    names = labels_of_columns(X)
    return names if names is not None and all(isinstance(n, str) for n in X.columns) else None


def labels_of_columns(X: Any) -> npt.NDArray[np.object_] | None:
    """Labels of the columns of a data frame, such as numbers, as strings."""
    columns = getattr(X, "columns", None)
    if columns is None or not len(columns):
        return None
    names = list(columns)
    # pandas has an index; others have strings, or the columns themselves.
    if not hasattr(columns, "dtype") and not all(isinstance(name, str) for name in names):
        return None
    if len({isinstance(name, str) for name in names}) > 1:
        raise DataTypeError(
            "the column names of X are strings and others, expected strings alone:"
            " X.columns = X.columns.astype(str) makes them so"
        )
    return np.array([str(name) for name in names], dtype=object)


def features(X: Any, owner: str) -> Matrix:
    """`X` [shape=(rows, features)] as finite, contiguous float64."""
    if hasattr(X, "toarray") and hasattr(X, "tocsr"):
        raise DataTypeError(
            f"{owner}: sparse data was passed, but dense data is required; use .toarray()"
        )
    if hasattr(X, "summary") and hasattr(X, "outcomes"):
        raise DataTypeError(f"{owner}: X is what extract returns; give its statistics, X.summary")
    array = _array("X", X, owner)
    if array.dtype.kind == "c":
        raise ParameterError(f"Complex data not supported by {owner}")
    if array.ndim == 1 and array.dtype.kind in "OU" and len(array):
        raise ParameterError(
            f"{owner}: X has one dimension, of {type(array[0]).__name__}: for paths of recordings, "
            "put FeatureExtractor before the classifier (make_pipeline)"
        )
    if array.ndim != 2:
        raise ParameterError(
            f"Expected 2D array, got {array.ndim}D array of shape {array.shape} instead. Reshape "
            "your data with .reshape(-1, 1) for one feature or .reshape(1, -1) for one row."
        )
    if array.dtype.kind in "OSU":
        try:
            array = array.astype(np.float64)
        except (TypeError, ValueError) as error:
            if "argument must be" in str(error):
                raise DataTypeError(f"{owner}: features must be numbers: {error}") from error
            raise ParameterError(f"{owner}: features must be numbers: {error}") from error
    array = np.ascontiguousarray(array, dtype=np.float64)
    for count, what in zip(array.shape, ("sample", "feature"), strict=True):
        if count == 0:
            raise ParameterError(
                f"Found array with 0 {what}(s) (shape={array.shape}) while a minimum of 1 is "
                f"required by {owner}."
            )
    if not _core.all_finite(array):
        found = "NaN" if np.isnan(array).any() else "infinity"
        raise ParameterError(f"Input X contains {found}: {owner} accepts finite features only.")
    return array


def labels_of(y: Any, rows: int, owner: str) -> tuple[npt.NDArray[Any], npt.NDArray[np.int64]]:
    """Sorted unique labels, and the position of each row's label among them."""
    if y is None:
        raise ParameterError(f"{owner} requires y to be passed, but the target y is None")
    labels = _array("y", y, owner)
    if labels.ndim == 2 and labels.shape[1] == 1:
        _warn_column(labels)
        labels = labels.ravel()
    if labels.ndim != 1:
        raise ParameterError(
            f"y should be a 1d array, got an array of shape {labels.shape} instead."
        )
    if len(labels) != rows:
        raise ParameterError(f"X has {rows} rows, but y has {len(labels)} labels")
    if labels.dtype.kind == "f":
        if not np.isfinite(labels).all():
            raise ParameterError("Input y contains NaN or infinity.")
        if (labels != np.floor(labels)).any():
            raise ParameterError(
                "Unknown label type: continuous. Classes are needed, not measured values."
            )
    check_named("y", y, labels, owner)
    try:
        classes, positions = np.unique(labels, return_inverse=True)
    except TypeError as error:
        raise ParameterError(f"{owner}: y mixes labels of different types: {error}") from error
    return classes, positions


def weights_of(sample_weight: Any, rows: int, owner: str) -> Matrix | None:
    """Weight of each row [shape=(rows,)]; None if all weigh the same."""
    if sample_weight is None:
        return None
    try:
        weights = as_array("sample_weight", sample_weight, np.float64)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"{owner}: sample_weight must be numbers: {error}") from error
    if weights.ndim == 0:
        weights = np.full(rows, weights)
    if weights.ndim != 1:
        raise ParameterError(
            f"Sample weights must be 1D array or scalar, got an array of shape {weights.shape}"
        )
    if weights.shape != (rows,):
        raise ParameterError(f"sample_weight.shape == {weights.shape}, expected {(rows,)}")
    refused = np.flatnonzero(~(np.isfinite(weights) & (weights >= 0)))
    if len(refused):
        row = refused[0]
        raise ParameterError(
            f"{owner}: sample_weight must be finite numbers of at least 0, not {weights[row]}"
            f" (row {row})"
        )
    if not weights.any():
        raise ParameterError(f"{owner}: sample_weight is zero for every row")
    return weights


def _array(name: str, value: Any, owner: str) -> npt.NDArray[Any]:
    unmasked(name, value)
    try:
        return as_array(name, value)
    except ValueError as error:
        raise ParameterError(f"{owner}: the rows of {name} differ in length") from error


def _warn_column(labels: npt.NDArray[Any]) -> None:
    warn(
        f"A column-vector y was passed when a 1d array was expected: its shape is {labels.shape}.",
        DataConversionWarning,
    )
