"""Model files of any classifier."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._classifier import class_labels
from ._extract import extract
from ._features import GOOD
from ._validation import Matrix, features
from .errors import DecodeError, ModelError, ParameterError


class TrainedModel:
    """Any model file: steps, classifier, labels and the features it was trained on.

    Attributes
    ----------
    header : dict
        What the file says about the model.
    classes_ : array
        Labels, in the order of `predict_proba`.
    n_features_in_ : int
        Features of a row.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = os.fspath(path)
        self._model = _core.TrainedModel.load(self._path)
        self.header: dict[str, Any] = json.loads(self._model.header())
        self.classes_ = class_labels(self.header)
        self.n_features_in_ = self._model.n_features()

    def __repr__(self) -> str:
        classifier = self.header["pipeline"]["classifier"]["name"]
        wanted = ", ".join(map(str, self.classes_[:4].tolist()))
        more = ", ..." if len(self.classes_) > 4 else ""
        of = "recordings" if self.feature_config else "rows"
        return (
            f"<TrainedModel {self._path}: {classifier} of {self.n_features_in_} features of {of},"
            f" {len(self.classes_)} classes ({wanted}{more})>"
        )

    @property
    def feature_config(self) -> Any:
        """The full configuration of the features, or None."""
        return self.header["feature_config"]

    def predict(self, X: Any) -> npt.NDArray[Any]:
        """The label of each row of `X` [shape=(rows, features)], or of each recording of a list of
        paths."""
        return self.classes_[self._model.predict(self._rows(X))]

    def predict_proba(self, X: Any) -> Matrix:
        """Probabilities [shape=(rows, classes)], columns in the order of `classes_`; `X` as in
        `predict`."""
        return self._model.predict_proba(self._rows(X))

    def _rows(self, X: Any) -> Matrix:
        if isinstance(X, (str, os.PathLike)):
            X = [X]
        if isinstance(X, (list, tuple)) and X and isinstance(X[0], (str, os.PathLike)):
            return self._of_recordings([os.fspath(path) for path in X])
        rows = features(X, "TrainedModel")
        if rows.shape[1] != self.n_features_in_:
            raise ParameterError(
                f"X has {rows.shape[1]} features, but {self._path} was trained on"
                f" {self.n_features_in_}"
            )
        return rows

    def _of_recordings(self, paths: list[str]) -> Matrix:
        if not self.feature_config:
            raise ModelError(
                f"{self._path} was trained on rows of numbers: it does not say which features of a"
                " recording they are"
            )
        # The same file may be in X twice.
        different = list(dict.fromkeys(paths))
        found = extract(different, config=self.feature_config)
        if len(found.outcomes) != len(different):
            raise ParameterError("X holds folders, globs or manifests: name each recording")
        for path, outcome in zip(different, found.outcomes, strict=True):
            if outcome["status"] not in GOOD:
                raise DecodeError(f"{path}: {outcome['status']}: {outcome['reason']}")
        if found.summary is None or len(found.names) != self.n_features_in_:
            raise ParameterError(
                f"X gives {len(found.names)} values for each recording where {self._path} was"
                f" trained on {self.n_features_in_}: another number of channels?"
            )
        row_of = dict(zip(different, found.summary.astype(np.float64), strict=True))
        return np.stack([row_of[path] for path in paths])


def load_model(path: str | os.PathLike[str]) -> TrainedModel:
    """Reads any model file, of `corsmal-feat train` or of `save`.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    TrainedModel

    Examples
    --------
    >>> model = corsmal_feat.load_model("bottles.model")  # doctest: +SKIP
    >>> model.predict(["a.wav", "b.wav"])  # doctest: +SKIP
    array(['water', 'rice'], dtype='<U5')
    """
    return TrainedModel(path)
