"""The examples in the docstrings."""

from __future__ import annotations

import doctest
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import FunctionType

import corsmal_feat
import numpy as np
import pytest

PACKAGE = Path(corsmal_feat.__file__).parent
#: every module that has an example
MODULES = sorted(p.stem for p in PACKAGE.glob("*.py") if ">>> " in p.read_text(encoding="utf-8"))


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    names = {"np": np, "corsmal_feat": corsmal_feat}
    # Those with files are checked for their form only.
    result = doctest.testmod(import_module(f"corsmal_feat.{module}"), extraglobs=names)
    assert not result.failed


#: the modules with librosa's names
NAMESPACES = ("", "feature", "onset", "effects", "decompose", "filters", "util", "display")


@pytest.mark.parametrize("namespace", NAMESPACES)
def test_functions_are_documented(namespace: str) -> None:
    module = getattr(corsmal_feat, namespace) if namespace else corsmal_feat
    for name in module.__all__:
        function = getattr(module, name)
        if not isinstance(function, FunctionType):
            continue
        text = function.__doc__ or ""
        assert "Parameters\n" in text or not signature(function).parameters, name
        assert "Returns\n" in text or "Yields\n" in text, name
        assert ">>> " in text, name
