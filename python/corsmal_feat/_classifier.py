"""Base classes of all classifiers."""

from __future__ import annotations

import json
import math
import os
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import size
from ._class_labels import class_labels, label_kind, require_kept
from ._fingerprints import Fingerprints, check_rows, fingerprints
from ._model import read_model
from ._refusals import destination, existing
from ._sklearn import BaseEstimator, ClassifierMixin, not_fitted
from ._validation import Matrix, features, labels_of, labels_of_columns, names_of, weights_of
from .errors import ModelError, ParameterError

if TYPE_CHECKING:
    from ._estimator import FeatureExtractor
    from ._features import Features


class Learned(NamedTuple):
    """Labels and weights that a classifier was trained on."""

    #: position of each row's label in `classes_`
    positions: npt.NDArray[np.int64]
    weights: Matrix | None


class Classifier(ClassifierMixin, BaseEstimator):
    """Base class of all classifiers. The parameters are those of the subclass's `__init__`."""

    _name: str
    #: keyword of the subclass -> parameter of the Rust side, where they differ
    _renamed: ClassVar[dict[str, str]] = {}
    _model: _core.TrainedModel
    #: the rows of `fit`; None if the model comes from a file
    _fitted_on: Fingerprints | None = None
    classes_: npt.NDArray[Any]
    n_features_in_: int
    feature_names_in_: npt.NDArray[np.object_]

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_model")

    def _parameters(self, classes: npt.NDArray[Any] | None) -> dict[str, Any]:
        """The parameters as the Rust side names them; `None` means its default."""
        result = {}
        for name, value in self.get_params().items():
            if name == "class_weight" and isinstance(value, dict):
                value = self._weights_of_classes(value, classes)
            elif name == "random_state":
                value = _seed(value)
            elif isinstance(value, np.generic):
                value = value.item()
            for number in value if isinstance(value, list) else [value]:
                if isinstance(number, float) and not math.isfinite(number):
                    raise ParameterError(
                        f"{type(self).__name__}: {name} must be a finite number, not {number}"
                    )
            if value is not None:
                result[self._renamed.get(name, name)] = value
        return result

    def _weights_of_classes(
        self, weights: dict[Any, Any], classes: npt.NDArray[Any] | None
    ) -> list[Any]:
        """A weight for each class; classes that are not named have 1."""
        known = [] if classes is None else classes.tolist()
        # As scikit-learn: names that y lacks are right if the others are all there, as for a fold
        # without one of the classes.
        strange = [name for name in weights if name not in known]
        if strange and not weights.keys() >= set(known):
            raise ParameterError(
                f"{type(self).__name__}: class_weight has {strange[0]!r}, which is no label in y:"
                f" expected some of {', '.join(map(repr, known[:10]))}"
            )
        return [weights.get(name, 1.0) for name in known]

    def fit(self, X: Any, y: Any) -> Self:
        """Trains on `X` [shape=(rows, features)] and `y`, one label per row."""
        self._fit(X, y, None)
        return self

    def _fit(self, X: Any, y: Any, sample_weight: Any) -> Learned:
        owner = type(self).__name__
        names = names_of(X)
        x = features(X, owner)
        classes, positions = labels_of(y, len(x), owner)
        weights = weights_of(sample_weight, len(x), owner)
        try:
            spec = _core.classifier_parameters(self._name, json.dumps(self._parameters(classes)))
        except TypeError as error:
            raise ParameterError(f"{owner}: a parameter has the wrong type: {error}") from error
        pipeline = {"classifier": {"name": self._name, "parameters": json.loads(spec)}}
        counts = np.bincount(positions).tolist()
        if len(classes) < 2 and self._name in ("svm", "logistic"):
            raise ParameterError(
                f"{owner} needs at least 2 classes, but y has only one class, {classes[0]!r}"
            )
        provenance = {"rows": len(x), "rows_per_class": counts, "label_kind": label_kind(classes)}
        try:
            self._model = _core.TrainedModel.fit(
                json.dumps(pipeline),
                x,
                positions.tolist(),
                [str(c) for c in classes.tolist()],
                "y",
                [] if names is None else names.tolist(),
                json.dumps(provenance),
                None if weights is None else weights.tolist(),
            )
        except ParameterError as error:
            size = f"n_samples = {x.shape[0]}, n_features = {x.shape[1]}"
            raise ParameterError(f"{owner}: {error} ({size})") from error
        self._fitted_on = fingerprints(x)
        self.classes_ = classes
        self.n_features_in_ = x.shape[1]
        self._column_labels = labels_of_columns(X)
        if names is not None:
            self.feature_names_in_ = names
        elif hasattr(self, "feature_names_in_"):
            del self.feature_names_in_
        return Learned(positions, weights)

    def _query(self, X: Any) -> Matrix:
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        names, known = labels_of_columns(X), getattr(self, "_column_labels", None)
        if known is None:
            known = getattr(self, "feature_names_in_", None)
        if names is not None and known is not None and names.tolist() != known.tolist():
            raise ParameterError(
                "The feature names should match those that were passed during fit: expected "
                f"{list(known)}, not {list(names)}"
            )
        x = features(X, type(self).__name__)
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

    def _decision_function(self, X: Any) -> Matrix:
        x = self._query(X)
        values = self._model.decision_function(x)
        return values[:, 0] if values.shape[1] == 1 else values

    def save(
        self,
        path: str | os.PathLike[str],
        *,
        features: Features | FeatureExtractor | None = None,
        overwrite: bool = True,
    ) -> None:
        """Writes the model file, completely or not at all.

        Parameters
        ----------
        path : path
            The file.
        features : Features or FeatureExtractor, optional
            Where the rows come from that the model was fitted on, unchanged: scaled rows are
            refused. With it, the model also takes recordings:
            `load_model(path).predict(["a.wav"])`, `corsmal-feat classify`.
        overwrite : bool
            Replace an existing file, as `numpy.save` does; False refuses it, as the command does.
        """
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        require_kept(self.classes_)
        target = destination(path, overwrite)
        self._model.save(target, None if features is None else self._made_of(features))

    def _made_of(self, features: Features | FeatureExtractor) -> str:
        """What a model file says about its features, as JSON."""
        try:
            made, given = features._made_of(), features._fingerprints()
        except AttributeError as error:
            raise ParameterError(
                f"features must be Features or a fitted FeatureExtractor, not {features!r}"
            ) from error
        # Other names or numbers of columns are refused when the file is written.
        if len(made["feature_names"]) == self.n_features_in_:
            check_rows(self._fitted_on, given)
        return json.dumps(made)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Reads a model file of this kind of classifier (`load_model` reads any)."""
        model = read_model(existing(path))
        header = json.loads(model.header())
        pipeline = header["pipeline"]
        spec = pipeline["classifier"]
        if spec["name"] != cls._name or pipeline["steps"]:
            steps = "+".join([s["name"] for s in pipeline["steps"]] + [spec["name"]])
            raise ModelError(f"{path} holds {steps}, not {cls._name}: use load_model")
        back = {new: old for old, new in cls._renamed.items()}
        params = {back.get(k, k): v for k, v in spec["parameters"].items()}
        classes = class_labels(header)
        if isinstance(params.get("class_weight"), list):
            # By name, for a later `fit` with other labels.
            params["class_weight"] = dict(
                zip(classes.tolist(), params["class_weight"], strict=True)
            )
        estimator = cls(**{k: v for k, v in params.items() if k in cls._get_param_names()})
        estimator._model = model
        estimator.classes_ = classes
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


class WeightedClassifier(Classifier):
    """A classifier that accepts weights of rows."""

    def fit(self, X: Any, y: Any, sample_weight: Any = None) -> Self:
        """Trains on `X` [shape=(rows, features)] and `y`, one label per row.

        `sample_weight` [shape=(rows,)] gives each row a weight of at least 0; a row of weight 0 is
        left out. By default, all rows weigh the same.
        """
        self._fit(X, y, sample_weight)
        return self


def _seed(value: Any) -> int:
    """A seed for the Rust side from scikit-learn's `random_state`."""
    if value is None:
        return 0
    if isinstance(value, np.random.RandomState):
        return int(value.randint(2**31 - 1))
    return size("random_state", value, 0)
