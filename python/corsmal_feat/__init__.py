"""Acoustic features in librosa's vocabulary, computed in Rust; classifiers; the CORSMAL benchmark."""

from . import filters
from ._core import ParameterError, __version__
from ._resample import resample
from .spectrum import stft

__all__ = ["ParameterError", "__version__", "filters", "resample", "stft"]
