"""Classifiers: scikit-learn estimators, trained and kept by the Rust side.

They also work without scikit-learn. `save` writes the model file that the command `corsmal-feat
classify` reads, `load_model` reads what `corsmal-feat train` wrote. Which algorithm each one is and
how it differs from scikit-learn's: docs/classifiers.md.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy.typing as npt

from ._classifier import Classifier
from ._model import TrainedModel, load_model
from .errors import NotFittedError

__all__ = [
    "KNN",
    "SVC",
    "DecisionTree",
    "ExtraTrees",
    "LogisticRegression",
    "NotFittedError",
    "RandomForest",
    "TrainedModel",
    "load_model",
]


class KNN(Classifier):
    """k nearest neighbours, as `sklearn.neighbors.KNeighborsClassifier(algorithm="brute")`.

    Parameters
    ----------
    n_neighbors : neighbours that vote
    weights : "uniform", or "distance" for votes of 1 / distance
    metric : "euclidean", "manhattan", "cosine", "chebyshev" or "minkowski"
    p : exponent of the minkowski metric
    algorithm : "brute", or "linfa" for neighbours found by linfa-nn
    """

    _name = "knn"
    _renamed: ClassVar = {"n_neighbors": "k"}

    def __init__(
        self,
        n_neighbors: int = 5,
        *,
        weights: str = "uniform",
        metric: str = "euclidean",
        p: float = 2.0,
        algorithm: str = "brute",
    ) -> None:
        self.n_neighbors = n_neighbors
        self.weights = weights
        self.metric = metric
        self.p = p
        self.algorithm = algorithm


class SVC(Classifier):
    """Support vector machine, one against one, as `sklearn.svm.SVC`.

    Parameters
    ----------
    C : cost of a training row on the wrong side
    kernel : "rbf" or "linear"
    gamma : "scale", "auto" or a positive number
    class_weight : None, "balanced" or a weight per label
    probability : whether `predict_proba` will be asked for
    tol : tolerance of the optimality conditions
    cache_size : memory for kernel values, MiB
    random_state : seed of the folds for the probabilities
    solver : "own", or "linfa" for linfa-svm (no probabilities, smaller tables)
    """

    _name = "svm"
    _renamed: ClassVar = {"cache_size": "cache_mb", "random_state": "seed"}

    def __init__(
        self,
        *,
        C: float = 1.0,
        kernel: str = "rbf",
        gamma: str | float = "scale",
        class_weight: Any = None,
        probability: bool = False,
        tol: float = 1e-3,
        cache_size: int = 200,
        random_state: Any = None,
        solver: str = "own",
    ) -> None:
        self.C = C
        self.kernel = kernel
        self.gamma = gamma
        self.class_weight = class_weight
        self.probability = probability
        self.tol = tol
        self.cache_size = cache_size
        self.random_state = random_state
        self.solver = solver

    @property
    def predict_proba(self) -> Any:
        """As of the other classifiers; absent without `probability`, so that scikit-learn's tools
        do not ask for it."""
        if not self.probability:
            raise AttributeError("predict_proba needs SVC(probability=True)")
        return super().predict_proba


class DecisionTree(Classifier):
    """Decision tree, as `sklearn.tree.DecisionTreeClassifier`.

    Parameters
    ----------
    criterion : "gini" or "entropy"
    max_depth : deepest level, or None
    min_samples_split, min_samples_leaf : fewest rows to split, and in a leaf
    max_features : None, "sqrt", "log2", a whole number, or a fraction up to 1.0
    class_weight : None, "balanced" or a weight per label
    random_state : seed of the order in which features are tried
    solver : "own", or "linfa" for linfa-trees (no probabilities)
    """

    _name = "tree"
    _renamed: ClassVar = {"random_state": "seed"}

    def __init__(
        self,
        *,
        criterion: str = "gini",
        max_depth: int | None = None,
        min_samples_split: int = 2,
        min_samples_leaf: int = 1,
        max_features: str | float | None = None,
        class_weight: Any = None,
        random_state: Any = None,
        solver: str = "own",
    ) -> None:
        self.criterion = criterion
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.max_features = max_features
        self.class_weight = class_weight
        self.random_state = random_state
        self.solver = solver


class _Forest(Classifier):
    _renamed: ClassVar = {"n_estimators": "trees", "random_state": "seed"}

    def _parameters(self, classes: npt.NDArray[Any] | None) -> dict[str, Any]:
        parameters = super()._parameters(classes)
        # None means all features here, as in scikit-learn.
        parameters.setdefault("max_features", "all")
        return parameters


class RandomForest(_Forest):
    """Random forest, as `sklearn.ensemble.RandomForestClassifier`; all cores, same result.

    Parameters
    ----------
    n_estimators : number of trees
    criterion, max_depth, min_samples_split, min_samples_leaf : see `DecisionTree`
    max_features : features looked at in each split: "sqrt", "log2", None, a number or a fraction
    bootstrap : draw rows with replacement for each tree
    class_weight : None, "balanced" or a weight per label
    random_state : seed of all draws
    """

    _name = "rf"

    def __init__(
        self,
        n_estimators: int = 100,
        *,
        criterion: str = "gini",
        max_depth: int | None = None,
        min_samples_split: int = 2,
        min_samples_leaf: int = 1,
        max_features: str | float | None = "sqrt",
        bootstrap: bool = True,
        class_weight: Any = None,
        random_state: Any = None,
    ) -> None:
        self.n_estimators = n_estimators
        self.criterion = criterion
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.max_features = max_features
        self.bootstrap = bootstrap
        self.class_weight = class_weight
        self.random_state = random_state


class ExtraTrees(_Forest):
    """Extremely randomised trees, as `sklearn.ensemble.ExtraTreesClassifier`.

    Parameters as `RandomForest`, but no bootstrap by default.
    """

    _name = "et"

    def __init__(
        self,
        n_estimators: int = 100,
        *,
        criterion: str = "gini",
        max_depth: int | None = None,
        min_samples_split: int = 2,
        min_samples_leaf: int = 1,
        max_features: str | float | None = "sqrt",
        bootstrap: bool = False,
        class_weight: Any = None,
        random_state: Any = None,
    ) -> None:
        self.n_estimators = n_estimators
        self.criterion = criterion
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.max_features = max_features
        self.bootstrap = bootstrap
        self.class_weight = class_weight
        self.random_state = random_state


class LogisticRegression(Classifier):
    """Logistic regression (multinomial, L2), as `sklearn.linear_model.LogisticRegression`.

    Parameters
    ----------
    C : inverse of the penalty's strength
    class_weight : None, "balanced" or a weight per label
    tol : largest slope of the mean loss at the end
    max_iter : most steps
    """

    _name = "logistic"

    def __init__(
        self,
        *,
        C: float = 1.0,
        class_weight: Any = None,
        tol: float = 1e-8,
        max_iter: int = 10_000,
    ) -> None:
        self.C = C
        self.class_weight = class_weight
        self.tol = tol
        self.max_iter = max_iter
