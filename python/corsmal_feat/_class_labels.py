"""Class labels, and those in model files, which hold texts."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import ParameterError

__all__ = ["check_named", "class_labels", "label_kind", "require_kept"]

#: numpy's letters of the types that come back as they were
_KEPT = "biufUT"


def check_named(name: str, values: Any, array: npt.NDArray[Any], owner: str) -> None:
    """Refuses bytes, whose encoding nobody knows, and missing values among names.

    `values` are what `array` was made of: beside texts, numpy makes a text of NaN.
    """
    mixed = isinstance(values, (list, tuple))
    each = values if mixed else array.reshape(-1)
    kind = "O" if mixed else array.dtype.kind
    if kind == "S" or (kind == "O" and any(isinstance(value, bytes) for value in each)):
        raise ParameterError(f"{owner}: {name} holds bytes, expected strings: decode them first")
    if kind in "OfcmM":
        missing = [row for row, value in enumerate(each) if _is_missing(value)]
        if missing:
            raise ParameterError(f"{owner}: {name} contains missing values (row {missing[0]})")


def label_kind(classes: npt.NDArray[Any]) -> str:
    """numpy's letter for the type of the classes; of objects, the type that they all have."""
    if classes.dtype != object:
        return str(classes.dtype.kind)
    kinds = {np.asarray(label).dtype.kind if np.ndim(label) == 0 else "O" for label in classes}
    return str(kinds.pop()) if len(kinds) == 1 else "O"


def require_kept(classes: npt.NDArray[Any]) -> None:
    """Refuses to keep classes that would come back as text."""
    kind = label_kind(classes)
    if kind not in _KEPT:
        raise ParameterError(
            "a model file keeps classes that are texts, numbers or booleans, not "
            f"{classes.dtype} ({classes[0]!r}): fit with such labels"
        )
    if kind in "iu" and any(not -(2**63) <= int(label) < 2**63 for label in classes):
        raise ParameterError("a model file keeps whole numbers up to 2**63 - 1: fit with texts")


def class_labels(header: dict[str, Any]) -> npt.NDArray[Any]:
    """Labels in the type that they had in training."""
    names = np.asarray(header["labels"], dtype=object)
    provenance = header["provenance"]
    kind = provenance.get("label_kind", "") if isinstance(provenance, dict) else ""
    if kind == "b":
        return np.asarray(names == "True")
    if kind in ("i", "u"):
        return names.astype(np.int64)
    if kind == "f":
        return names.astype(np.float64)
    return names.astype(str)


def _is_missing(value: Any) -> bool:
    # Not equal to itself: NaN, NaT; nor different: pandas' NA has no truth.
    try:
        return value is None or bool(value != value)
    except TypeError:
        return True
