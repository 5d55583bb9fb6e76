"""A network as a scikit-learn classifier."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, size
from ._class_labels import class_labels, label_kind, require_kept
from ._network import settings
from ._refusals import destination, existing, seed_of
from ._sklearn import BaseEstimator, ClassifierMixin, not_fitted
from ._validation import labels_of
from ._warnings import warn
from .errors import DataTypeError, ParameterError

#: values of one input of all items, and where each item begins
_Column = tuple[npt.NDArray[np.float32], list[int]]


class NetworkClassifier(ClassifierMixin, BaseEstimator):
    """A network of the paper, or one of our own, trained with its published or default recipe.

    `X` is an array [items, ...] in the layout of `nets.build(network).forward`, or a list with one
    array per item, which may differ in length: [steps, features] for recurrent networks, and a list
    of four such arrays per item for M5's R(2+1)D networks.

    Parameters
    ----------
    network : one of `nets.names()`
    recipe : keys of the recipe to change, such as {"epochs": 3, "batch": 8}
    random_state : seed; None for that of the recipe
    checkpoint : file to which the training is saved after each epoch, and from which it continues
    progress : called with epochs done, total epochs, last loss, last score and seconds left

    Examples
    --------
    >>> x = np.random.default_rng(0).standard_normal((12, 9, 128)).astype(np.float32)
    >>> network = corsmal_feat.nets.NetworkClassifier("m5_vggish_type", recipe={"epochs": 1})
    >>> network.fit(x, ["rice", "water"] * 6).predict(x).shape
    (12,)
    """

    _model: _core.TrainedNetwork
    classes_: npt.NDArray[Any]
    history_: dict[str, Any]

    def __init__(
        self,
        network: str = "m5_vggish_level",
        *,
        recipe: dict[str, Any] | None = None,
        random_state: int | None = None,
        checkpoint: str | os.PathLike[str] | None = None,
        progress: Callable[[int, int, float | None, float | None, float], None] | None = None,
    ) -> None:
        self.network = network
        self.recipe = recipe
        self.random_state = random_state
        self.checkpoint = checkpoint
        self.progress = progress

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "_model")

    def fit(
        self, X: Any, y: Any, *, watched: Iterable[int] | npt.NDArray[Any] | None = None
    ) -> Self:
        """Trains on `X` and `y`, one label per item.

        `watched` are indices of items that are not used for training. Their score after each epoch
        is in `history_`. If the recipe's `select` is not "last", it chooses the epoch to keep; with
        "split", their loss does.
        """
        columns = self._columns(X)
        count = len(columns[0][1]) - 1
        classes, positions = labels_of(y, count, type(self).__name__)
        held = _watched(watched, count)
        rows = [i for i in range(count) if i not in held]
        learned = set(positions[rows].tolist())
        if unlearned := [str(c) for i, c in enumerate(classes.tolist()) if i not in learned]:
            names = ", ".join(unlearned)
            warn(f"all items of {names} are watched, so the network cannot learn them")
        changes = settings(self.recipe)
        if self.random_state is not None:
            changes["seed"] = seed_of(self.random_state)
        recipe = _core.network_recipe(self.network, json.dumps(changes))
        self._model = _core.TrainedNetwork.fit(
            self.network,
            columns,
            positions.tolist(),
            rows,
            sorted(held),
            [str(c) for c in classes.tolist()],
            recipe,
            None if self.checkpoint is None else os.fspath(self.checkpoint),
            json.dumps({"rows": len(rows), "label_kind": label_kind(classes)}),
            self.progress,
        )
        self.classes_ = classes
        self.history_ = json.loads(self._model.header())["history"]
        return self

    def predict_proba(self, X: Any) -> npt.NDArray[np.float64]:
        """Probabilities [shape=(items, classes)], columns in the order of `classes_`."""
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        probabilities: npt.NDArray[np.float64] = self._model.predict_proba(self._columns(X))
        # Networks compute in single precision.
        probabilities /= probabilities.sum(axis=1, keepdims=True)
        return probabilities

    def predict(self, X: Any) -> npt.NDArray[Any]:
        """The label of each item of `X`."""
        chosen = self.predict_proba(X).argmax(axis=1)
        labels: npt.NDArray[Any] = self.classes_[chosen]
        return labels

    def state_dict(self) -> dict[str, npt.NDArray[np.float32]]:
        """All trained parameters and running statistics, with PyTorch's names."""
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        return self._model.state()

    def save(self, path: str | os.PathLike[str], *, overwrite: bool = True) -> None:
        """Writes the model file, completely or not at all. It is a safetensors file.

        An existing file is replaced; `overwrite=False` refuses it.
        """
        if not hasattr(self, "_model"):
            raise not_fitted(self)
        require_kept(self.classes_)
        self._model.save(destination(path, overwrite))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Reads a model file."""
        model = _core.TrainedNetwork.load(existing(path))
        header = json.loads(model.header())
        estimator = cls(header["network"], recipe=header["recipe"])
        estimator._model = model
        estimator.classes_ = class_labels(header)
        estimator.history_ = header["history"]
        return estimator

    def _columns(self, X: Any) -> list[_Column]:
        inputs = _core.classifier_inputs(self.network)
        items = list(X)
        if not items:
            raise ParameterError("X is empty: at least one item is needed")
        if len(inputs) == 1:
            return [_column(items, self.network, inputs[0][1])]
        if any(len(item) != len(inputs) for item in items):
            raise ParameterError(
                f"{self.network}: each item of X must be {len(inputs)} arrays, one per input"
            )
        return [
            _column([item[k] for item in items], f"{self.network}, {name}", shape)
            for k, (name, shape) in enumerate(inputs)
        ]

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        if "_model" in state:
            state["_model"] = state["_model"].to_bytes()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        if "_model" in state:
            state = state | {"_model": _core.TrainedNetwork.from_bytes(state["_model"])}
        self.__dict__.update(state)


def _watched(watched: Iterable[int] | npt.NDArray[Any] | None, count: int) -> set[int]:
    """Indices of items, as a list or an array."""
    if watched is None:
        return set()
    given = watched.tolist() if isinstance(watched, np.ndarray) else watched
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise ParameterError(f"watched must hold indices of items, not {watched!r}")
    given = list(given)
    for index in given:
        if isinstance(index, int | float | np.number) and not 0 <= index < count:
            raise ParameterError(f"watched must hold indices of {count} items, not {index}")
    return {size("watched", i, 0) for i in given}


def _column(items: list[Any], place: str, shape: str) -> _Column:
    """Items one after another, images with channels last. `shape` is such as "steps x 128"."""
    expected = shape.split(" x ")
    arrays = []
    for number, item in enumerate(items):
        given_item = as_array(f"item {number} of X", item)
        if given_item.dtype.kind not in "fiub":
            raise DataTypeError(
                f"{place}: item {number} of X has dtype {given_item.dtype}, expected real numbers"
            )
        array = given_item.astype(np.float32, copy=False)
        known = [
            size if size == "steps" and given else str(given)
            for size, given in zip(expected, array.shape, strict=False)
        ]
        if array.ndim != len(expected) or known != expected:
            raise ParameterError(
                f"{place}: item {number} of X has shape {array.shape}, expected {shape}"
            )
        arrays.append((np.moveaxis(array, 0, -1) if array.ndim == 3 else array).ravel())
    offsets = np.concatenate([[0], np.cumsum([a.size for a in arrays])])
    return np.concatenate(arrays), offsets.astype(int).tolist()
