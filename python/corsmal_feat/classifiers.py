"""Classifiers in scikit-learn's manner, trained and kept by the Rust side.

They work without scikit-learn; with it installed they are estimators like any other (pipelines,
`cross_val_score`, `GridSearchCV`, `clone`). `save` writes the model file that the command
`corsmal-feat classify` reads, `load_model` reads what `corsmal-feat train` wrote.
"""

from __future__ import annotations

import json
import os
import sys
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from . import _core
from ._core import ParameterError
from ._parameters import NotFittedError, Parametrised, not_fitted

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

Matrix = npt.NDArray[np.float64]


def _names_of(X: Any) -> npt.NDArray[np.object_] | None:
    """Column names of a data frame, if they are all text."""
    columns = getattr(X, "columns", None)
    if columns is None:
        return None
    names = np.asarray(list(columns), dtype=object)
    return names if len(names) and all(isinstance(n, str) for n in names) else None


def _features(X: Any, owner: str) -> Matrix:
    """`X` [shape=(rows, features)] as finite, contiguous float64."""
    if hasattr(X, "toarray") and hasattr(X, "tocsr"):
        raise TypeError(
            f"{owner}: sparse data was passed, but dense data is required; use .toarray()"
        )
    array = np.asarray(X)
    if array.dtype.kind == "c":
        raise ParameterError(f"Complex data not supported by {owner}")
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
                raise TypeError(f"{owner}: features must be numbers: {error}") from error
            raise ParameterError(f"{owner}: features must be numbers: {error}") from error
    array = np.ascontiguousarray(array, dtype=np.float64)
    for count, what in zip(array.shape, ("sample", "feature"), strict=True):
        if count == 0:
            raise ParameterError(
                f"Found array with 0 {what}(s) (shape={array.shape}) while a minimum of 1 is "
                f"required by {owner}."
            )
    with np.errstate(over="ignore", invalid="ignore"):
        # Finite unless something is not (or the sum itself overflows): a quick first look.
        looks_finite = np.isfinite(array.sum())
    if not looks_finite and not np.isfinite(array).all():
        found = "NaN" if np.isnan(array).any() else "infinity"
        raise ParameterError(f"Input X contains {found}: {owner} accepts finite features only.")
    return array


def _labels(y: Any, rows: int, owner: str) -> tuple[npt.NDArray[Any], npt.NDArray[np.int64]]:
    """Sorted different labels, and the position of each row's label among them."""
    if y is None:
        raise ParameterError(f"{owner} requires y to be passed, but the target y is None")
    labels = np.asarray(y)
    if labels.ndim == 2 and labels.shape[1] == 1:
        _warn_column(labels)
        labels = labels.ravel()
    if labels.ndim != 1:
        raise ParameterError(
            f"y should be a 1d array, got an array of shape {labels.shape} instead."
        )
    if len(labels) != rows:
        raise ParameterError(f"X has {rows} rows and y has {len(labels)} labels")
    if labels.dtype.kind == "f":
        if not np.isfinite(labels).all():
            raise ParameterError("Input y contains NaN or infinity.")
        if (labels != np.floor(labels)).any():
            raise ParameterError(
                "Unknown label type: continuous. Classes are needed, not measured values."
            )
    classes, positions = np.unique(labels, return_inverse=True)
    return classes, positions


def _warn_column(labels: npt.NDArray[Any]) -> None:
    import warnings

    category: type[Warning] = UserWarning
    exceptions = sys.modules.get("sklearn.exceptions")
    if exceptions:
        category = exceptions.DataConversionWarning
    warnings.warn(
        f"A column-vector y was passed when a 1d array was expected: its shape is {labels.shape}.",
        category,
        stacklevel=5,
    )


class _Estimator(Parametrised):
    """What all classifiers share. Parameters are those of the subclass's `__init__`."""

    _name: str
    _estimator_type = "classifier"
    #: keyword of the subclass -> parameter of the Rust side, where they differ
    _renamed: dict[str, str] = {}  # noqa: RUF012
    _model: _core.TrainedModel
    classes_: npt.NDArray[Any]
    n_features_in_: int
    feature_names_in_: npt.NDArray[np.object_]

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_model")

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import (  # type: ignore[import-untyped]
            ClassifierTags,
            InputTags,
            Tags,
            TargetTags,
        )

        return Tags(
            estimator_type="classifier",
            target_tags=TargetTags(required=True),
            classifier_tags=ClassifierTags(),
            input_tags=InputTags(),
        )

    def __sklearn_clone__(self) -> Self:
        from copy import deepcopy

        return type(self)(**{k: deepcopy(v) for k, v in self.get_params().items()})

    def _parameters(self, classes: npt.NDArray[Any] | None) -> dict[str, Any]:
        """The parameters as the Rust side names them; `None` means its default."""
        result = {}
        for name, value in self.get_params().items():
            if name == "class_weight" and isinstance(value, dict):
                value = [value.get(c, 1.0) for c in ([] if classes is None else classes.tolist())]
            elif name == "random_state":
                value = _seed(value)
            elif isinstance(value, np.generic):
                value = value.item()
            if value is not None:
                result[self._renamed.get(name, name)] = value
        return result

    def fit(self, X: Any, y: Any) -> Self:
        """Learns from `X` [shape=(rows, features)] and `y`, a label for each row."""
        owner = type(self).__name__
        names = _names_of(X)
        x = _features(X, owner)
        classes, positions = _labels(y, len(x), owner)
        try:
            spec = _core.classifier_parameters(self._name, json.dumps(self._parameters(classes)))
        except TypeError as error:
            raise ParameterError(
                f"{owner}: a parameter is of an impossible type: {error}"
            ) from error
        pipeline = {"classifier": {"name": self._name, "parameters": json.loads(spec)}}
        counts = np.bincount(positions).tolist()
        if len(classes) < 2 and self._name in ("svm", "logistic"):
            raise ParameterError(
                f"{owner} needs at least 2 classes in y: there is only one class, {classes[0]!r}"
            )
        self._model = _core.TrainedModel.fit(
            json.dumps(pipeline),
            x,
            positions.tolist(),
            [str(c) for c in classes.tolist()],
            "y",
            [] if names is None else names.tolist(),
            json.dumps(
                {"rows": len(x), "rows_per_class": counts, "label_kind": classes.dtype.kind}
            ),
        )
        self.classes_ = classes
        self.n_features_in_ = x.shape[1]
        if names is not None:
            self.feature_names_in_ = names
        elif hasattr(self, "feature_names_in_"):
            del self.feature_names_in_
        return self

    def _query(self, X: Any) -> Matrix:
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        names = _names_of(X)
        known = getattr(self, "feature_names_in_", None)
        if names is not None and known is not None and names.tolist() != known.tolist():
            raise ParameterError(
                "The feature names should match those that were passed during fit: "
                f"{list(names)} where {list(known)} are known"
            )
        x = _features(X, type(self).__name__)
        if x.shape[1] != self.n_features_in_:
            raise ParameterError(
                f"X has {x.shape[1]} features, but {type(self).__name__} is expecting "
                f"{self.n_features_in_} features as input"
            )
        return x

    def predict(self, X: Any) -> npt.NDArray[Any]:
        """The label of each row of `X` [shape=(rows, features)]."""
        x = self._query(X)
        return self.classes_[self._model.predict(x)]

    def predict_proba(self, X: Any) -> Matrix:
        """Probabilities [shape=(rows, classes)], columns in the order of `classes_`."""
        x = self._query(X)
        return self._model.predict_proba(x)

    def score(self, X: Any, y: Any) -> float:
        """Part of the rows of `X` whose predicted label is that in `y`."""
        return float(np.mean(self.predict(X) == np.asarray(y).ravel()))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the model file, whole or not at all."""
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        self._model.save(os.fspath(path))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Reads a model file of this very classifier (see `load_model` for any)."""
        model = _core.TrainedModel.load(os.fspath(path))
        header = json.loads(model.header())
        pipeline = header["pipeline"]
        spec = pipeline["classifier"]
        if spec["name"] != cls._name or pipeline["steps"]:
            steps = "+".join([s["name"] for s in pipeline["steps"]] + [spec["name"]])
            raise ParameterError(f"{path} holds {steps}, not {cls._name}: use load_model")
        back = {new: old for old, new in cls._renamed.items()}
        params = {back.get(k, k): v for k, v in spec["parameters"].items()}
        estimator = cls(**{k: v for k, v in params.items() if k in cls._keywords()})
        estimator._model = model
        estimator.classes_ = _classes(header)
        estimator.n_features_in_ = model.n_features()
        if header["feature_names"]:
            estimator.feature_names_in_ = np.asarray(header["feature_names"], dtype=object)
        return estimator

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        if "_model" in state:
            state["_model"] = state["_model"].to_bytes()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if isinstance(state.get("_model"), bytes):
            self._model = _core.TrainedModel.from_bytes(state["_model"])


def _seed(value: Any) -> int:
    """A seed for the Rust side from scikit-learn's `random_state`."""
    if value is None:
        return 0
    if isinstance(value, np.random.RandomState):
        return int(value.randint(2**31 - 1))
    return int(value)


def _classes(header: dict[str, Any]) -> npt.NDArray[Any]:
    """Label names in the type they had in training."""
    names = np.asarray(header["labels"], dtype=object)
    provenance = header["provenance"]
    kind = provenance.get("label_kind", "") if isinstance(provenance, dict) else ""
    if kind == "b":
        return np.asarray(names == "True")
    if kind in ("i", "u"):
        return names.astype(np.int64)
    if kind == "f":
        return names.astype(np.float64)
    return names.astype(str)


class KNN(_Estimator):
    """k nearest neighbours, as `sklearn.neighbors.KNeighborsClassifier(algorithm="brute")`.

    Parameters
    ----------
    n_neighbors : neighbours that vote
    weights : "uniform", or "distance" for votes of 1 / distance
    metric : "euclidean", "manhattan", "cosine", "chebyshev" or "minkowski"
    p : exponent of the minkowski metric
    """

    _name = "knn"
    _renamed = {"n_neighbors": "k"}  # noqa: RUF012

    def __init__(
        self,
        n_neighbors: int = 5,
        *,
        weights: str = "uniform",
        metric: str = "euclidean",
        p: float = 2.0,
    ) -> None:
        self.n_neighbors = n_neighbors
        self.weights = weights
        self.metric = metric
        self.p = p


class SVC(_Estimator):
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
    """

    _name = "svm"
    _renamed = {"cache_size": "cache_mb", "random_state": "seed"}  # noqa: RUF012

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
    ) -> None:
        self.C = C
        self.kernel = kernel
        self.gamma = gamma
        self.class_weight = class_weight
        self.probability = probability
        self.tol = tol
        self.cache_size = cache_size
        self.random_state = random_state

    def __getattribute__(self, name: str) -> Any:
        # Absent without probabilities, so that scikit-learn's tools do not offer it.
        if name == "predict_proba" and not super().__getattribute__("__dict__").get("probability"):
            raise AttributeError("predict_proba needs SVC(probability=True)")
        return super().__getattribute__(name)


class DecisionTree(_Estimator):
    """Decision tree, as `sklearn.tree.DecisionTreeClassifier`.

    Parameters
    ----------
    criterion : "gini" or "entropy"
    max_depth : deepest level, or None
    min_samples_split, min_samples_leaf : fewest rows to split, and in a leaf
    max_features : None, "sqrt", "log2", a whole number, or a fraction up to 1.0
    class_weight : None, "balanced" or a weight per label
    random_state : seed of the order in which features are tried
    """

    _name = "tree"
    _renamed = {"random_state": "seed"}  # noqa: RUF012

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
    ) -> None:
        self.criterion = criterion
        self.max_depth = max_depth
        self.min_samples_split = min_samples_split
        self.min_samples_leaf = min_samples_leaf
        self.max_features = max_features
        self.class_weight = class_weight
        self.random_state = random_state


class _Forest(_Estimator):
    _renamed = {"n_estimators": "trees", "random_state": "seed"}  # noqa: RUF012

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


class LogisticRegression(_Estimator):
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


class TrainedModel:
    """Any model file: steps, classifier, labels and the features it was trained on."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._model = _core.TrainedModel.load(os.fspath(path))
        self.header: dict[str, Any] = json.loads(self._model.header())
        self.classes_ = _classes(self.header)
        self.n_features_in_ = self._model.n_features()

    @property
    def feature_config(self) -> Any:
        """The full configuration of the features, or None."""
        return self.header["feature_config"]

    def predict(self, X: Any) -> npt.NDArray[Any]:
        """The label of each row of `X` [shape=(rows, features)]."""
        return self.classes_[self._model.predict(_features(X, "TrainedModel"))]

    def predict_proba(self, X: Any) -> Matrix:
        """Probabilities [shape=(rows, classes)], columns in the order of `classes_`."""
        return self._model.predict_proba(_features(X, "TrainedModel"))


def load_model(path: str | os.PathLike[str]) -> TrainedModel:
    """Reads any model file."""
    return TrainedModel(path)
