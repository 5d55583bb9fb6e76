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
from ._core import ParameterError, RunError
from ._extract import Config, configuration, extract, interleaved, whole_rate
from ._parameters import Parametrised

__all__ = ["FeatureExtractor"]

Matrix = npt.NDArray[np.float32]


class FeatureExtractor(Parametrised):
    """Recordings in, one row of features for each out: the first step of a scikit-learn `Pipeline`.

    The rows are the summary of the configuration, so it needs one (`preset="esc26"`, "esc28",
    "mfcc-zcr", or a [summary] of its own). scikit-learn is not needed to use it; with it, it is a
    transformer like any other (`clone`, `cross_val_score`, `GridSearchCV`).

    Parameters
    ----------
    preset, config, set : see `corsmal_feat.extract`; preset is "esc26" where no config is given
    sr : sample rate in Hz of signals in memory; not used for files
    jobs : worker threads; by default one for each core

    Rows to transform are paths, or signals in memory: a list of float arrays, each [shape=(n,) or
    (channels, n)], or one array [shape=(recordings, n) or (recordings, channels, n)].
    """

    def __init__(
        self,
        preset: str | None = None,
        *,
        config: Config | None = None,
        set: Mapping[str, Any] | None = None,
        sr: float | None = None,
        jobs: int | None = None,
    ) -> None:
        self.preset = preset
        self.config = config
        self.set = set
        self.sr = sr
        self.jobs = jobs

    _names: list[str]

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import (  # type: ignore[import-untyped]
            InputTags,
            Tags,
            TargetTags,
            TransformerTags,
        )

        return Tags(
            estimator_type=None,
            target_tags=TargetTags(required=False),
            transformer_tags=TransformerTags(preserves_dtype=[]),
            input_tags=InputTags(one_d_array=True, three_d_array=True, string=True),
            requires_fit=False,
        )

    def __sklearn_is_fitted__(self) -> bool:
        return True

    def fit(self, X: Any, y: Any = None) -> Self:
        """Checks the configuration; nothing is learnt from `X`."""
        self._configuration()
        return self

    def fit_transform(self, X: Any, y: Any = None) -> Matrix:
        """`fit(X).transform(X)`."""
        return self.fit(X).transform(X)

    def transform(self, X: Any) -> Matrix:
        """Features [shape=(recordings, values)] of the recordings `X`.

        Raises
        ------
        RunError : a recording that has no features, since a row cannot be left out here
        """
        config, overrides = self._configuration()
        recordings = [X] if isinstance(X, str | os.PathLike) else list(X)
        if not recordings:
            raise ParameterError("X is empty: at least one recording is needed")
        of_files = [isinstance(x, str | os.PathLike) for x in recordings]
        if all(of_files):
            names, matrix = self._of_files(recordings)
        elif any(of_files):
            raise ParameterError("X mixes paths and arrays: either of them")
        else:
            names, matrix = self._of_signals(recordings, _core.Signals(config, overrides))
        self._names = names
        return matrix

    def get_feature_names_out(self, input_features: Any = None) -> npt.NDArray[np.object_]:
        """Names of the columns, known once something was transformed: the number of channels is
        part of them. `input_features` is scikit-learn's and has no effect."""
        if not hasattr(self, "_names"):
            raise ParameterError("the names are known after transform: they depend on the channels")
        return np.asarray(self._names, dtype=object)

    def _configuration(self) -> tuple[tuple[str, str], list[str]]:
        preset = "esc26" if self.preset is None and self.config is None else self.preset
        config, overrides = configuration(preset, self.config, self.set)
        effective, _ = _core.effective_config(config, overrides)
        if json.loads(effective)["summary"] is None:
            raise ParameterError(
                "summary = None is not possible for FeatureExtractor: one row for each recording "
                'needs it; set={"summary.stats": ["mean", "std"]} adds one'
            )
        return config, overrides

    def _of_files(self, paths: list[Any]) -> tuple[list[str], Matrix]:
        names = [os.fspath(path) for path in paths]
        # The same file may be in X twice, as in a bootstrap.
        different = list(dict.fromkeys(names))
        preset = "esc26" if self.preset is None and self.config is None else self.preset
        found = extract(different, preset=preset, config=self.config, set=self.set, jobs=self.jobs)
        if len(found.outcomes) != len(different):
            raise ParameterError("X holds folders, globs or manifests: name each recording")
        rows = iter(found.summary if found.summary is not None else ())
        row_of: dict[str, Matrix] = {}
        for name, outcome in zip(different, found.outcomes, strict=True):
            if outcome["status"] not in ("ok", "truncated"):
                raise RunError(f"{name}: {outcome['status']}: {outcome['reason']}")
            row_of[name] = next(rows)
        return found.names, np.stack([row_of[name] for name in names])

    def _of_signals(self, signals: list[Any], by: _core.Signals) -> tuple[list[str], Matrix]:
        rate = whole_rate(self.sr)

        def row(position: int) -> tuple[list[str], Any]:
            try:
                samples = interleaved(signals[position])
                signal = by.start(rate, samples.shape[1])
                names = signal.summary_names()
                signal.push(samples)
                return names, signal.finish()[0]
            except ParameterError as error:
                raise ParameterError(f"recording {position}: {error}") from error

        with ThreadPoolExecutor(self.jobs or os.cpu_count()) as pool:
            computed = list(pool.map(row, range(len(signals))))
        names = computed[0][0]
        for position, (others, _) in enumerate(computed):
            if others != names:
                raise ParameterError(
                    f"recording {position} gives {len(others)} values where the first one gives "
                    f"{len(names)}: another number of channels"
                )
        return names, np.stack([values for _, values in computed])
