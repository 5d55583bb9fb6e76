"""Acoustic features in librosa's vocabulary, computed in Rust; classifiers; CORSMAL benchmark."""

from . import classifiers, corsmal, decompose, effects, feature, filters, onset
from ._core import ParameterError, RunError, __version__
from ._estimator import FeatureExtractor
from ._extract import Features, SignalExtractor, extract, load
from ._harmonic import cqt, istft
from ._mono import to_mono
from ._pitch import estimate_tuning, piptrack, pitch_tuning
from ._resample import resample
from .classifiers import (
    KNN,
    SVC,
    DecisionTree,
    ExtraTrees,
    LogisticRegression,
    RandomForest,
    load_model,
)
from .spectrum import amplitude_to_db, power_to_db, stft

__all__ = [
    "KNN",
    "SVC",
    "DecisionTree",
    "ExtraTrees",
    "FeatureExtractor",
    "Features",
    "LogisticRegression",
    "ParameterError",
    "RandomForest",
    "RunError",
    "SignalExtractor",
    "__version__",
    "amplitude_to_db",
    "classifiers",
    "corsmal",
    "cqt",
    "decompose",
    "effects",
    "estimate_tuning",
    "extract",
    "feature",
    "filters",
    "istft",
    "load",
    "load_model",
    "onset",
    "piptrack",
    "pitch_tuning",
    "power_to_db",
    "resample",
    "stft",
    "to_mono",
]
