"""Acoustic features in librosa's vocabulary, computed in Rust; classifiers; the CORSMAL benchmark."""

from . import classifiers, filters
from ._core import ParameterError, __version__
from .spectrum import stft

__all__ = ["ParameterError", "__version__", "classifiers", "filters", "stft"]
