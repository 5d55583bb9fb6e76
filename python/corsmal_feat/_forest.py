"""Trees and forests: importances, and scores on rows that trees have not seen."""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from ._classifier import Learned, WeightedClassifier
from ._sklearn import not_fitted
from ._validation import Matrix
from ._warnings import warn
from .errors import NotFittedError


class GrownClassifier(WeightedClassifier):
    """A tree or a forest."""

    _importances: Matrix | None = None

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Trains on `X` [shape=(rows, features)] and `y`, one label per row.

        `sample_weight` [shape=(rows,)] gives each row a weight of at least 0; a row of weight 0 is
        left out. By default, all rows weigh the same.
        """
        super().fit(X, y, sample_weight)
        self._importances = self._model.feature_importances()
        return self

    @property
    def feature_importances_(self) -> Matrix:
        """Impurity that the splits on each feature removed; the sum is 1."""
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        if self._importances is None:
            raise NotFittedError(
                "feature_importances_ is available only after fit, and not with solver='linfa': "
                "model files do not hold it"
            )
        return self._importances


class Forest(GrownClassifier):
    """A forest."""

    _renamed: ClassVar = {"n_estimators": "trees", "random_state": "seed"}
    oob_score: bool
    oob_score_: float
    oob_decision_function_: Matrix

    def _parameters(self, classes: npt.NDArray[Any] | None) -> dict[str, Any]:
        parameters = super()._parameters(classes)
        # None means all features here, as in scikit-learn.
        parameters.setdefault("max_features", "all")
        return parameters

    def _fit(self, X: Any, y: Any, sample_weight: Any) -> Learned:
        learned = super()._fit(X, y, sample_weight)
        known = self._model.out_of_bag()
        if known is None:
            for name in ("oob_score_", "oob_decision_function_"):
                self.__dict__.pop(name, None)
            return learned
        rows = len(learned.positions)
        used = np.ones(rows, bool) if learned.weights is None else learned.weights > 0
        fractions = np.full((rows, known.shape[1]), np.nan)
        fractions[used] = known
        asked = ~np.isnan(fractions).any(axis=1)
        if (used & ~asked).any():
            warn(
                "Some inputs do not have OOB scores: every tree has seen "
                f"{(used & ~asked).sum()} of {rows} rows; use more trees"
            )
        right = fractions[asked].argmax(axis=1) == learned.positions[asked]
        self.oob_decision_function_ = fractions
        self.oob_score_ = float(right.mean()) if asked.any() else float("nan")
        return learned
