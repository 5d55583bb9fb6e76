"""Configurations and their plans, which a process makes once."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

from . import _core

#: Configurations whose plans a process keeps.
KEPT = 8


@dataclass(frozen=True)
class Computation:
    """A configuration and its plan, which is made once."""

    recordings: _core.Recordings
    #: The effective configuration as JSON, and its hash.
    config: str
    config_hash: str
    #: Frame-level features; none where there is a summary.
    features: tuple[str, ...]

    @classmethod
    def of(cls, chosen: tuple[str, str], overrides: list[str]) -> Computation:
        """The computation of a configuration, kept as long as its file does not change."""
        stamp = stamp_of(chosen[1]) if chosen[0] == "path" else None
        key = (os.getpid(), chosen, tuple(overrides), stamp)
        if key in computations:
            return computations[key]
        text, config_hash = _core.effective_config(chosen, overrides)
        tree = json.loads(text)
        features = () if tree.get("summary") is not None else tuple(tree["features"])
        made = cls(_core.Recordings(chosen, overrides), text, config_hash, features)
        # The file of a projection may change between two calls.
        if tree.get("projection") is None:
            while len(computations) >= KEPT:
                del computations[next(iter(computations))]
            computations[key] = made
        return made


computations: dict[Any, Computation] = {}


def stamp_of(path: str) -> tuple[int, int] | None:
    """What changes when a file changes; None if it does not exist, which its reader reports."""
    try:
        found = os.stat(path)
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
