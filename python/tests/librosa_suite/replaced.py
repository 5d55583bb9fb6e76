"""A pytest plugin that puts corsmal_feat in librosa's place, for librosa's own tests.

Every function that both have is replaced in librosa's modules before the tests are collected. A
test counts only if it called one of them: `counted` is what the run is judged by.
"""

from __future__ import annotations

import functools
import types
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import corsmal_feat
import pytest

MODULES = ("", "feature", "effects", "decompose", "onset", "filters", "util")

replaced: list[str] = []
_calls = 0


def _counting(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        global _calls
        _calls += 1
        return function(*args, **kwargs)

    return call


def _replace(module: str) -> None:
    theirs = import_module(f"librosa.{module}".rstrip("."))
    ours = getattr(corsmal_feat, module) if module else corsmal_feat
    for name in ours.__all__:
        function = getattr(ours, name)
        old = getattr(theirs, name, None)
        if isinstance(function, types.FunctionType) and callable(old):
            setattr(theirs, name, _counting(function))
            replaced.append(f"librosa.{module}.{name}".replace("..", "."))


for _module in MODULES:
    _replace(_module)
# What its tests expect: librosa's error from its own functions, ours from those that replace them.
_librosa = import_module("librosa")
_librosa.ParameterError = (_librosa.ParameterError, corsmal_feat.ParameterError)


def _no_recording(*args: Any, **kwargs: Any) -> None:
    pytest.skip("needs a recording, which the source distribution does not hold")


for _name in ("ex", "example"):
    for _owner in (_librosa, _librosa.util):
        setattr(_owner, _name, _no_recording)

passed: set[str] = set()
failed: set[str] = set()
counted: set[str] = set()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Iterator[None]:
    before = _calls
    try:
        return (yield)
    except (FileNotFoundError, corsmal_feat.DecodeError) as error:
        if "No such file" not in str(error):
            raise
        pytest.skip(f"needs a recording: {error}")
    finally:
        if _calls > before:
            counted.add(item.nodeid)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "call" and report.outcome in ("passed", "failed"):
        (passed if report.outcome == "passed" else failed).add(report.nodeid)
