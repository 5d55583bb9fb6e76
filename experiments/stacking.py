"""Weights of classifiers, learned on folds inside the training rows.

Used by the nested evaluations in this folder. Every candidate gives out-of-fold probabilities on
inner folds of the training rows. The weights, at least 0 and with sum 1, minimise the log loss of
the weighted mean of these probabilities, and then weight the candidates fitted on all training rows
(a super learner, van der Laan et al. 2007).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

Matrix = npt.NDArray[np.float64]
Labels = npt.NDArray[np.int64]


class Model(Protocol):
    """The methods that a classifier needs."""

    def fit(self, x: Matrix, y: Labels) -> object: ...

    def predict_proba(self, x: Matrix) -> Matrix: ...


class Standardized:
    """A classifier after standardisation by the mean and deviation of the training rows."""

    def __init__(self, classifier: Model) -> None:
        self.classifier = classifier

    def fit(self, x: Matrix, y: Labels) -> Standardized:
        self.mean, self.scale = x.mean(axis=0), x.std(axis=0)
        self.scale[self.scale < 1e-9] = 1
        self.classifier.fit((x - self.mean) / self.scale, y)
        return self

    def predict_proba(self, x: Matrix) -> Matrix:
        return self.classifier.predict_proba((x - self.mean) / self.scale)


class Ranked:
    """A classifier of ranks: each feature is replaced by its rank among the training rows, from -1
    to 1, so that no recording is an extreme outlier in any of them."""

    def __init__(self, classifier: Model) -> None:
        self.classifier = classifier

    def _ranks(self, x: Matrix) -> Matrix:
        places = [
            np.searchsorted(known, column, "left") + np.searchsorted(known, column, "right")
            for known, column in zip(self.known, x.T, strict=True)
        ]
        return np.stack(places, axis=1) / self.known.shape[1] - 1

    def fit(self, x: Matrix, y: Labels) -> Ranked:
        self.known = np.sort(x, axis=0).T
        self.classifier.fit(self._ranks(x), y)
        return self

    def predict_proba(self, x: Matrix) -> Matrix:
        return self.classifier.predict_proba(self._ranks(x))


def weighted_f1(truth: Labels, predicted: Labels) -> float:
    """F1 of each class, weighted by its number of rows."""
    total = 0.0
    for label in np.unique(truth):
        hits = np.sum((truth == label) & (predicted == label))
        rows = np.sum(truth == label)
        total += 2 * hits / (rows + np.sum(predicted == label)) * rows
    return float(total / len(truth))


def held_out(fit_predict: Callable[[Labels, Labels], Matrix], folds: Labels) -> Matrix:
    """Probabilities of every row from a model that has not seen its fold.

    `fit_predict` takes the positions of training and test rows."""
    rows = np.arange(len(folds))
    parts = [
        (rows[folds == f], fit_predict(rows[folds != f], rows[folds == f]))
        for f in np.unique(folds)
    ]
    proba = np.zeros((len(folds), parts[0][1].shape[1]))
    for test, values in parts:
        proba[test] = values
    return proba


def weights(probas: Sequence[Matrix], truth: Labels) -> npt.NDArray[np.float64]:
    """Weights of the mean with the smallest log loss (a convex problem), by
    expectation-maximisation."""
    rows = np.arange(len(truth))
    likelihood = np.stack([p[rows, truth] for p in probas], axis=1).clip(1e-6)
    w = np.full(len(probas), 1 / len(probas))
    for _ in range(1000):
        share = likelihood * w
        w = (share / share.sum(axis=1, keepdims=True)).mean(axis=0)
    return w


def mixture(probas: Sequence[Matrix], w: npt.NDArray[np.float64]) -> Matrix:
    """The weighted mean."""
    return sum(np.multiply(p, v) for p, v in zip(probas, w, strict=True))


def shown(names: Mapping[str, object] | Sequence[str], w: npt.NDArray[np.float64]) -> str:
    """Names with weights of at least 1 %, the largest first."""
    pairs = sorted(zip(w, names, strict=True), reverse=True)
    return ", ".join(f"{name} {value:.2f}" for value, name in pairs if value >= 0.01)
