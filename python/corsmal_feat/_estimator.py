"""Features as a scikit-learn transformer."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Self

import numpy as np
import numpy.typing as npt

from . import _core
from ._extract import MOST_JOBS, Config, configuration, extract, interleaved, whole_rate
from ._features import GOOD
from ._refusals import refuses
from ._sklearn import BaseEstimator, TransformerMixin, not_fitted
from ._warnings import warn
from .errors import DataTypeError, DecodeError, ParameterError

__all__ = ["FeatureExtractor"]

Matrix = npt.NDArray[np.float32]


class FeatureExtractor(TransformerMixin, BaseEstimator):
    """Turns recordings into rows of features: the first step of a scikit-learn `Pipeline`.

    Each row is the summary of a recording, so the configuration needs one (`preset="esc26"`,
    "esc28", "mfcc-zcr", or your own [summary]). It also works without scikit-learn.

    Parameters
    ----------
    preset, config, set : see `corsmal_feat.extract`; preset is "esc26" if no config is given
    sr : sample rate of signals in memory in Hz; not used for files
    jobs : worker threads; by default one per core
    errors : what to do with a file without features: "raise" a `DecodeError`, or "nan" for a row
        of NaN and a warning
    progress : whether to show on standard error how many files are done

    Rows to transform are paths, or signals in memory: a list of float arrays, each [shape=(n,) or
    (channels, n)], or one array [shape=(recordings, n) or (recordings, channels, n)].

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> model = make_pipeline(corsmal_feat.FeatureExtractor("esc26"), corsmal_feat.KNN(1))
    >>> model.fit(["rice.wav", "water.wav"], ["rice", "water"]).predict(["water.wav"]).tolist()
    ['water']
    """

    def __init__(
        self,
        preset: str | None = None,
        *,
        config: Config | None = None,
        set: Mapping[str, Any] | None = None,
        sr: float | None = None,
        jobs: int | None = None,
        errors: str = "raise",
        progress: bool = False,
    ) -> None:
        self.preset = preset
        self.config = config
        self.set = set
        self.sr = sr
        self.jobs = jobs
        self.errors = errors
        self.progress = progress

    _names: list[str] | None = None
    #: sample rates and channels of the recordings that it was fitted on
    _formats: list[tuple[int, int]]

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.three_d_array = tags.input_tags.string = True
        tags.transformer_tags.preserves_dtype = []
        tags.requires_fit = False
        return tags

    def __sklearn_is_fitted__(self) -> bool:
        return True

    @refuses
    def fit(self, X: Any, y: Any = None) -> Self:
        """Learns the names of the columns, including channels, from the first recording of `X`."""
        recordings = _recordings(X)
        for position, recording in enumerate(recordings):
            if not _is_path(recording):
                _signal(recording, position)
        self._names, _ = self._compute(recordings[:1])
        self._formats = self._formats_of(recordings)
        return self

    @refuses
    def fit_transform(self, X: Any, y: Any = None) -> Matrix:
        """`fit(X).transform(X)`."""
        recordings = _recordings(X)
        self._names, matrix = self._compute(recordings)
        self._formats = self._formats_of(recordings)
        return matrix

    @refuses
    def transform(self, X: Any) -> Matrix:
        """Features [shape=(recordings, values)] of the recordings `X`.

        Raises
        ------
        DecodeError : a recording has no features, unless `errors="nan"` makes its row NaN
        """
        names, matrix = self._compute(_recordings(X))
        if self._names is not None and names != self._names:
            raise ParameterError(
                f"X gives {len(names)} values per recording, but fit saw {len(self._names)}: the "
                "number of channels or the configuration differs"
            )
        return matrix

    def _made_of(self) -> dict[str, Any]:
        """What a model file says about features."""
        config, digest = _core.effective_config(*self._configuration())
        return {
            "feature_names": self.get_feature_names_out().tolist(),
            "feature_config": json.loads(config),
            "feature_config_hash": digest,
            "formats": self._formats,
        }

    def _formats_of(self, recordings: list[Any]) -> list[tuple[int, int]]:
        """Different formats of those that can be read."""
        return sorted({found for found in map(self._format, recordings) if found is not None})

    def _format(self, recording: Any) -> tuple[int, int] | None:
        """Sample rate and channels of a recording, if it can be read."""
        if not _is_path(recording):
            return whole_rate(self.sr), np.atleast_2d(recording).shape[0]
        try:
            opened = _core.Recording.open(recording)
        except DecodeError:
            return None
        return opened.sample_rate, opened.channels

    def get_feature_names_out(self, input_features: Any = None) -> npt.NDArray[np.object_]:
        """Names of the columns, known after `fit`. `input_features` has no effect."""
        if self._names is None:
            raise not_fitted(self)
        return np.asarray(self._names, dtype=object)

    def _configuration(self) -> tuple[tuple[str, str], list[str]]:
        preset = "esc26" if self.preset is None and self.config is None else self.preset
        config, overrides = configuration(preset, self.config, self.set)
        effective, _ = _core.effective_config(config, overrides)
        if json.loads(effective)["summary"] is None:
            raise ParameterError(
                "FeatureExtractor computes one row per recording, so it needs a summary: "
                'set={"summary.stats": ["mean", "std"]} adds one'
            )
        return config, overrides

    def _compute(self, recordings: list[Any]) -> tuple[list[str], Matrix]:
        """Names of the columns, and rows."""
        config, overrides = self._configuration()
        if _is_path(recordings[0]):
            return self._of_files(recordings)
        return self._of_signals(recordings, _core.Signals(config, overrides))

    def _of_files(self, paths: list[Any]) -> tuple[list[str], Matrix]:
        names = [os.fspath(path) for path in paths]
        # The same file may be in X twice, as in a bootstrap.
        if self.errors not in ("raise", "nan"):
            raise ParameterError(f"errors must be 'raise' or 'nan', not {self.errors!r}")
        different = list(dict.fromkeys(names))
        absent = [name for name in different if self.errors == "nan" and not os.path.exists(name)]
        if absent:
            return self._around(absent, names)
        preset = "esc26" if self.preset is None and self.config is None else self.preset
        found = extract(
            different,
            preset=preset,
            config=self.config,
            set=self.set,
            jobs=self.jobs,
            progress=self.progress,
        )
        if len(found.outcomes) != len(different):
            raise ParameterError("X holds folders, globs or manifests: name each recording")
        rows = iter(found.summary if found.summary is not None else ())
        columns = found.names or self._names or []
        row_of: dict[str, Matrix] = {}
        for name, outcome in zip(different, found.outcomes, strict=True):
            if outcome["status"] in GOOD:
                row_of[name] = next(rows)
                continue
            reason = f"{name}: {outcome['status']}: {outcome['reason']}"
            if self.errors == "raise" or not columns:
                raise DecodeError(reason)
            warn(f"the row is NaN: {reason}")
            row_of[name] = np.full(len(columns), np.nan, dtype=np.float32)
        return columns, np.stack([row_of[name] for name in names])

    def _around(self, absent: list[str], names: list[str]) -> tuple[list[str], Matrix]:
        """The rows of the files that are there, and NaN for the others."""
        there = [name for name in names if name not in absent]
        columns, found = self._of_files(there) if there else (self._names or [], np.zeros((0, 0)))
        if not columns:
            raise DecodeError(f"{absent[0]}: no such file; no other file of X exists either")
        for name in absent:
            warn(f"the row is NaN: {name}: no such file")
        rows = iter(found)
        empty = np.full(len(columns), np.nan, dtype=np.float32)
        return columns, np.stack([empty if name in absent else next(rows) for name in names])

    def _of_signals(self, signals: list[Any], by: _core.Signals) -> tuple[list[str], Matrix]:
        rate = whole_rate(self.sr)
        if self.jobs is not None and not 1 <= self.jobs <= MOST_JOBS:
            raise ParameterError(f"jobs must be 1 to {MOST_JOBS}, not {self.jobs}")

        def row(position: int) -> tuple[list[str], Any]:
            samples = _signal(signals[position], position)
            try:
                signal = by.start(rate, samples.shape[1])
                names = signal.summary_names()
                signal.push(samples)
                return names, signal.finish()[0]
            except ParameterError as error:
                raise ParameterError(f"recording {position}: {error}") from error

        with ThreadPoolExecutor(self.jobs or _core.jobs()) as pool:
            computed = list(pool.map(row, range(len(signals))))
        names = computed[0][0]
        for position, (others, _) in enumerate(computed):
            if others != names:
                raise ParameterError(
                    f"recording {position} gives {len(others)} values, but the first one gives "
                    f"{len(names)}: the number of channels differs"
                )
        return names, np.stack([values for _, values in computed])


def _recordings(X: Any) -> list[Any]:
    if hasattr(X, "toarray") and hasattr(X, "tocsr"):
        raise DataTypeError("sparse data was passed, but dense data is required; use .toarray()")
    if X is None:
        raise ParameterError("X must be paths or signals, not None")
    recordings = [X] if _is_path(X) else list(X if hasattr(X, "__iter__") else np.asarray(X))
    if not recordings:
        raise ParameterError("Found array with 0 sample(s): at least one recording is needed")
    if len({_is_path(recording) for recording in recordings}) > 1:
        raise ParameterError("X mixes paths and signals: give one or the other")
    return recordings


def _is_path(recording: Any) -> bool:
    return isinstance(recording, str | os.PathLike)


def _signal(y: Any, position: int) -> Matrix:
    """A signal in memory [shape=(n, channels)]."""
    if np.iscomplexobj(y):
        raise ParameterError(f"Complex data not supported: recording {position}")
    if np.asarray(y).dtype == object:
        y = np.asarray(y, dtype=np.float64)
    if not np.ndim(y):
        raise ParameterError(
            f"recording {position} is a single value. Reshape your data to (recordings, n), or put "
            "a single recording into a list"
        )
    try:
        samples = interleaved(y)
    except ParameterError as error:
        raise ParameterError(f"recording {position}: {error}") from error
    if not len(samples):
        shape = np.atleast_2d(y).shape
        raise ParameterError(
            f"recording {position}: 0 feature(s) (shape={shape}) while a minimum of 1 is required: "
            "no samples"
        )
    return samples
