"""Exceptions: each is a `CorsmalFeatError` and also the built-in error of its kind."""

from __future__ import annotations

import errno
from typing import Any

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
    """Base class of all errors of this package."""


class ParameterError(CorsmalFeatError, ValueError):
    """A parameter or array is wrong."""


class DataTypeError(ParameterError, TypeError):
    """Data have a type that is not accepted."""


class ConfigError(ParameterError):
    """A configuration is wrong."""


class ModelError(ParameterError):
    """A model file cannot be read or written, or holds another kind of model."""


class NotFittedError(ParameterError, AttributeError):
    """An estimator was used before `fit`."""


class UnknownIdError(ParameterError, KeyError):
    """No recording with that id has features."""

    # A KeyError shows the repr of its message.
    __str__ = Exception.__str__


class RunError(CorsmalFeatError, RuntimeError):
    """A run could not start or continue."""


class DecodeError(RunError):
    """A recording cannot be read or has no features, where it must have them."""


class FileError(RunError, OSError):
    """A file cannot be read or written."""

    # An OSError shows its arguments.
    __str__ = Exception.__str__

    def __reduce__(self) -> tuple[Any, ...]:
        # An OSError gets these of its arguments alone.
        kept = ("errno", "strerror", "filename")
        state = {name: getattr(self, name) for name in kept} | self.__dict__
        return type(self), self.args, state


class MissingFileError(FileError, DecodeError, FileNotFoundError):
    """A file does not exist."""

    def __init__(self, *args: object) -> None:
        super().__init__(*args)
        self.errno = self.errno or errno.ENOENT
