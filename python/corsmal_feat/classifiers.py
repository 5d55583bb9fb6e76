"""Classifiers: scikit-learn estimators, trained and stored by the Rust side.

`save` writes a model file that `corsmal-feat classify` reads, and `load_model` reads the model file
of `corsmal-feat train`. They also work without scikit-learn; docs/classifiers.md says how each
differs from scikit-learn's.
"""

from __future__ import annotations

from numbers import Integral
from typing import Any, ClassVar, Literal, overload

import numpy as np
import numpy.typing as npt

from ._classifier import Classifier, WeightedClassifier
from ._forest import Forest, GrownClassifier
from ._model import TrainedModel, load_model
from ._sklearn import not_fitted
from ._validation import Matrix
from .errors import NotFittedError, ParameterError

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

Positions = npt.NDArray[np.int64]


class KNN(Classifier):
    """k nearest neighbours, as `sklearn.neighbors.KNeighborsClassifier(algorithm="brute")`.

    Parameters
    ----------
    n_neighbors : int
        Number of neighbours that vote.
    weights : str
        "uniform", or "distance" for votes of 1 / distance.
    metric : str
        "euclidean", "manhattan", "cosine", "chebyshev" or "minkowski".
    p : float
        Exponent of `metric="minkowski"`; refused with another metric.
    algorithm : str
        "brute", or "linfa" to search with linfa-nn.

    Examples
    --------
    >>> x, y = [[0.0], [1.0], [5.0]], ["low", "low", "high"]
    >>> knn = corsmal_feat.KNN(1).fit(x, y)
    >>> knn.predict([[4.0]]).tolist()
    ['high']
    >>> distances, rows = knn.kneighbors([[4.0]], 2)
    >>> distances.tolist(), rows.tolist()
    ([[1.0, 3.0]], [[2, 1]])
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

    @overload
    def kneighbors(
        self, X: Any = ..., n_neighbors: int | None = ..., return_distance: Literal[True] = ...
    ) -> tuple[Matrix, Positions]: ...
    @overload
    def kneighbors(
        self, X: Any = ..., n_neighbors: int | None = ..., *, return_distance: Literal[False]
    ) -> Positions: ...
    def kneighbors(
        self, X: Any = None, n_neighbors: int | None = None, return_distance: bool = True
    ) -> tuple[Matrix, Positions] | Positions:
        """The training rows nearest to each row of `X`.

        Parameters
        ----------
        X : array [shape=(rows, features)], optional
            Rows of features; by default, each training row, with its neighbours among the others.
        n_neighbors : int, optional
            Number of neighbours; by default, that of the classifier.
        return_distance : bool
            Whether to return the distances, too.

        Returns
        -------
        distances : float64 [shape=(rows, n_neighbors)]
            Distances, nearest first; left out with `return_distance=False`.
        positions : int64 [shape=(rows, n_neighbors)]
            Positions of the neighbours among the training rows.
        """
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        k = self.n_neighbors if n_neighbors is None else n_neighbors
        if not isinstance(k, Integral) or isinstance(k, bool) or not 1 <= k < 1 << 63:
            raise ParameterError(f"n_neighbors must be a whole number of at least 1, not {k!r}")
        distances, positions = self._model.neighbours(None if X is None else self._query(X), int(k))
        return (distances, positions) if return_distance else positions


class SVC(WeightedClassifier):
    """Support vector machine, one-vs-one, as `sklearn.svm.SVC`.

    Parameters
    ----------
    C : float
        Cost of a training row on the wrong side.
    kernel : str
        "rbf" or "linear".
    gamma : str or float
        "scale", "auto" or a positive number.
    class_weight : dict or str, optional
        "balanced", or a weight by label.
    probability : bool
        Whether to make `predict_proba` available.
    tol : float
        Tolerance of the optimality conditions.
    cache_size : int
        Memory for kernel values in MiB.
    random_state : int, RandomState, optional
        Seed of the folds for the probabilities.
    solver : str
        "own", or "linfa" for linfa-svm (no probabilities, no sample weights, smaller tables).

    Examples
    --------
    >>> svc = corsmal_feat.SVC(kernel="linear").fit([[0.0], [1.0], [3.0]], ["low", "low", "high"])
    >>> svc.decision_function([[1.0], [2.0], [3.0]]).round(3).tolist()
    [1.0, -0.0, -1.0]
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

    def decision_function(self, X: Any) -> Matrix:
        """For two classes [shape=(rows,)], positive for the second; for more [shape=(rows,
        classes)], the votes of the pairs with their decision values between them (scikit-learn's
        `decision_function_shape="ovr"`)."""
        return self._decision_function(X)

    @property
    def predict_proba(self) -> Any:
        """As in the other classifiers; missing without `probability`, so that scikit-learn's tools
        do not use it."""
        if not self.probability:
            raise AttributeError("predict_proba needs SVC(probability=True)")
        return super().predict_proba


class DecisionTree(GrownClassifier):
    """Decision tree, as `sklearn.tree.DecisionTreeClassifier`.

    Parameters
    ----------
    criterion : str
        "gini" or "entropy".
    max_depth : int, optional
        Maximum depth.
    min_samples_split, min_samples_leaf : int
        Minimum number of rows to split, and in a leaf.
    max_features : str, int or float, optional
        "sqrt", "log2", a whole number, or a fraction up to 1.0; by default all.
    class_weight : dict or str, optional
        "balanced", or a weight by label.
    random_state : int, RandomState, optional
        Seed of the order in which features are tried.
    solver : str
        "own", or "linfa" for linfa-trees (no probabilities, sample weights or importances).

    Attributes
    ----------
    feature_importances_ : float64 [shape=(features,)]
        See `RandomForest`.

    Examples
    --------
    >>> tree = corsmal_feat.DecisionTree().fit([[0, 1], [1, 1], [2, 1]], ["low", "low", "high"])
    >>> tree.feature_importances_.tolist()
    [1.0, 0.0]
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


class RandomForest(Forest):
    """Random forest, as `sklearn.ensemble.RandomForestClassifier`; same on any number of cores.

    Parameters
    ----------
    n_estimators : int
        Number of trees.
    criterion, max_depth, min_samples_split, min_samples_leaf
        See `DecisionTree`.
    max_features : str, int or float, optional
        Features to consider in each split: "sqrt", "log2", a number, or a fraction up to 1.0; None
        for all.
    bootstrap : bool
        Whether to draw rows with replacement for each tree.
    oob_score : bool
        Whether to score trees on the rows that they have not seen; needs `bootstrap`.
    class_weight : dict or str, optional
        "balanced", or a weight by label.
    random_state : int, RandomState, optional
        Seed of all draws.

    Attributes
    ----------
    feature_importances_ : float64 [shape=(features,)]
        Impurity that the splits on each feature removed, as the mean over trees; the sum is 1.
        Available after `fit`, but not stored in model files.
    oob_score_ : float
        With `oob_score`: share of the rows whose label is predicted by the trees that have not seen
        them.
    oob_decision_function_ : float64 [shape=(rows, classes)]
        With `oob_score`: class fractions from those trees; NaN for a row that every tree has seen.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> x = rng.standard_normal((60, 3))
    >>> forest = corsmal_feat.RandomForest(50, oob_score=True, random_state=1).fit(x, x[:, 1] > 0)
    >>> int(forest.feature_importances_.argmax()), forest.oob_score_ > 0.9
    (1, True)
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
        oob_score: bool = False,
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
        self.oob_score = oob_score
        self.class_weight = class_weight
        self.random_state = random_state


class ExtraTrees(Forest):
    """Extremely randomised trees, as `sklearn.ensemble.ExtraTreesClassifier`.

    Parameters
    ----------
    n_estimators, criterion, max_depth, min_samples_split, min_samples_leaf, max_features
        See `RandomForest`, which also describes the attributes.
    bootstrap, oob_score, class_weight, random_state
        See `RandomForest`; by default, `bootstrap` is False.

    Examples
    --------
    >>> trees = corsmal_feat.ExtraTrees(20).fit([[0.0], [1.0], [5.0]], ["low", "low", "high"])
    >>> trees.predict([[5.0]]).tolist()
    ['high']
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
        oob_score: bool = False,
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
        self.oob_score = oob_score
        self.class_weight = class_weight
        self.random_state = random_state


class LogisticRegression(WeightedClassifier):
    """Logistic regression (multinomial, L2), as `sklearn.linear_model.LogisticRegression`.

    Parameters
    ----------
    C : float
        Inverse of the strength of the penalty.
    class_weight : dict or str, optional
        "balanced", or a weight by label.
    tol : float
        Maximum slope of the mean loss at which to stop.
    max_iter : int
        Maximum number of steps.

    Examples
    --------
    >>> model = corsmal_feat.LogisticRegression().fit([[0.0], [1.0], [5.0]], ["low", "low", "high"])
    >>> model.classes_.tolist(), (model.decision_function([[0.0], [5.0]]) > 0).tolist()
    (['high', 'low'], [True, False])
    """

    _name = "logistic"

    def __init__(
        self, *, C: float = 1.0, class_weight: Any = None, tol: float = 1e-8, max_iter: int = 10_000
    ) -> None:
        self.C = C
        self.class_weight = class_weight
        self.tol = tol
        self.max_iter = max_iter

    def decision_function(self, X: Any) -> Matrix:
        """Scores: for two classes [shape=(rows,)], positive for the second; for more [shape=(rows,
        classes)]."""
        return self._decision_function(X)
