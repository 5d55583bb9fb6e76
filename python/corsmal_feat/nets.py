"""The networks of the paper: built, loaded, run and trained by the Rust side.

`build(name)` gives a network as published, with PyTorch's parameter names and layouts in
`state_dict` and `load_state_dict`. `train` trains one on recordings, `load` reads a trained one,
and both give a `TrainedNetwork`, which hears recordings; `embed` gives the numbers that a network
makes of them. What each network is and where the published code differs from the paper:
docs/networks.md.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
import numpy.typing as npt

from . import _core
from ._extract import MOST_JOBS
from ._refusals import refuses
from ._scoring import CrossValidation, validated
from ._warnings import warn
from .errors import DecodeError, ParameterError

if TYPE_CHECKING:
    from ._network_classifier import NetworkClassifier

__all__ = [
    "Network",
    "NetworkClassifier",
    "TrainedNetwork",
    "TrainingSteps",
    "build",
    "cross_validate",
    "embed",
    "load",
    "names",
    "read_weights",
    "train",
    "write_weights",
]

_Singles = npt.NDArray[np.float32]
_Path = str | os.PathLike[str]


class TrainingSteps(TypedDict):
    """What `Network.train_steps` returns."""

    losses: list[float]
    gradient_norms: dict[str, float]


@refuses
def names() -> dict[str, str]:
    """The published networks.

    Returns
    -------
    dict
        By name a sentence about it.

    Examples
    --------
    >>> "m2_type" in corsmal_feat.nets.names()
    True
    """
    return dict(_core.networks_published())


@refuses
def build(name: str, *, outputs: int | None = None, seed: int = 0) -> Network:
    """The published network of this name; hyphen and underscore are equal.

    Parameters
    ----------
    name : str
        One of `names()`.
    outputs : int, optional
        Number of classes, where it is not the published one.
    seed : int
        Of the initial numbers.

    Returns
    -------
    Network

    Examples
    --------
    >>> corsmal_feat.nets.build("m3-mlp", outputs=4).forward(np.zeros((2, 6193))).shape
    (2, 4)
    """
    if outputs is not None and outputs < 1:
        raise ParameterError(f"outputs must be at least 1, not {outputs}")
    return Network(_core.Network.build(name, outputs, _seed(seed)))


@refuses
def train(
    name: str,
    recordings: Iterable[_Path],
    y: Sequence[object] | npt.NDArray[Any],
    *,
    groups: Sequence[object] | npt.NDArray[Any] | None = None,
    recipe: Mapping[str, Any] | None = None,
    checkpoints: _Path | None = None,
    progress: Callable[[int, int, float | None, float | None, float], object] | None = None,
    jobs: int | None = None,
) -> TrainedNetwork:
    """Trains a network on recordings, as `corsmal-feat train --net` does.

    A recording without features, or too short for the network, is left out with a warning.

    Parameters
    ----------
    name : str
        One of `names()` that takes recordings.
    recordings : paths
        One for each recording.
    y : array [shape=(recordings,)]
        Their labels.
    groups : array [shape=(recordings,)], optional
        What must not be split where the recipe holds out a validation group.
    recipe : mapping, optional
        Keys of the recipe that are not as published, such as {"epochs": 3, "seed": 1}.
    checkpoints : path, optional
        Folder that keeps the training after each epoch; the next training continues from there.
    progress : function, optional
        Called with epochs done, epochs in all, last loss, last score and seconds left.
    jobs : int, optional
        Recordings that are read at a time; one for each core by default.

    Returns
    -------
    TrainedNetwork

    Examples
    --------
    >>> paths = [f"audio/{kind}/{i}.wav" for kind in ("rice", "water") for i in range(6)]
    >>> network = corsmal_feat.nets.train(
    ...     "m1", paths, ["rice"] * 6 + ["water"] * 6, recipe={"epochs": 2}
    ... )
    >>> network.classes_.tolist()
    ['rice', 'water']
    """
    rows, kind = _rows(recordings, y, groups)
    network, left_out = _core.train_network(
        name, rows, kind, _recipe(name, recipe), _folder(checkpoints), progress, _jobs(jobs)
    )
    _tell_left_out(left_out, len(rows))
    return TrainedNetwork(network)


@refuses
def cross_validate(
    name: str,
    recordings: Iterable[_Path],
    y: Sequence[object] | npt.NDArray[Any],
    *,
    groups: Sequence[object] | npt.NDArray[Any] | None = None,
    cv: int | str | None = None,
    recipe: Mapping[str, Any] | None = None,
    checkpoints: _Path | None = None,
    progress: Callable[[int, int, float | None, float | None, float], object] | None = None,
    jobs: int | None = None,
) -> CrossValidation:
    """Scores a network on held-out recordings, as `corsmal-feat cross-validate --net` does.

    Parameters
    ----------
    name, recordings, y, recipe, progress, jobs
        See `train`; epochs are those of each fold.
    groups : array [shape=(recordings,)], optional
        What must not be split between training and test. Each is held out once, unless `cv` says
        otherwise.
    cv : int or str, optional
        Number of folds, or a plan on the column `groups`, such as "lists=1,4,7/2,5,8".
    checkpoints : path, optional
        Folder that keeps the training of each fold; the next validation continues from there.

    Returns
    -------
    CrossValidation

    Examples
    --------
    >>> paths = [f"audio/{kind}/{i}.wav" for kind in ("rice", "water") for i in range(6)]
    >>> result = corsmal_feat.nets.cross_validate(
    ...     "m1", paths, ["rice"] * 6 + ["water"] * 6, cv=2, recipe={"epochs": 20}
    ... )
    >>> result.accuracy["mean"], result.predictions.labels
    (1.0, ['rice', 'water'])
    """
    rows, _ = _rows(recordings, y, groups)
    text = _recipe(name, recipe)
    plan = None if cv is None else str(cv)
    report, held_out, odd, left_out = _core.cross_validate_network(
        name,
        rows,
        text,
        plan,
        json.loads(text)["seed"] % 2**32,
        _folder(checkpoints),
        progress,
        _jobs(jobs),
    )
    for warning in odd:
        warn(warning)
    _tell_left_out(left_out, len(rows))
    return validated(report, held_out)


@refuses
def load(path: _Path) -> TrainedNetwork:
    """Reads a trained network, of `corsmal-feat train --net` or of `save`.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    TrainedNetwork

    Examples
    --------
    >>> corsmal_feat.nets.load("pouring.safetensors").predict(["rice.wav", "water.wav"]).tolist()
    ['rice', 'water']
    """
    return TrainedNetwork(_core.TrainedNetwork.load(os.fspath(path)))


@refuses
def embed(
    name: str,
    recordings: Iterable[_Path],
    weights: _Path,
    *,
    jobs: int | None = None,
) -> dict[str, _Singles]:
    """The numbers that a network makes of recordings, as `corsmal-feat embed` does.

    A recording that has none is left out with a warning.

    Parameters
    ----------
    name : str
        A network that embeds: `vggish`.
    recordings : paths
        Files, folders, globs and manifests.
    weights : path
        Its weights, `.pth`, `.safetensors` or `.npz`.
    jobs : int, optional
        Recordings that are read at a time; one for each core by default.

    Returns
    -------
    dict
        By id the rows of a recording [shape=(rows, numbers)]; VGGish has a row of 128 numbers for
        each .96 s.

    Examples
    --------
    >>> corsmal_feat.nets.embed("m2-type", ["rice.wav"], "vggish.pth")
    Traceback (most recent call last):
    ...
    corsmal_feat.errors.ParameterError: m2_type gives classes, not embeddings: use vggish, or \
`corsmal-feat classify` for classes
    """
    rows, failed = _core.embed_recordings(name, _paths(recordings), os.fspath(weights), _jobs(jobs))
    if failed:
        more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        warn(f"left out: {failed[0][0]}: {failed[0][1]}{more}")
    return dict(rows)


@refuses
def read_weights(path: _Path) -> dict[str, _Singles]:
    """Reads weights; nothing in the file is run.

    Parameters
    ----------
    path : path
        `.npz`, `.safetensors` or `.pth`.

    Returns
    -------
    dict
        By name the numbers.

    Examples
    --------
    >>> corsmal_feat.nets.write_weights("one.safetensors", {"bias": np.ones(3)})
    >>> corsmal_feat.nets.read_weights("one.safetensors")["bias"].tolist()
    [1.0, 1.0, 1.0]
    """
    return _core.read_weights(os.fspath(path))


@refuses
def write_weights(path: _Path, state: Mapping[str, npt.ArrayLike]) -> None:
    """Writes weights, whole or not at all.

    Parameters
    ----------
    path : path
        `.npz` or `.safetensors`.
    state : mapping
        By name the numbers, such as a network's `state_dict()`.

    Examples
    --------
    >>> corsmal_feat.nets.write_weights("ones.npz", {"bias": np.ones(3)})
    """
    _core.write_weights(os.fspath(path), [(str(k), _single(v)) for k, v in state.items()])


class TrainedNetwork:
    """A trained network that hears recordings. `train` and `load` give one.

    Attributes
    ----------
    header : dict
        What the file says about the network: name, recipe, history, features.
    classes_ : array
        Labels, in the order of `predict_proba`.

    Examples
    --------
    >>> network = corsmal_feat.nets.load("pouring.safetensors")
    >>> network
    <m1: rice, water>
    >>> network.predict_proba(["rice.wav", "water.wav"]).argmax(axis=1).tolist()
    [0, 1]
    """

    def __init__(self, network: _core.TrainedNetwork) -> None:
        self._network = network
        self.header: dict[str, Any] = json.loads(network.header())
        # With scikit-learn, whose import takes a second.
        labels = import_module("._classifier", __package__).class_labels
        self.classes_: npt.NDArray[Any] = labels(self.header)

    @refuses
    def predict_proba(
        self,
        recordings: Iterable[_Path],
        *,
        any_rate: bool = False,
        jobs: int | None = None,
    ) -> npt.NDArray[np.float64]:
        """Probabilities of recordings; the mean of their windows, where the network takes windows.

        Parameters
        ----------
        recordings : paths
            One for each recording.
        any_rate : bool
            Take recordings of a sample rate or with channels that the network was not trained on.
        jobs : int, optional
            Recordings that are read at a time; one for each core by default.

        Returns
        -------
        float64 [shape=(recordings, classes)], columns in the order of `classes_`

        Raises
        ------
        DecodeError : a recording that the network cannot hear
        """
        paths = _paths(recordings)
        proba, failed = _core.hear_recordings(self._network, paths, any_rate, _jobs(jobs))
        if failed:
            raise DecodeError(f"{failed[0][0]}: {failed[0][1]}")
        return proba

    @refuses
    def predict(
        self,
        recordings: Iterable[_Path],
        *,
        any_rate: bool = False,
        jobs: int | None = None,
    ) -> npt.NDArray[Any]:
        """The label of each recording.

        Parameters
        ----------
        recordings, any_rate, jobs
            See `predict_proba`.

        Returns
        -------
        labels [shape=(recordings,)]
        """
        proba = self.predict_proba(recordings, any_rate=any_rate, jobs=jobs)
        labels: npt.NDArray[Any] = self.classes_[proba.argmax(axis=1)]
        return labels

    @refuses
    def save(self, path: _Path) -> None:
        """Writes the model file, whole or not at all; `corsmal-feat classify` takes it."""
        self._network.save(os.fspath(path))

    def __reduce__(self) -> tuple[Callable[[bytes], TrainedNetwork], tuple[bytes]]:
        return _of_bytes, (self._network.to_bytes(),)

    def __repr__(self) -> str:
        return f"<{self.header['network']}: {', '.join(map(str, self.classes_.tolist()))}>"


def _of_bytes(file: bytes) -> TrainedNetwork:
    return TrainedNetwork(_core.TrainedNetwork.from_bytes(file))


class Network:
    """A network with its numbers. `build` makes one.

    Attributes
    ----------
    name : str
        Its name.
    num_parameters : int
        Numbers that training changes.
    layers : list
        Layers in their order, each with the shape of an item after it.

    Examples
    --------
    >>> network = corsmal_feat.nets.build("m3-mlp", seed=1)
    >>> network.name, network.num_parameters
    ('m3_mlp', 20763827)
    """

    def __init__(self, network: _core.Network) -> None:
        self._network = network

    @property
    def name(self) -> str:
        """Its name."""
        return self._network.name()

    @property
    def num_parameters(self) -> int:
        """Numbers that training changes."""
        return self._network.num_parameters()

    @property
    def layers(self) -> list[tuple[str, str]]:
        """Layers in their order, each with the shape of an item after it."""
        return self._network.layers()

    def state_dict(self) -> dict[str, _Singles]:
        """All numbers under PyTorch's names, running statistics included."""
        return self._network.state()

    def load_state_dict(self, state: Mapping[str, npt.ArrayLike]) -> None:
        """Replaces all numbers.

        `num_batches_tracked` may be there. Every other name and shape must be this network's: a
        `ParameterError` lists all that are not, and changes nothing.
        """
        self._network.load_state(
            [(str(name), _single(value)) for name, value in state.items()],
        )

    def forward(self, *inputs: npt.ArrayLike, lengths: Sequence[int] | None = None) -> _Singles:
        """Outputs [shape=(items, outputs)] in evaluation mode.

        Parameters
        ----------
        inputs : arrays in PyTorch's layouts: [items, channels, height, width], [items, steps,
            numbers] or [items, numbers]; four views as one array [items, 4, steps, numbers]
        lengths : steps of each item, where items were padded; without it the network runs through
            the padding, as PyTorch's does on a padded batch
        """
        return self._network.forward([_single(x) for x in inputs], _lengths(lengths))

    def features(self, *inputs: npt.ArrayLike) -> _Singles:
        """What the network's last layers work on [shape=(items, n)]."""
        return self._network.features([_single(x) for x in inputs])

    def train_steps(
        self,
        inputs: npt.ArrayLike | Sequence[npt.ArrayLike],
        y: npt.ArrayLike,
        steps: int,
        recipe: Mapping[str, Any],
        *,
        dropout: bool = True,
        seed: int = 0,
        lengths: Sequence[int] | None = None,
    ) -> TrainingSteps:
        """Trains for a few steps over the whole batch.

        Parameters
        ----------
        inputs : as those of `forward`, in a list
        y : a class for each item (whole numbers), or numbers for a network that estimates
        steps : how many
        recipe : "optimizer" ("adam" or "sgd"), "lr", and where needed "momentum", "weight_decay",
            "clip_grad_norm", "class_weights", "loss" ("cross_entropy" or "mse")
        dropout : whether dropout works
        seed : of dropout
        lengths : steps of each item

        Returns
        -------
        losses before each step, and the norm of each parameter's gradient at the first
        """
        arrays = [inputs] if isinstance(inputs, np.ndarray) else list(inputs)  # type: ignore[arg-type]
        targets = np.asarray(y)
        classes = numbers = None
        if targets.dtype.kind in "iub":
            if targets.ndim != 1 or (targets.size and targets.min() < 0):
                raise ParameterError("y: classes are one whole number from 0 for each item")
            classes = targets.tolist()
        else:
            numbers = targets.astype(np.float32).ravel().tolist()
        if steps < 0:
            raise ParameterError(f"steps must be at least 0, not {steps}")
        losses, norms = self._network.train_steps(
            [_single(x) for x in arrays],
            classes,
            numbers,
            steps,
            json.dumps(dict(recipe), default=_plain),
            _seed(seed) if dropout else None,
            _lengths(lengths),
        )
        return {"losses": losses, "gradient_norms": norms}

    def __repr__(self) -> str:
        return f"<{self.name}: {self.num_parameters:,} parameters>"


def _single(value: Any) -> _Singles:
    """A contiguous array in single precision, of finite numbers."""
    array = np.ascontiguousarray(value, dtype=np.float32)
    if not np.isfinite(array).all():
        raise ParameterError("inputs and weights must be finite numbers")
    return array


def _paths(recordings: Iterable[_Path]) -> list[str]:
    if isinstance(recordings, (str, os.PathLike)):
        return [os.fspath(recordings)]
    return [os.fspath(path) for path in recordings]


def _rows(
    recordings: Iterable[_Path],
    y: Sequence[object] | npt.NDArray[Any],
    groups: Sequence[object] | npt.NDArray[Any] | None,
) -> tuple[list[tuple[str, str, str | None]], str]:
    """Path, label and group of each recording, and the kind of the labels."""
    paths, labels = _paths(recordings), np.asarray(y)
    of_group = None if groups is None else np.asarray(groups)
    for what, values in (("y", labels), ("groups", of_group)):
        if values is not None and values.shape != (len(paths),):
            raise ParameterError(
                f"{what} must have a value for each of the {len(paths)} recordings,"
                f" not shape {values.shape}"
            )
    names = [str(label) for label in labels.tolist()]
    parts = [None] * len(paths) if of_group is None else [str(g) for g in of_group.tolist()]
    return list(zip(paths, names, parts, strict=True)), labels.dtype.kind


def _recipe(name: str, recipe: Mapping[str, Any] | None) -> str:
    return _core.network_recipe(name, json.dumps(dict(recipe or {}), default=_plain))


def _folder(checkpoints: _Path | None) -> str | None:
    if checkpoints is None:
        return None
    os.makedirs(checkpoints, exist_ok=True)
    return os.fspath(checkpoints)


def _tell_left_out(left_out: list[tuple[str, str]], count: int) -> None:
    if left_out:
        warn(
            f"{len(left_out)} of {count} recordings are left out, the first:"
            f" {left_out[0][0]}: {left_out[0][1]}"
        )


def _jobs(jobs: int | None) -> int | None:
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise ParameterError(f"jobs must be 1 to {MOST_JOBS}, not {jobs}")
    return jobs


def _lengths(lengths: Sequence[int] | None) -> list[int] | None:
    return None if lengths is None else [int(n) for n in lengths]


def _seed(seed: int) -> int:
    if not 0 <= seed < 1 << 64:
        raise ParameterError(f"seed must be 0 to 2**64 - 1, not {seed}")
    return int(seed)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise ParameterError(f"a recipe cannot hold a {type(value).__name__}")


def __getattr__(name: str) -> Any:
    # The estimator is scikit-learn's where that is installed, and importing it takes a second.
    if name != "NetworkClassifier":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module("._network_classifier", __package__).NetworkClassifier
