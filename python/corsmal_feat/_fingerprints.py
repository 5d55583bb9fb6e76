"""Which rows of features a classifier was trained on."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import numpy.typing as npt

from ._warnings import warn
from .errors import ParameterError

Fingerprints = npt.NDArray[np.uint64]

#: rows that are taken at a time
_BLOCK = 4096


def fingerprints(rows: npt.NDArray[Any]) -> Fingerprints:
    """A number for each row [shape=(rows, features)], the same in single and double precision."""
    width = rows.shape[1]
    # Odd factors by chance: rows that differ have the same sum once in 2**32 or less.
    drawn = hashlib.shake_128(b"corsmal-feat").digest(8 * width)
    factors = np.frombuffer(drawn, "<u8").astype(np.uint64) | np.uint64(1)
    found = np.empty(len(rows), np.uint64)
    for start in range(0, len(rows), _BLOCK):
        with np.errstate(over="ignore"):
            block = rows[start : start + _BLOCK].astype(np.float32) + np.float32(0)  # no -0
        found[start : start + _BLOCK] = block.view(np.uint32).astype(np.uint64) @ factors
    return found


def check_rows(fitted: Fingerprints | None, given: Fingerprints | None) -> None:
    """Refuses a description of features of which none are those that a model was fitted on.

    Parameters
    ----------
    fitted : rows that the model was fitted on; None if it was loaded from a file
    given : rows that the description stands for; None if not all are known
    """
    if fitted is None or given is None:
        return
    known = np.isin(fitted, given)
    if not known.any():
        raise ParameterError(
            f"features must hold the rows that the model was fitted on, but has none of these"
            f" {len(known)}: fit on features.summary, or on what the FeatureExtractor gave, without"
            " scaling or other changes; corsmal-feat train --standardize keeps the scaling in the"
            " model"
        )
    if not known.all():
        warn(
            f"features has only {known.sum()} of the {len(known)} rows that the model was fitted"
            " on: the model will not know the sample rates and channels of the others"
        )
