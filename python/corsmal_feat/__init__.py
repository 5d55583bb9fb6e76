"""Audio features with librosa's names, computed in Rust; classifiers; the CORSMAL benchmark."""

from importlib import import_module as _import_module
from typing import TYPE_CHECKING, Any

from . import (
    corsmal,
    decompose,
    display,
    effects,
    errors,
    feature,
    filters,
    nets,
    onset,
    util,
    vision,
)
from ._absent import absent as _absent
from ._audio import get_duration, get_samplerate, load, stream
from ._comparison import Comparison, compare_predictions
from ._core import __version__
from ._cqt import cqt
from ._decibels import amplitude_to_db, db_to_amplitude, db_to_power, magphase, power_to_db
from ._evaluate import Scores, evaluate
from ._extract import SignalExtractor, extract
from ._features import Features, load_features
from ._frequencies import (
    cqt_frequencies,
    fft_frequencies,
    fourier_tempo_frequencies,
    mel_frequencies,
    tempo_frequencies,
)
from ._istft import istft
from ._mono import to_mono
from ._pcen import pcen
from ._pitch import estimate_tuning, piptrack, pitch_tuning
from ._pitches import (
    A4_to_tuning,
    hz_to_mel,
    hz_to_midi,
    hz_to_octs,
    mel_to_hz,
    midi_to_hz,
    note_to_hz,
    note_to_midi,
    octs_to_hz,
    tuning_to_A4,
)
from ._predictions import Predictions
from ._resample import resample
from ._scoring import CrossValidation, ScoreReport, cross_validate, fuse, score
from ._spectrum import stft
from ._times import (
    blocks_to_frames,
    blocks_to_samples,
    blocks_to_time,
    frames_to_samples,
    frames_to_time,
    samples_like,
    samples_to_frames,
    samples_to_time,
    time_to_frames,
    time_to_samples,
    times_like,
)
from ._weightings import (
    A_weighting,
    B_weighting,
    C_weighting,
    D_weighting,
    Z_weighting,
    frequency_weighting,
    multi_frequency_weighting,
    perceptual_weighting,
)
from ._yin import yin
from .errors import (
    ConfigError,
    CorsmalFeatError,
    DataTypeError,
    DecodeError,
    FileError,
    MissingFileError,
    ModelError,
    NotFittedError,
    ParameterError,
    RunError,
    UnknownIdError,
)

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
    "A4_to_tuning",
    "A_weighting",
    "B_weighting",
    "C_weighting",
    "Comparison",
    "ConfigError",
    "CorsmalFeatError",
    "CrossValidation",
    "D_weighting",
    "DataTypeError",
    "DecisionTree",
    "DecodeError",
    "ExtraTrees",
    "FeatureExtractor",
    "Features",
    "FileError",
    "LogisticRegression",
    "MissingFileError",
    "ModelError",
    "NotFittedError",
    "ParameterError",
    "Predictions",
    "RandomForest",
    "RunError",
    "ScoreReport",
    "Scores",
    "SignalExtractor",
    "UnknownIdError",
    "Z_weighting",
    "__version__",
    "amplitude_to_db",
    "blocks_to_frames",
    "blocks_to_samples",
    "blocks_to_time",
    "classifiers",
    "compare_predictions",
    "corsmal",
    "cqt",
    "cqt_frequencies",
    "cross_validate",
    "db_to_amplitude",
    "db_to_power",
    "decompose",
    "display",
    "effects",
    "errors",
    "estimate_tuning",
    "evaluate",
    "extract",
    "feature",
    "fft_frequencies",
    "filters",
    "fourier_tempo_frequencies",
    "frames_to_samples",
    "frames_to_time",
    "frequency_weighting",
    "fuse",
    "get_duration",
    "get_samplerate",
    "hz_to_mel",
    "hz_to_midi",
    "hz_to_octs",
    "istft",
    "load",
    "load_features",
    "load_model",
    "magphase",
    "mel_frequencies",
    "mel_to_hz",
    "midi_to_hz",
    "multi_frequency_weighting",
    "nets",
    "note_to_hz",
    "note_to_midi",
    "octs_to_hz",
    "onset",
    "pcen",
    "perceptual_weighting",
    "piptrack",
    "pitch_tuning",
    "power_to_db",
    "resample",
    "samples_like",
    "samples_to_frames",
    "samples_to_time",
    "score",
    "stft",
    "stream",
    "tempo_frequencies",
    "time_to_frames",
    "time_to_samples",
    "times_like",
    "to_mono",
    "tuning_to_A4",
    "util",
    "vision",
    "yin",
]

# The estimators import scikit-learn where it is installed, which takes a second: they are imported
# when they are first used.
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
        raise _absent(__name__, name)
    module = _import_module(_LATER[name], __name__)
    return module if name == "classifiers" else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(__all__)
