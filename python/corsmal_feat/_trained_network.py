"""A trained network that classifies recordings."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._class_labels import class_labels
from ._extract import MOST_JOBS
from ._features import StrPath
from ._refusals import destination, refuses
from ._warnings import warn
from .errors import DecodeError, ParameterError


class TrainedNetwork:
    """A trained network that classifies recordings. `train` and `load` return one.

    Attributes
    ----------
    header : dict
        Description of the network in the file: name, recipe, history, features.
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
        self.classes_: npt.NDArray[Any] = class_labels(self.header)

    @refuses
    def predict_proba(
        self,
        recordings: Iterable[StrPath],
        *,
        any_rate: bool = False,
        jobs: int | None = None,
    ) -> npt.NDArray[np.float64]:
        """Probabilities of recordings; for a network on windows, the mean over the windows.

        Parameters
        ----------
        recordings : paths
            One path per recording; one may be named several times.
        any_rate : bool
            Whether to accept recordings with a sample rate or a number of channels that the network
            was not trained on.
        jobs : int, optional
            Number of recordings to read at a time; by default, one per core.

        Returns
        -------
        float64 [shape=(recordings, classes)], columns in the order of `classes_`

        Raises
        ------
        DecodeError : the network cannot classify a recording
        """
        paths = paths_of(recordings)
        once = list(dict.fromkeys(paths))
        proba, failed, strange = _core.hear_recordings(self._network, once, any_rate, jobs_of(jobs))
        if failed:
            raise DecodeError(f"{failed[0][0]}: {failed[0][1]}")
        if strange is not None:
            warn(strange)
        if len(once) == len(paths):
            return proba
        row_of = {path: row for row, path in enumerate(once)}
        return proba[[row_of[path] for path in paths]]

    @refuses
    def predict(
        self,
        recordings: Iterable[StrPath],
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
    def save(self, path: StrPath, *, overwrite: bool = True) -> None:
        """Writes the model file, completely or not at all; `corsmal-feat classify` reads it.

        An existing file is replaced; `overwrite=False` refuses it.
        """
        self._network.save(destination(path, overwrite))

    def __reduce__(self) -> tuple[Callable[[bytes], TrainedNetwork], tuple[bytes]]:
        return _of_bytes, (self._network.to_bytes(),)

    def __repr__(self) -> str:
        return f"<{self.header['network']}: {', '.join(map(str, self.classes_.tolist()))}>"


def _of_bytes(file: bytes) -> TrainedNetwork:
    return TrainedNetwork(_core.TrainedNetwork.from_bytes(file))


def paths_of(recordings: Iterable[StrPath]) -> list[str]:
    if isinstance(recordings, (str, os.PathLike)):
        return [os.fspath(recordings)]
    return [os.fspath(path) for path in recordings]


def jobs_of(jobs: int | None) -> int | None:
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise ParameterError(f"jobs must be 1 to {MOST_JOBS}, not {jobs}")
    return jobs
