"""Refusals: every error that an argument causes is one of this package, and names the argument."""

from __future__ import annotations

import inspect
import os
import reprlib
import types
from collections.abc import Callable, Iterable, Mapping
from functools import wraps
from typing import (
    Any,
    Literal,
    ParamSpec,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    is_typeddict,
)

import numpy as np
import numpy.typing as npt

from .errors import CorsmalFeatError, FileError, MissingFileError, ParameterError

P = ParamSpec("P")
R = TypeVar("R")

_ARRAY_LIKE = frozenset(get_args(npt.ArrayLike))
_DTYPE_LIKE = frozenset(get_args(npt.DTypeLike))
_NUMBERS = (bool, int, float, np.number, np.bool_)


def refuses(function: Callable[P, R]) -> Callable[P, R]:
    """A public function whose refusals are all errors of this package.

    Nothing is checked before the call. After an error that is not this package's, the arguments are
    compared with the annotations, and the first one that does not fit them is named.
    """

    @wraps(function)
    def refusing(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return function(*args, **kwargs)
        except (CorsmalFeatError, Warning, ImportError):
            raise
        except Exception as error:
            try:
                bound = inspect.signature(function).bind(*args, **kwargs)
            except TypeError:
                raise error from None  # a missing or unknown argument, as Python says it
            told = _told(error, function, bound.arguments)
            if told is None:
                raise
            raise told from error

    return refusing


def _told(
    error: Exception, function: Callable[..., Any], arguments: Mapping[str, Any]
) -> Exception | None:
    hints = get_type_hints(function)
    # What stands in `**kwargs` is refused by the function that it is passed on to.
    given = [(name, value) for name, value in arguments.items() if name in hints]
    for name, value in given:
        if not _fits(hints[name], value):
            expected = " or ".join(dict.fromkeys(_words(hints[name])))
            return ParameterError(f"{name} must be {expected}, not {_shown(value)}")
    for name, value in given:
        if isinstance(value, (float, np.floating)) and not np.isfinite(value):
            return ParameterError(f"{name} must be a finite number, not {value}")
        if isinstance(error, TypeError) and "complex" in str(error) and np.iscomplexobj(value):
            return ParameterError(f"{name} must be real, not complex")
        if isinstance(error, ZeroDivisionError) and isinstance(value, _NUMBERS) and value == 0:
            return ParameterError(f"{name} must not be 0")
    if isinstance(error, OSError):
        kind = MissingFileError if isinstance(error, FileNotFoundError) else FileError
        place = f"{error.filename}: " if error.filename is not None else ""
        return kind(f"{place}{error.strerror or error}")
    if isinstance(error, (ValueError, OverflowError, MemoryError)):
        return ParameterError(f"{function.__name__}: {error}")
    return None


def _shown(value: Any) -> str:
    """A value as it may stand in a message, at most a line."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    return reprlib.repr(value)


def _split(hint: Any) -> tuple[frozenset[Any], list[Any]]:
    """numpy's union that a hint holds, if any, and its other alternatives."""
    kinds = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    for group in (_ARRAY_LIKE, _DTYPE_LIKE):
        if group <= set(kinds):
            return group, [kind for kind in kinds if kind not in group]
    return frozenset(), list(kinds)


def _fits(hint: Any, value: Any) -> bool:
    """Whether a value may stand where a parameter has this annotation."""
    group, kinds = _split(hint)
    if group and (_is_array(value) if group is _ARRAY_LIKE else _is_dtype(value)):
        return True
    return any(_fits_kind(kind, value) for kind in kinds)


def _is_array(value: Any) -> bool:
    try:
        return np.asarray(value).dtype.kind in "biufc"
    except ValueError:
        return False


def _is_dtype(value: Any) -> bool:
    try:
        np.dtype(value)
    except (TypeError, ValueError):
        return False
    return True


def _fits_kind(kind: Any, value: Any) -> bool:
    origin = get_origin(kind)
    if kind is Any or isinstance(kind, TypeVar):
        return True
    if origin is Literal:
        return isinstance(value, str | int | None) and value in get_args(kind)
    if kind in (float, np.floating):
        return isinstance(value, _NUMBERS) and not isinstance(value, np.complexfloating)
    if kind in (int, np.integer):
        return _fits_kind(float, value) and float(value).is_integer()
    if kind is bool:
        return isinstance(value, (bool, np.bool_))
    if origin is np.ndarray:
        return isinstance(value, np.ndarray)
    if is_typeddict(kind):
        return isinstance(value, dict) and kind.__required_keys__ <= value.keys()
    if origin is Callable:
        return callable(value)
    if isinstance(origin, type) and issubclass(origin, Iterable) and origin is not Mapping:
        several = value.ndim > 0 if isinstance(value, np.ndarray) else isinstance(value, origin)
        return several and _elements_fit(kind, value)
    found = origin or kind
    return not isinstance(found, type) or isinstance(value, found)


def _elements_fit(kind: Any, value: Any) -> bool:
    hints = [hint for hint in get_args(kind) if hint is not Ellipsis]
    if not hints or not isinstance(value, (list, tuple, str, bytes, np.ndarray)):
        return True
    return all(any(_fits(hint, element) for hint in hints) for element in value)


def _words(hint: Any) -> Iterable[str]:
    """What an annotation takes, in words."""
    group, kinds = _split(hint)
    if group:
        yield "an array of numbers" if group is _ARRAY_LIKE else "a numpy type"
    for kind in kinds:
        origin = get_origin(kind)
        found = origin or kind
        if origin is Literal:
            yield from (repr(choice) for choice in get_args(kind))
        elif found in _NAMES:
            yield _NAMES[found]
        elif isinstance(found, type) and issubclass(found, Iterable):
            yield "a sequence"
        else:
            yield f"a {found.__name__}"


_NAMES: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    np.integer: "a whole number",
    np.floating: "a number",
    np.ndarray: "an array of numbers",
    bool: "True or False",
    str: "text",
    types.NoneType: "None",
    os.PathLike: "a path",
    Mapping: "a mapping",
    dict: "a mapping",
    Callable: "a function",
}
