"""The networks of the paper and our own: built, loaded, run and trained by the Rust side.

`build(name)` returns a network, with PyTorch's parameter names and layouts in
`state_dict` and `load_state_dict`. `train` trains a network on recordings, and `load` reads a
trained one: both return a `TrainedNetwork`, which classifies recordings. `embed` computes
embeddings of recordings. docs/networks.md describes each network and where the published code
differs from the paper.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from . import _core
from ._arrays import Singles, as_array
from ._class_labels import check_named, label_kind
from ._features import StrPath
from ._network import Network, TrainingSteps, settings, single
from ._refusals import existing, refuses, seed_of
from ._scoring import CrossValidation, validated
from ._trained_network import TrainedNetwork, jobs_of, paths_of
from ._warnings import warn
from .errors import ParameterError

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


@refuses
def names() -> dict[str, str]:
    """The networks.

    Returns
    -------
    dict
        A description of each network, by name.

    Examples
    --------
    >>> "m2_type" in corsmal_feat.nets.names()
    True
    """
    return dict(_core.networks_published())


@refuses
def build(name: str, *, outputs: int | None = None, seed: int = 0) -> Network:
    """Builds a network by name; a hyphen is the same as an underscore.

    Parameters
    ----------
    name : str
        One of `names()`.
    outputs : int, optional
        Number of classes; by default, the published one (`attention_gru`: 3, `mel_cnn`: 4).
    seed : int
        Seed of the initial parameters.

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
    return Network(_core.Network.build(name, outputs, seed_of(seed)))


@refuses
def train(
    name: str,
    recordings: Iterable[StrPath],
    y: Sequence[object] | npt.NDArray[Any],
    *,
    groups: Sequence[object] | npt.NDArray[Any] | None = None,
    recipe: Mapping[str, Any] | None = None,
    checkpoints: StrPath | None = None,
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
        One path per recording.
    y : array [shape=(recordings,)]
        Label of each recording.
    groups : array [shape=(recordings,)], optional
        Group of each recording; groups are not split if the recipe holds out a validation group.
    recipe : mapping, optional
        Keys of the recipe to change from the published values, such as {"epochs": 3, "seed": 1}.
    checkpoints : path, optional
        Folder in which to save the training after each epoch; the next training continues from
        there.
    progress : function, optional
        Called with epochs done, total epochs, last loss, last score and seconds left.
    jobs : int, optional
        Number of recordings to read at a time; by default, one per core.

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
    network, odd, left_out = _core.train_network(
        name, rows, kind, _recipe(name, recipe), _folder(checkpoints), progress, jobs_of(jobs)
    )
    for warning in odd:
        warn(warning)
    _tell_left_out(left_out, len(rows))
    return TrainedNetwork(network)


@refuses
def cross_validate(
    name: str,
    recordings: Iterable[StrPath],
    y: Sequence[object] | npt.NDArray[Any],
    *,
    groups: Sequence[object] | npt.NDArray[Any] | None = None,
    cv: int | str | None = None,
    recipe: Mapping[str, Any] | None = None,
    checkpoints: StrPath | None = None,
    progress: Callable[[int, int, float | None, float | None, float], object] | None = None,
    jobs: int | None = None,
) -> CrossValidation:
    """Scores a network on held-out recordings, as `corsmal-feat cross-validate --net` does.

    Parameters
    ----------
    name, recordings, y, recipe, progress, jobs
        See `train`; `progress` counts the epochs of each fold.
    groups : array [shape=(recordings,)], optional
        Group of each recording; groups are not split between training and test. Each group is held
        out once, unless `cv` says otherwise.
    cv : int or str, optional
        Number of folds, or a plan on the column `groups`, such as "lists=1,4,7/2,5,8".
    checkpoints : path, optional
        Folder in which to save the training of each fold; the next validation continues from there.

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
        jobs_of(jobs),
    )
    for warning in odd:
        warn(warning)
    _tell_left_out(left_out, len(rows))
    return validated(report, held_out)


@refuses
def load(path: StrPath) -> TrainedNetwork:
    """Reads a trained network, written by `corsmal-feat train --net` or `save`.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    TrainedNetwork

    Raises
    ------
    MissingFileError
        There is no such file.
    ModelError
        It is no trained network, or damaged.

    Examples
    --------
    >>> corsmal_feat.nets.load("pouring.safetensors").predict(["rice.wav", "water.wav"]).tolist()
    ['rice', 'water']
    """
    return TrainedNetwork(_core.TrainedNetwork.load(existing(path)))


@refuses
def embed(
    name: str,
    recordings: Iterable[StrPath],
    weights: StrPath,
    *,
    jobs: int | None = None,
) -> dict[str, Singles]:
    """Computes embeddings of recordings, as `corsmal-feat embed` does.

    A recording without an embedding is left out with a warning.

    Parameters
    ----------
    name : str
        A network that computes embeddings: `vggish`.
    recordings : paths
        Files, folders, globs and manifests.
    weights : path
        Weights of the network: `.pth`, `.safetensors` or `.npz`.
    jobs : int, optional
        Number of recordings to read at a time; by default, one per core.

    Returns
    -------
    dict
        Embeddings [shape=(rows, numbers)] of each recording by id; VGGish gives a row of 128
        numbers for each 0.96 s.

    Examples
    --------
    >>> corsmal_feat.nets.write_weights("one.safetensors", {"bias": np.ones(3)})
    >>> corsmal_feat.nets.embed("m2-type", ["rice.wav"], "one.safetensors")
    Traceback (most recent call last):
    ...
    corsmal_feat.errors.ParameterError: m2_type gives classes, not embeddings; vggish gives embeddings
    """  # noqa: E501
    rows, failed = _core.embed_recordings(
        name, paths_of(recordings), existing(weights), jobs_of(jobs)
    )
    if failed:
        more = f" (and {len(failed) - 1} more)" if len(failed) > 1 else ""
        warn(f"left out: {failed[0][0]}: {failed[0][1]}{more}")
    return dict(rows)


@refuses
def read_weights(path: StrPath) -> dict[str, Singles]:
    """Reads a file of weights; no code in it is executed.

    Parameters
    ----------
    path : path
        `.npz`, `.safetensors` or `.pth`.

    Returns
    -------
    dict
        Arrays by name.

    Raises
    ------
    MissingFileError
        There is no such file.
    ModelError
        It holds no weights.

    Examples
    --------
    >>> corsmal_feat.nets.write_weights("one.safetensors", {"bias": np.ones(3)})
    >>> corsmal_feat.nets.read_weights("one.safetensors")["bias"].tolist()
    [1.0, 1.0, 1.0]
    """
    return _core.read_weights(existing(path))


@refuses
def write_weights(path: StrPath, state: Mapping[str, npt.ArrayLike]) -> None:
    """Writes a file of weights, completely or not at all.

    Parameters
    ----------
    path : path
        `.npz` or `.safetensors`.
    state : mapping
        Arrays by name, such as a network's `state_dict()`.

    Examples
    --------
    >>> corsmal_feat.nets.write_weights("ones.npz", {"bias": np.ones(3)})
    """
    _core.write_weights(os.fspath(path), [(str(k), single(v)) for k, v in state.items()])


def _rows(
    recordings: Iterable[StrPath],
    y: Sequence[object] | npt.NDArray[Any],
    groups: Sequence[object] | npt.NDArray[Any] | None,
) -> tuple[list[tuple[str, str, str | None]], str]:
    """Path, label and group of each recording, and the kind of the labels."""
    paths, labels = paths_of(recordings), as_array("y", y)
    of_group = None if groups is None else as_array("groups", groups)
    for what, given, values in (("y", y, labels), ("groups", groups, of_group)):
        if values is not None and values.shape != (len(paths),):
            raise ParameterError(
                f"{what} has shape {values.shape}, expected one value for each of the"
                f" {len(paths)} recordings"
            )
        if values is not None:
            check_named(what, given, values, "nets")
    kind = label_kind(labels)
    # "1.0" is no name of a class.
    are_whole = kind == "f" and all(float(label).is_integer() for label in labels.tolist())
    names = [str(int(label) if are_whole else label) for label in labels.tolist()]
    parts = [None] * len(paths) if of_group is None else [str(g) for g in of_group.tolist()]
    return list(zip(paths, names, parts, strict=True)), kind


def _recipe(name: str, recipe: Mapping[str, Any] | None) -> str:
    return _core.network_recipe(name, json.dumps(settings(recipe)))


def _folder(checkpoints: StrPath | None) -> str | None:
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


def __getattr__(name: str) -> Any:
    # The estimator imports scikit-learn where it is installed, which takes a second.
    if name != "NetworkClassifier":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module("._network_classifier", __package__).NetworkClassifier
