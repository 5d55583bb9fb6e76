"""A network and its parameters."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import Singles, as_array, size
from ._refusals import refuses, seed_of
from .errors import ParameterError


class TrainingSteps(TypedDict):
    """The result of `Network.train_steps`."""

    losses: list[float]
    gradient_norms: dict[str, float]


class Network:
    """A network and its parameters; `build` returns one.

    Attributes
    ----------
    name : str
        Name of the network.
    num_parameters : int
        Number of trainable parameters.
    layers : list
        Layers in order, each with the shape of an item after it.

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
        """Name of the network."""
        return self._network.name()

    @property
    def num_parameters(self) -> int:
        """Number of trainable parameters."""
        return self._network.num_parameters()

    @property
    def layers(self) -> list[tuple[str, str]]:
        """Layers in order, each with the shape of an item after it."""
        return self._network.layers()

    def state_dict(self) -> dict[str, Singles]:
        """All parameters and running statistics, with PyTorch's names."""
        return self._network.state()

    @refuses
    def load_state_dict(self, state: Mapping[str, npt.ArrayLike]) -> None:
        """Replaces all parameters and running statistics.

        `num_batches_tracked` may be present. All other names and shapes must be those of this
        network: otherwise, a `ParameterError` lists all that differ, and nothing is changed.
        """
        self._network.load_state(
            [(str(name), single(value)) for name, value in state.items()],
        )

    @refuses
    def forward(self, *inputs: npt.ArrayLike, lengths: Sequence[int] | None = None) -> Singles:
        """Outputs [shape=(items, outputs)] in evaluation mode.

        Parameters
        ----------
        inputs : arrays in PyTorch's layouts: [items, channels, height, width], [items, steps,
            features] or [items, features]; four views as one array [items, 4, steps, features]
        lengths : number of steps of each item, if items are padded; without it, the network also
            processes the padding, as PyTorch does with a padded batch
        """
        return self._network.forward([single(x) for x in inputs], _lengths(lengths))

    @refuses
    def features(self, *inputs: npt.ArrayLike) -> Singles:
        """Inputs of the network's last layers [shape=(items, n)]."""
        return self._network.features([single(x) for x in inputs])

    @refuses
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
        inputs : as in `forward`, in a list
        y : class of each item (a whole number), or its target for a network that estimates numbers
        steps : number of steps
        recipe : "optimizer" ("adam" or "sgd"), "lr", and, if needed, "momentum", "weight_decay",
            "clip_grad_norm", "class_weights", "loss" ("cross_entropy" or "mse")
        dropout : whether dropout is active
        seed : seed of dropout
        lengths : number of steps of each item

        Returns
        -------
        loss before each step, and the norm of each parameter's gradient in the first step
        """
        arrays = [inputs] if isinstance(inputs, np.ndarray) else list(inputs)  # type: ignore[arg-type]
        targets = as_array("y", y)
        classes = numbers = None
        if targets.dtype.kind in "iub":
            if targets.ndim != 1 or (targets.size and targets.min() < 0):
                raise ParameterError("y must hold one class per item, a whole number of at least 0")
            classes = targets.tolist()
        else:
            numbers = targets.astype(np.float32).ravel().tolist()
        if steps < 0:
            raise ParameterError(f"steps must be at least 0, not {steps}")
        losses, norms = self._network.train_steps(
            [single(x) for x in arrays],
            classes,
            numbers,
            steps,
            json.dumps(settings(recipe)),
            seed_of(seed) if dropout else None,
            _lengths(lengths),
        )
        return {"losses": losses, "gradient_norms": norms}

    def __repr__(self) -> str:
        return f"<{self.name}: {self.num_parameters:,} parameters>"


def single(value: Any) -> Singles:
    """A contiguous array of finite numbers in single precision."""
    array = np.ascontiguousarray(as_array("inputs or weights", value, np.float32))
    if not np.isfinite(array).all():
        raise ParameterError("inputs and weights must be finite")
    return array


def _lengths(lengths: Sequence[int] | None) -> list[int] | None:
    return None if lengths is None else [size("lengths", n, 0) for n in lengths]


def settings(recipe: Mapping[str, Any] | None) -> dict[str, Any]:
    """Changes of a recipe in plain values."""
    if recipe is not None and not isinstance(recipe, Mapping):
        raise ParameterError(f"recipe must be a mapping of keys to values, not {recipe!r}")
    changes = dict(recipe or {})
    for key, value in changes.items():
        if isinstance(value, float | np.floating) and not math.isfinite(value):
            raise ParameterError(f"recipe: {key} must be a finite number, not {value}")
    try:
        text = json.dumps(changes, default=plain, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"recipe: {error}") from error
    plainly: dict[str, Any] = json.loads(text)
    return plainly


def plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise ParameterError(f"recipe must hold plain values, not {type(value).__name__}")
