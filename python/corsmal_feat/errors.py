"""Exceptions: each is a `CorsmalFeatError`, and also the built-in error of its kind."""

from __future__ import annotations

__all__ = [
    "ConfigError",
    "CorsmalFeatError",
    "DataTypeError",
    "DecodeError",
    "FileError",
    "MissingFileError",
    "ModelError",
    "NotFittedError",
    "ParameterError",
    "RunError",
    "UnknownIdError",
]


class CorsmalFeatError(Exception):
    """Any refusal of this package."""


class ParameterError(CorsmalFeatError, ValueError):
    """A parameter or array was refused."""


class DataTypeError(ParameterError, TypeError):
    """Data are of a type that is not accepted."""


class ConfigError(ParameterError):
    """A configuration of `extract` is refused."""


class ModelError(ParameterError):
    """A model file cannot be read or written, or has another model in it."""


class NotFittedError(ParameterError, AttributeError):
    """An estimator was used before `fit`."""


class UnknownIdError(ParameterError, KeyError):
    """No recording with that id has features."""

    # A KeyError shows the repr of its message.
    __str__ = Exception.__str__


class RunError(CorsmalFeatError, RuntimeError):
    """A run could not start or continue."""


class DecodeError(RunError):
    """A recording has no features, but every recording needs them."""


class FileError(RunError, OSError):
    """A file cannot be read or written."""

    # An OSError shows its arguments.
    __str__ = Exception.__str__


class MissingFileError(FileError, DecodeError, FileNotFoundError):
    """A file does not exist."""
