"""Model files of any classifier."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy.typing as npt

from . import _core
from ._classifier import class_labels
from ._validation import Matrix, features


class TrainedModel:
    """Any model file: steps, classifier, labels and the features it was trained on."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._model = _core.TrainedModel.load(os.fspath(path))
        self.header: dict[str, Any] = json.loads(self._model.header())
        self.classes_ = class_labels(self.header)
        self.n_features_in_ = self._model.n_features()

    @property
    def feature_config(self) -> Any:
        """The full configuration of the features, or None."""
        return self.header["feature_config"]

    def predict(self, X: Any) -> npt.NDArray[Any]:
        """The label of each row of `X` [shape=(rows, features)]."""
        return self.classes_[self._model.predict(features(X, "TrainedModel"))]

    def predict_proba(self, X: Any) -> Matrix:
        """Probabilities [shape=(rows, classes)], columns in the order of `classes_`."""
        return self._model.predict_proba(features(X, "TrainedModel"))


def load_model(path: str | os.PathLike[str]) -> TrainedModel:
    """Reads any model file."""
    return TrainedModel(path)
