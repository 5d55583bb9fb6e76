"""The examples in the docstrings."""

from __future__ import annotations

import doctest
from importlib import import_module

import corsmal_feat
import numpy as np
import pytest

MODULES = (
    "_chroma",
    "_harmonic",
    "_mel",
    "_mono",
    "_pitch",
    "_resample",
    "_spectral",
    "_time_domain",
    "filters",
    "onset",
    "spectrum",
)


@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    names = {"np": np, "corsmal_feat": corsmal_feat}
    result = doctest.testmod(import_module(f"corsmal_feat.{module}"), extraglobs=names)
    assert result.attempted and not result.failed
