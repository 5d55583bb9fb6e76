"""Acoustic features in librosa's vocabulary, computed in Rust; classifiers; CORSMAL benchmark."""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING, Any

from . import corsmal, decompose, effects, errors, feature, filters, onset
from ._core import __version__
from ._evaluate import Scores, evaluate
from ._extract import Features, SignalExtractor, extract, load
from ._harmonic import cqt, istft
from ._mono import to_mono
from ._pitch import estimate_tuning, piptrack, pitch_tuning
from ._resample import resample
from ._scoring import (
    Comparison,
    CrossValidation,
    Predictions,
    ScoreReport,
    compare_predictions,
    cross_validate,
    fuse,
    score,
)
from .errors import (
    ConfigError,
    CorsmalFeatError,
    DecodeError,
    ModelError,
    NotFittedError,
    ParameterError,
    RunError,
)
from .spectrum import amplitude_to_db, power_to_db, stft

if TYPE_CHECKING:
    from . import classifiers
    from ._estimator import FeatureExtractor
    from .classifiers import (
        KNN,
        SVC,
        DecisionTree,
        ExtraTrees,
        LogisticRegression,
        RandomForest,
        load_model,
    )

__all__ = [
    "KNN",
    "SVC",
    "Comparison",
    "ConfigError",
    "CorsmalFeatError",
    "CrossValidation",
    "DecisionTree",
    "DecodeError",
    "ExtraTrees",
    "FeatureExtractor",
    "Features",
    "LogisticRegression",
    "ModelError",
    "NotFittedError",
    "ParameterError",
    "Predictions",
    "RandomForest",
    "RunError",
    "ScoreReport",
    "Scores",
    "SignalExtractor",
    "__version__",
    "amplitude_to_db",
    "classifiers",
    "compare_predictions",
    "corsmal",
    "cqt",
    "cross_validate",
    "decompose",
    "effects",
    "errors",
    "estimate_tuning",
    "evaluate",
    "extract",
    "feature",
    "filters",
    "fuse",
    "istft",
    "load",
    "load_model",
    "onset",
    "piptrack",
    "pitch_tuning",
    "power_to_db",
    "resample",
    "score",
    "stft",
    "to_mono",
]

# Estimators are scikit-learn's where it is installed, and importing that takes a second: they come
# when they are asked for.
_LATER = {"FeatureExtractor": "._estimator", "classifiers": ".classifiers"} | dict.fromkeys(
    (
        "KNN",
        "SVC",
        "DecisionTree",
        "ExtraTrees",
        "LogisticRegression",
        "RandomForest",
        "load_model",
    ),
    ".classifiers",
)


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = _import_module(_LATER[name], __name__)
    return module if name == "classifiers" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(__all__)
