"""The networks of the paper: built, loaded, run and trained by the Rust side.

`build(name)` gives a network as published, with PyTorch's parameter names and layouts in
`state_dict` and `load_state_dict`. What each network is and where the published code differs from
the paper: docs/networks.md.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
import numpy.typing as npt

from . import _core
from ._refusals import refuses
from .errors import ParameterError

if TYPE_CHECKING:
    from ._network_classifier import NetworkClassifier

__all__ = [
    "Network",
    "NetworkClassifier",
    "TrainingSteps",
    "build",
    "names",
    "read_weights",
    "write_weights",
]

_Singles = npt.NDArray[np.float32]


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
def read_weights(path: str | os.PathLike[str]) -> dict[str, _Singles]:
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
def write_weights(path: str | os.PathLike[str], state: Mapping[str, Any]) -> None:
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

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
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
