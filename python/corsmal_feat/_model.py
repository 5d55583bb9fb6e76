"""Model files of any classifier."""

from __future__ import annotations

import json
import os
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core
from ._class_labels import class_labels
from ._extract import extract
from ._features import GOOD, Features, lengths
from ._formats import mismatch
from ._refusals import existing, refuses
from ._validation import Matrix, features, names_of
from ._warnings import warn
from .errors import DecodeError, ModelError, ParameterError


class TrainedModel:
    """A model of any classifier: steps, classifier, labels and the features it was trained on.

    Attributes
    ----------
    path : str
        The file.
    header : dict
        Description of the model in the file.
    classes_ : array
        Labels, in the order of `predict_proba`.
    n_features_in_ : int
        Number of features per row.

    Examples
    --------
    >>> model = corsmal_feat.load_model("bottles.model")
    >>> model.n_features_in_, model.classes_.tolist(), model.has_probabilities()
    (26, ['rice', 'water'], True)
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = existing(path)
        self._model = read_model(self.path)
        self.header: dict[str, Any] = json.loads(self._model.header())
        self.classes_ = class_labels(self.header)
        self.n_features_in_ = self._model.n_features()

    def __reduce__(self) -> tuple[type[TrainedModel], tuple[str]]:
        # Other processes read the file again.
        return TrainedModel, (os.path.abspath(self.path),)

    def __repr__(self) -> str:
        classifier = self.header["pipeline"]["classifier"]["name"]
        wanted = ", ".join(map(str, self.classes_[:4].tolist()))
        more = ", ..." if len(self.classes_) > 4 else ""
        of = "recordings" if self.feature_config else "rows"
        return (
            f"<TrainedModel {self.path}: {classifier} of {self.n_features_in_} features of {of},"
            f" {len(self.classes_)} classes ({wanted}{more})>"
        )

    @property
    def feature_config(self) -> dict[str, Any] | None:
        """The full configuration of the features; None if the model was trained on other rows."""
        config: dict[str, Any] | None = self.header["feature_config"]
        return config

    @refuses
    def predict(self, X: Any, *, any_rate: bool = False) -> npt.NDArray[Any]:
        """The label of each row, or of each recording.

        Parameters
        ----------
        X : array [shape=(rows, features)], Features, path, or list of paths
            Rows of features or, for a model that knows its features, what `extract` returned or
            recordings. Columns of a data frame must have the names of the training.
        any_rate : bool
            Whether to accept recordings with a sample rate or a number of channels that the model
            was not trained on.

        Returns
        -------
        labels [shape=(rows,)]

        Raises
        ------
        DecodeError : a recording has no features
        ParameterError : rows or recordings do not fit the model
        """
        return self.classes_[self._model.predict(self._rows(X, any_rate))]

    @refuses
    def predict_proba(self, X: Any, *, any_rate: bool = False) -> Matrix:
        """Probabilities of rows or recordings.

        Parameters
        ----------
        X, any_rate
            See `predict`.

        Returns
        -------
        float64 [shape=(rows, classes)], columns in the order of `classes_`
        """
        return self._model.predict_proba(self._rows(X, any_rate))

    def has_probabilities(self) -> bool:
        """Whether `predict_proba` is available."""
        try:
            self._model.predict_proba(np.zeros((1, self.n_features_in_)))
        except ParameterError:
            return False
        return True

    def refusal(self, sample_rate: int | None, channels: int | None) -> str | None:
        """Why the model refuses a recording of this format; None if it accepts it."""
        try:
            rates, known_channels = self._model.format_rule()
        except ModelError as error:
            raise ModelError(
                f"{self.path} does not say which sample rates and channels it was trained on:"
                " train it again, or pass any_rate=True to accept all recordings"
            ) from error
        return mismatch((sample_rate, channels), rates, known_channels, self.path)

    def _rows(self, X: Any, any_rate: bool) -> Matrix:
        if isinstance(X, (str, os.PathLike)):
            X = [X]
        if isinstance(X, (list, tuple)) and not X:
            raise ParameterError("X is empty: at least one row or recording is needed")
        if getattr(X, "ndim", 2) == 1 and not np.issubdtype(np.asarray(X).dtype, np.number):
            X = list(X)  # an array or a pandas Series of paths
        if isinstance(X, (list, tuple)) and X and isinstance(X[0], (str, os.PathLike)):
            strange = [path for path in X if not isinstance(path, (str, os.PathLike))]
            if strange:
                raise ParameterError(f"X mixes paths and others: {strange[0]!r} is not a path")
            return self._of_recordings([os.fspath(path) for path in X], any_rate)
        if isinstance(X, Features):
            X = self._summary(X, any_rate)
        names, known = names_of(X), self.header["feature_names"]
        if names is not None and known and len(names) == len(known):
            apart = [i for i, name in enumerate(known) if names[i] != name]
            if apart:
                raise ParameterError(
                    f"column {apart[0]} of X must be {known[apart[0]]}, as in the training of"
                    f" {self.path}, not {names[apart[0]]}"
                )
        rows = features(X, "TrainedModel")
        if rows.shape[1] != self.n_features_in_:
            raise ParameterError(
                f"X has {rows.shape[1]} features, but {self.path} was trained on"
                f" {self.n_features_in_}"
            )
        return rows

    def _summary(self, given: Features, any_rate: bool) -> npt.NDArray[np.float32]:
        """The rows of an extraction by the configuration of the training."""
        if given.summary is None:
            raise ParameterError("X holds frames, but rows of statistics are needed: see `summary`")
        if given.config_hash and not self.feature_config:
            raise ParameterError(
                f"{self.path} holds no feature configuration, so nothing says whether X fits it: if"
                " you know that it does, give the rows alone, X.summary"
            )
        if given.config_hash != self.header["feature_config_hash"]:
            raise ParameterError(
                f"X was extracted by another configuration than the rows that {self.path} was"
                " trained on, or does not say by which: extract with config=model.feature_config"
            )
        if self.header["feature_names"] not in ([], given.names):
            raise ParameterError(
                f"X has other features, or in another order, than {self.path} was trained on"
            )
        self._check_heard([row for row in given.outcomes if row["status"] in GOOD], any_rate)
        return given.summary

    def _of_recordings(self, paths: list[str], any_rate: bool) -> Matrix:
        if not self.feature_config:
            raise ModelError(
                f"{self.path} holds no feature configuration, so it cannot predict recordings: save"
                " it with save(path, features=...)"
            )
        # The same file may be in X twice.
        different = list(dict.fromkeys(paths))
        with warnings.catch_warnings():
            # Of mixed sample rates: what the model takes of them is checked below.
            warnings.simplefilter("ignore")
            found = extract(different, config=self.feature_config)
        if len(found.outcomes) != len(different):
            raise ParameterError("X holds folders, globs or manifests: name each recording")
        repaired: list[str] = []
        for path, outcome in zip(different, found.outcomes, strict=True):
            if outcome["status"] not in GOOD:
                raise DecodeError(f"{path}: {outcome['status']}: {outcome['reason']}")
            if repairs := ", ".join(outcome.get("repairs", ())):
                reason = f": {outcome['reason']}" if outcome["reason"] else ""
                repaired.append(f"{path}: repaired ({repairs}){reason}")
        if repaired:
            others = len(repaired) - 1
            were = "was" if others == 1 else "were"
            warn(repaired[0] + (f"; {others} more {were} repaired" if others else ""))
        self._check_heard(found.outcomes, any_rate)
        if found.summary is None or len(found.names) != self.n_features_in_:
            raise ParameterError(
                f"X gives {len(found.names)} values per recording, but {self.path} was trained on"
                f" {self.n_features_in_}: does the number of channels differ?"
            )
        if self.header["feature_names"] not in ([], found.names):
            raise ModelError(
                f"{self.path} was trained on features with other names, or in another order, than"
                " those of a recording: train it on all columns as corsmal_feat wrote them"
            )
        if found.config_hash != self.header["feature_config_hash"]:
            raise ModelError(
                f"{self.path} was trained with version {self.header['tool_version']}, and this"
                " version computes other features from its configuration: extract and train again"
            )
        row_of = dict(zip(different, found.summary.astype(np.float64), strict=True))
        return np.stack([row_of[path] for path in paths])

    def _check_heard(self, outcomes: list[dict[str, Any]], any_rate: bool) -> None:
        """Refuses recordings in a format that changes their features; warns of strange lengths."""
        for row in [] if any_rate else outcomes:
            reason = self.refusal(row.get("sample_rate"), row.get("channels"))
            if reason is not None:
                advice = (
                    "average the channels of the file first, or extract and train with"
                    ' set={"signal.channels": "mean"}'
                    if "channel" in reason
                    else "any_rate=True accepts it as it is"
                )
                raise ParameterError(f"{row['path']}: {reason}; {advice}")
        strange = self._model.length_warning(lengths(outcomes))
        if strange is not None:
            warn(strange)


@refuses
def load_model(path: str | os.PathLike[str]) -> TrainedModel:
    """Reads the model file of any classifier, written by `corsmal-feat train` or `save`.

    Parameters
    ----------
    path : path
        The file.

    Returns
    -------
    TrainedModel

    Examples
    --------
    >>> model = corsmal_feat.load_model("bottles.model")
    >>> model
    <TrainedModel bottles.model: rf of 26 features of recordings, 2 classes (rice, water)>
    >>> model.predict(["rice.wav", "water.wav"]).tolist()
    ['rice', 'water']
    """
    return TrainedModel(path)


def read_model(path: str) -> _core.TrainedModel:
    """What the extension module makes of a model file; one of a network is told apart."""
    try:
        return _core.TrainedModel.load(path)
    except ModelError as error:
        if _holds_network(path):
            raise ModelError(f"{path} holds a network: use nets.load") from error
        raise


def _holds_network(path: str) -> bool:
    try:
        _core.TrainedNetwork.load(path)
    except (ParameterError, ModelError, OSError):
        return False
    return True
