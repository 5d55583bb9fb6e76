"""Predictions, as in prediction files."""

from __future__ import annotations

import csv
import io
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ._refusals import destination, refuses

StrPath = str | os.PathLike[str]


@dataclass(frozen=True, eq=False)
class Predictions:
    """Predictions of recordings, as in the files that the command writes.

    Attributes
    ----------
    columns : the other columns as text, such as `id`, `fold`, `true`
    predicted : name of each predicted class; "" if there is none, "unknown" if rejected
    labels : names of the classes, in the order of `proba`
    proba : probabilities [shape=(rows, classes)]; NaN if there are none

    Examples
    --------
    >>> fused = corsmal_feat.fuse(["rf.csv", "knn.csv"])
    >>> len(fused), fused.ids[0], fused.predicted[0], fused.labels
    (12, 'rice/0', 'rice', ['rice', 'water'])
    >>> fused.proba.shape
    (12, 2)
    """

    columns: dict[str, list[str]]
    predicted: list[str]
    labels: list[str]
    proba: npt.NDArray[np.float64]
    _text: str = field(repr=False)

    @property
    def ids(self) -> list[str]:
        """Id of each recording."""
        return next(iter(self.columns.values()))

    def __len__(self) -> int:
        return len(self.predicted)

    @refuses
    def save(self, path: StrPath, *, overwrite: bool = True) -> None:
        """Writes a prediction file: a CSV that `score`, `fuse` and the command read.

        An existing file is replaced; `overwrite=False` refuses it.
        """
        Path(destination(path, overwrite)).write_text(self._text, encoding="utf-8", newline="")


def parse(text: str) -> Predictions:
    """Predictions from the text of a prediction file."""
    header, *rows = csv.reader(io.StringIO(text))
    at = header.index("predicted")
    labels = [name.removeprefix("p_") for name in header[at + 1 :]]
    columns = {name: [row[i] for row in rows] for i, name in enumerate(header[:at])}
    numbers = [[float(cell) if cell else np.nan for cell in row[at + 1 :]] for row in rows]
    proba = np.asarray(numbers, dtype=np.float64).reshape(len(rows), len(labels))
    return Predictions(columns, [row[at] for row in rows], labels, proba, text)
