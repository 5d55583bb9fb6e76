"""Compound inputs of the benchmark's systems: re-exported from one private module per family."""

from ._mono import to_mono
from ._pitch import piptrack_both

__all__ = ["piptrack_both", "to_mono"]
