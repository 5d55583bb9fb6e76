"""Refusals: an argument at fault raises an error of this package, which names it."""

from __future__ import annotations

import inspect
import itertools
import os
import re
import reprlib
import types
from collections.abc import Callable, Iterable, Mapping
from functools import cache, wraps
from numbers import Integral
from pathlib import Path
from typing import (
    Any,
    BinaryIO,
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

_FLOATS = (float, np.floating)
#: What an argument of a wrong type or value raises, here or in numpy.
_CAUSED = (TypeError, ValueError, OverflowError, AttributeError, IndexError, ZeroDivisionError)
#: Where errors are raised that an argument causes.
_PACKAGES = tuple(f"{Path(module).parent}{os.sep}" for module in (__file__, np.__file__))
_LIBRARY = ("<frozen", f"{Path(os.__file__).parent}{os.sep}")


def refuses(function: Callable[P, R]) -> Callable[P, R]:
    """Makes a public function raise only errors of this package.

    Before the call, floats such as 2048.0 become whole numbers where those are expected. Nothing is
    checked: after an error, the arguments are compared with the annotations, and the first one that
    does not fit is named. Errors of a function that the caller passes in are not changed.
    """

    @wraps(function)
    def refusing(*args: P.args, **kwargs: P.kwargs) -> R:
        if any(isinstance(value, _FLOATS) for value in (*args, *kwargs.values())):
            args, kwargs = _whole(function, args, kwargs)
        try:
            return function(*args, **kwargs)
        except (Warning, ImportError):
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


def _whole(function: Callable[..., Any], args: Any, kwargs: Any) -> tuple[Any, Any]:
    """The arguments, with floats without a fraction as whole numbers where those are expected."""
    names, whole = _parameters(function)

    def converted(name: str | None, value: Any) -> Any:
        is_whole = isinstance(value, _FLOATS) and name in whole and float(value).is_integer()
        return int(value) if is_whole else value

    named = itertools.zip_longest(names[: len(args)], args)
    return (
        tuple(converted(name, value) for name, value in named),
        {name: converted(name, value) for name, value in kwargs.items()},
    )


@cache
def _parameters(function: Callable[..., Any]) -> tuple[list[str], frozenset[str]]:
    """Names of the positional parameters in order, and of those that take whole numbers only."""
    hints = get_type_hints(function)
    positional = inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD
    parameters = inspect.signature(function).parameters.values()
    numbers = {name: {int, float}.intersection(_parts(hint)) for name, hint in hints.items()}
    whole = frozenset(name for name, kinds in numbers.items() if kinds == {int})
    return [p.name for p in parameters if p.kind in positional], whole


def _told(
    error: Exception, function: Callable[..., Any], arguments: Mapping[str, Any]
) -> Exception | None:
    hints = get_type_hints(function)
    # What stands in `**kwargs` is refused by the function that it is passed on to.
    given = [(name, value) for name, value in arguments.items() if name in hints]
    if any(callable(value) for _, value in given) and _of_the_caller(error):
        return None
    if isinstance(error, (ParameterError, *_CAUSED)):
        for name, value in given:
            if not _fits(hints[name], value):
                if isinstance(error, CorsmalFeatError) and name in str(error):
                    return None
                return ParameterError(f"{name} must be {_words(hints[name])}, not {_shown(value)}")
    if isinstance(error, CorsmalFeatError):
        return None
    if isinstance(error, OSError):
        return of_file(error)
    for name, value in given:
        number = isinstance(value, (float, np.floating))
        if number and not np.isfinite(value) and isinstance(error, _CAUSED):
            return ParameterError(f"{name} must be a finite number, not {value}")
        if isinstance(error, TypeError) and "complex" in str(error) and _is_complex(value):
            return ParameterError(f"{name} must be real, not complex")
        if isinstance(error, ZeroDivisionError) and _fits_kind(float, value) and value == 0:
            return ParameterError(f"{name} must not be 0")
    if isinstance(error, TypeError) and "unexpected keyword argument" in str(error):
        return None  # an unknown argument, which `**kwargs` passed on
    if isinstance(error, (*_CAUSED, MemoryError)) and not isinstance(error, AttributeError):
        return ParameterError(f"{function.__name__}: {error}")
    return None


def of_file(error: OSError) -> FileError:
    """The same error as one of this package."""
    kind = MissingFileError if isinstance(error, FileNotFoundError) else FileError
    place = f"{error.filename}: " if error.filename is not None else ""
    told = kind(f"{place}{error.strerror or error}")
    told.errno, told.strerror, told.filename = error.errno, error.strerror, error.filename
    return told


def place(path: Any) -> str:
    """A path as text."""
    if not isinstance(path, (str, os.PathLike)):
        raise ParameterError(f"path must be a path, not {_shown(path)}")
    return os.fsdecode(path)


def destination(path: Any, overwrite: bool) -> str:
    """The path of a file to write, as text."""
    name = place(path)
    if not overwrite and os.path.exists(name):
        raise ParameterError(f"path = {name!r} already exists: overwrite=True replaces it")
    return name


def existing(path: Any) -> str:
    """The path of an existing file or folder, as text."""
    name = place(path)
    try:
        os.stat(name)
    except OSError as error:
        if re.match(r"[A-Za-z][A-Za-z0-9+-]+://", name):
            told = f"{name}: this reads files on a disk: copy it to one (extract reads stores)"
            raise MissingFileError(told) from error
        raise of_file(error) from error
    except ValueError as error:  # a zero byte
        raise ParameterError(f"{name!r}: {error}") from error
    return name


def _of_the_caller(error: BaseException) -> bool:
    """Whether code outside this package, numpy and Python's library took part."""
    step = error.__traceback__
    while step is not None:
        file = step.tb_frame.f_code.co_filename
        library = file.startswith(_LIBRARY) and "site-packages" not in file
        if not (library or file.startswith(_PACKAGES)):
            return True
        step = step.tb_next
    return False


def _shown(value: Any) -> str:
    """A value for a message, at most one line long."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    return reprlib.repr(value)


def _parts(union: Any) -> tuple[Any, ...]:
    """The alternatives of a union, also of unions in it that have names (numpy's since 2.5)."""
    union = getattr(union, "__value__", union)
    if get_origin(union) not in (Union, types.UnionType):
        return (union,)
    return tuple(part for inner in get_args(union) for part in _parts(inner))


_ARRAY_LIKE = frozenset(_parts(npt.ArrayLike))
_DTYPE_LIKE = frozenset(_parts(npt.DTypeLike))
_ARRAYS = (np.ndarray, npt.NDArray)


def _split(hint: Any) -> tuple[frozenset[Any], list[Any]]:
    """numpy's union in a hint, if any, and the other alternatives."""
    kinds = _parts(hint)
    for group in (_ARRAY_LIKE, _DTYPE_LIKE):
        if group <= set(kinds):
            return group, [kind for kind in kinds if kind not in group]
    return frozenset(), list(kinds)


def _fits(hint: Any, value: Any) -> bool:
    """Whether a value fits the annotation of a parameter."""
    group, kinds = _split(hint)
    if group and (_is_array(value) if group is _ARRAY_LIKE else _is_dtype(value)):
        return True
    return any(_fits_kind(kind, value) for kind in kinds)


def _is_array(value: Any) -> bool:
    try:
        return np.asarray(value).dtype.kind in "biufc"
    except Exception:
        return False


def _is_complex(value: Any) -> bool:
    return _is_array(value) and np.iscomplexobj(np.asarray(value))


def _is_dtype(value: Any) -> bool:
    try:
        np.dtype(value)
    except (TypeError, ValueError):
        return False
    return True


def _is_number(value: Any) -> bool:
    """Whether a value is a number, or an array of 0 dimensions that holds one."""
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "biuf"
    return isinstance(value, (bool, int, float, np.bool_, np.integer, np.floating))


def _fits_kind(kind: Any, value: Any) -> bool:
    origin = get_origin(kind)
    if kind is Any or isinstance(kind, TypeVar):
        return True
    if origin is Literal:
        return isinstance(value, str | int | None) and value in get_args(kind)
    if kind in (float, np.floating) or origin is np.floating:
        return _is_number(value)
    if kind in (int, np.integer) or origin is np.integer:
        if isinstance(value, (float, np.floating)):
            return float(value).is_integer()
        return _is_number(value) and np.asarray(value).dtype.kind in "biuO"
    if kind is bool:
        return isinstance(value, (bool, np.bool_, int, np.integer))
    if origin in _ARRAYS:
        return isinstance(value, np.ndarray)
    if is_typeddict(kind):
        return isinstance(value, dict) and kind.__required_keys__ <= value.keys()
    if origin is Callable:
        return callable(value)
    if isinstance(origin, type) and issubclass(origin, Iterable) and origin is not Mapping:
        several = value.ndim > 0 if isinstance(value, np.ndarray) else isinstance(value, origin)
        return several and _elements_fit(kind, value)
    if kind is BinaryIO:
        return hasattr(value, "read")
    found = origin or kind
    return not isinstance(found, type) or isinstance(value, found)


def _elements_fit(kind: Any, value: Any) -> bool:
    hints = [hint for hint in get_args(kind) if hint is not Ellipsis]
    if not hints or not isinstance(value, (list, tuple, str, bytes, np.ndarray)):
        return True
    return all(any(_fits(hint, element) for hint in hints) for element in value)


_NAMES: dict[Any, str] = {
    float: "a number",
    int: "a whole number",
    np.integer: "a whole number",
    np.floating: "a number",
    np.ndarray: "an array of numbers",
    npt.NDArray: "an array of numbers",
    bool: "True or False",
    str: "a string",
    types.NoneType: "None",
    os.PathLike: "a path",
    Mapping: "a mapping",
    dict: "a mapping",
    Callable: "a function",
    BinaryIO: "a binary file",
}


def _words(hint: Any) -> str:
    """The values that an annotation accepts, in words."""
    group, kinds = _split(hint)
    words = []
    if group:
        words.append("an array of numbers" if group is _ARRAY_LIKE else "a numpy type")
    path = any(get_origin(kind) is os.PathLike for kind in kinds)
    for kind in kinds:
        origin = get_origin(kind)
        found = origin or kind
        if origin is Literal:
            words += [repr(choice) for choice in get_args(kind)]
        elif found in _NAMES:
            # A path may be text.
            words += [] if path and kind is str else [_NAMES[found]]
        elif isinstance(found, type) and issubclass(found, Iterable):
            inner = [hint for hint in get_args(kind) if hint not in (Ellipsis, Any)]
            each = f", each {' or '.join(map(_words, inner))}" if inner else ""
            words.append(f"a sequence{each}")
        else:
            words.append(f"a {getattr(found, '__name__', found)}")
    return " or ".join(dict.fromkeys(words))


def seed_of(seed: int) -> int:
    """A seed from the caller: a whole number from 0 to 2**64 - 1."""
    if not isinstance(seed, Integral) or not 0 <= seed < 1 << 64:
        raise ParameterError(f"seed must be a whole number from 0 to 2**64 - 1, not {seed!r}")
    return int(seed)


def whole(name: str, value: int, limit: int) -> int:
    """A whole number from 0 to below `limit`."""
    if not isinstance(value, int | np.integer) or not 0 <= value < limit:
        raise ParameterError(f"{name} must be a whole number from 0 to {limit - 1}, not {value!r}")
    return int(value)
