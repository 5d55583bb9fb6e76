"""Warnings that point to the line of the caller."""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path

from ._core import in_python

_HERE = f"{Path(__file__).parent}{os.sep}"


def warn(message: str, category: type[Warning] = UserWarning) -> None:
    """A warning that points to the caller's line, outside this package."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_HERE):
        level, frame = level + 1, frame.f_back
    warnings.warn(in_python(message), category, stacklevel=level)
