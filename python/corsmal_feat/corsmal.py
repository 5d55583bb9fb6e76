"""Compound inputs of the benchmark's systems: re-exported from one private module per family."""

from ._harmonic import abs_cqt, af193, hpss_audio, hpss_mags, hpss_masks
from ._mono import to_mono
from ._pitch import piptrack_both

__all__ = [
    "abs_cqt",
    "af193",
    "hpss_audio",
    "hpss_mags",
    "hpss_masks",
    "piptrack_both",
    "to_mono",
]
