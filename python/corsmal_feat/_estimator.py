"""Features as a scikit-learn transformer."""

from __future__ import annotations

import contextlib
import json
import os
from array import array
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from . import _core
from ._arrays import as_array, unmasked
from ._extract import MOST_JOBS, Config, configuration, extract, interleaved, whole_rate
from ._features import GOOD
from ._fingerprints import Fingerprints, fingerprints
from ._formats import Format, mismatch, taken
from ._refusals import refuses
from ._sklearn import BaseEstimator, TransformerMixin, not_fitted
from ._warnings import warn
from .errors import DataTypeError, DecodeError, ParameterError

__all__ = ["FeatureExtractor"]

Matrix = npt.NDArray[np.float32]

#: Rows whose fingerprints an extractor keeps: 8 MiB.
_KEPT = 1 << 20


class _Computed(NamedTuple):
    names: list[str]
    rows: Matrix
    #: of the recordings that have features
    formats: list[Format]


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
    any_rate : whether `transform` accepts recordings with a sample rate or a number of channels
        that `fit` has not seen

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
        any_rate: bool = False,
    ) -> None:
        self.preset = preset
        self.config = config
        self.set = set
        self.sr = sr
        self.jobs = jobs
        self.errors = errors
        self.progress = progress
        self.any_rate = any_rate

    _names: list[str] | None = None
    #: sample rates and channels of the recordings that it was fitted on
    _formats: list[Format]
    #: fingerprints of the rows given since `fit`
    _given: array[int] | None = None

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
        """Learns the names of the columns, including channels, from the first recording of `X`.

        With `errors="nan"`, from the first that can be read.
        """
        recordings = _recordings(X)
        for position, recording in enumerate(recordings):
            if not _is_path(recording):
                _signal(recording, position)
        self._names = self._first(recordings).names
        self._formats = self._formats_of(recordings)
        self._given = array("Q")
        return self

    @refuses
    def fit_transform(self, X: Any, y: Any = None) -> Matrix:
        """`fit(X).transform(X)`."""
        computed = self._compute(_recordings(X))
        self._names = computed.names
        self._formats = sorted(set(computed.formats))
        self._given = array("Q")
        self._keep(computed.rows)
        return computed.rows

    @refuses
    def transform(self, X: Any) -> Matrix:
        """Features [shape=(recordings, values)] of the recordings `X`.

        Raises
        ------
        DecodeError : a recording has no features, unless `errors="nan"` makes its row NaN
        ParameterError : a recording has a sample rate or a number of channels that `fit` has not
            seen, unless `any_rate=True` accepts it
        """
        computed = self._compute(_recordings(X))
        if self._names is None:
            return computed.rows
        if computed.names != self._names:
            raise ParameterError(
                f"X gives {len(computed.names)} values per recording, but fit saw "
                f"{len(self._names)}: the number of channels or the configuration differs"
            )
        # Pickles of 0.1.0 lack it.
        if not getattr(self, "any_rate", False):
            self._check_formats(computed.formats)
        self._keep(computed.rows)
        return computed.rows

    def _check_formats(self, formats: list[Format]) -> None:
        """Refuses formats that change the features."""
        config = json.loads(_core.effective_config(*self._configuration())[0])
        rates, channels = taken(config, self._formats)
        for found in sorted(set(formats)):
            reason = mismatch(found, rates, channels, "this FeatureExtractor")
            if reason is not None:
                raise ParameterError(
                    f"X has a recording with {reason}; any_rate=True accepts it as it is"
                )

    def _keep(self, rows: Matrix) -> None:
        """Keeps what tells `save` of a classifier whether it was fitted on these rows."""
        if self._given is not None:
            self._given.extend(fingerprints(rows[: _KEPT - len(self._given)]).tolist())

    def _fingerprints(self) -> Fingerprints | None:
        """Those of the rows given so far; None if not all are known."""
        if self._given is None or len(self._given) >= _KEPT:
            return None
        return np.array(self._given, np.uint64)

    def _made_of(self) -> dict[str, Any]:
        """What a model file says about features."""
        config, digest = _core.effective_config(*self._configuration())
        return {
            "feature_names": self.get_feature_names_out().tolist(),
            "feature_config": json.loads(config),
            "feature_config_hash": digest,
            "formats": self._formats,
            "seconds": [],
        }

    def _formats_of(self, recordings: list[Any]) -> list[Format]:
        """Different formats of those that can be read."""
        return sorted({found for found in map(self._format, recordings) if found is not None})

    def _format(self, recording: Any) -> Format | None:
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

    def _first(self, recordings: list[Any]) -> _Computed:
        """The features of the first recording, or of the first that has some."""
        if self.errors == "nan":
            readable = [recording for recording in recordings if self._format(recording)]
            for recording in readable:
                with contextlib.suppress(DecodeError):
                    return self._compute([recording])
            return self._compute(recordings)
        return self._compute(recordings[:1])

    def _compute(self, recordings: list[Any]) -> _Computed:
        config, overrides = self._configuration()
        if _is_path(recordings[0]):
            return self._of_files(recordings)
        return self._of_signals(recordings, _core.Signals(config, overrides))

    def _of_files(self, paths: list[Any]) -> _Computed:
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
        formats: list[Format] = []
        for name, outcome in zip(different, found.outcomes, strict=True):
            if outcome["status"] in GOOD:
                row_of[name] = next(rows)
                formats.append((outcome["sample_rate"], outcome["channels"]))
                continue
            reason = f"{name}: {outcome['status']}: {outcome['reason']}"
            if self.errors == "raise" or not columns:
                raise DecodeError(reason)
            warn(f"the row is NaN: {reason}")
            row_of[name] = np.full(len(columns), np.nan, dtype=np.float32)
        return _Computed(columns, np.stack([row_of[name] for name in names]), formats)

    def _around(self, absent: list[str], names: list[str]) -> _Computed:
        """The rows of the files that are there, and NaN for the others."""
        there = [name for name in names if name not in absent]
        nothing = _Computed(self._names or [], np.zeros((0, 0), np.float32), [])
        columns, found, formats = self._of_files(there) if there else nothing
        if not columns:
            raise DecodeError(f"{absent[0]}: no such file; no other file of X exists either")
        for name in absent:
            warn(f"the row is NaN: {name}: no such file")
        rows = iter(found)
        empty = np.full(len(columns), np.nan, dtype=np.float32)
        stacked = np.stack([empty if name in absent else next(rows) for name in names])
        return _Computed(columns, stacked, formats)

    def _of_signals(self, signals: list[Any], by: _core.Signals) -> _Computed:
        rate = whole_rate(self.sr)
        if self.jobs is not None and not 1 <= self.jobs <= MOST_JOBS:
            raise ParameterError(f"jobs must be 1 to {MOST_JOBS}, not {self.jobs}")

        def row(position: int) -> tuple[list[str], Any, Format]:
            samples = _signal(signals[position], position)
            try:
                signal = by.start(rate, samples.shape[1])
                names = signal.summary_names()
                signal.push(samples)
                return names, signal.finish()[0], (rate, samples.shape[1])
            except ParameterError as error:
                raise ParameterError(f"recording {position}: {error}") from error

        with ThreadPoolExecutor(self.jobs or _core.jobs()) as pool:
            computed = list(pool.map(row, range(len(signals))))
        names = computed[0][0]
        for position, (others, *_) in enumerate(computed):
            if others != names:
                raise ParameterError(
                    f"recording {position} gives {len(others)} values, but the first one gives "
                    f"{len(names)}: the number of channels differs"
                )
        rows = np.stack([values for _, values, _ in computed])
        return _Computed(names, rows, [found for *_, found in computed])


def _recordings(X: Any) -> list[Any]:
    if hasattr(X, "toarray") and hasattr(X, "tocsr"):
        raise DataTypeError("sparse data was passed, but dense data is required; use .toarray()")
    if X is None:
        raise ParameterError("X must be paths or signals, not None")
    if getattr(X, "ndim", 2) == 2 and (hasattr(X, "columns") or isinstance(X, np.ndarray)):
        X = _column(X)
    recordings = [X] if _is_path(X) else list(X if hasattr(X, "__iter__") else np.asarray(X))
    if not recordings:
        raise ParameterError("Found array with 0 sample(s): at least one recording is needed")
    if len({_is_path(recording) for recording in recordings}) > 1:
        raise ParameterError("X mixes paths and signals: give one or the other")
    return recordings


def _column(X: Any) -> Any:
    """The only column of a table of paths; rows of samples stay as they are."""
    table = unmasked("X", np.asarray(X) if hasattr(X, "columns") else X)
    if not table.size or not _is_path(table.flat[0]):
        return table
    if table.shape[1] != 1:
        names = getattr(X, "columns", None)
        which = "" if names is None else f" ({', '.join(map(str, names))})"
        raise ParameterError(
            f"X has {table.shape[1]} columns{which}, expected one path per recording: pass the"
            " column of paths only"
        )
    return table[:, 0]


def _is_path(recording: Any) -> bool:
    return isinstance(recording, str | os.PathLike)


def _signal(y: Any, position: int) -> Matrix:
    """A signal in memory [shape=(n, channels)]."""
    if np.iscomplexobj(y):
        raise ParameterError(f"Complex data not supported: recording {position}")
    if np.asarray(y).dtype == object:
        y = as_array("y", y, np.float64)
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
    if samples.shape[1] > len(samples):
        raise ParameterError(
            f"recording {position} has shape {np.shape(y)}, which is {samples.shape[1]} channels of"
            f" {len(samples)} samples, expected (channels, n): transpose it"
        )
    return samples
