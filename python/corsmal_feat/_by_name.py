"""Scores by name."""

from __future__ import annotations

from collections.abc import Iterator, KeysView


class ByName:
    """Base class of reports whose scores are also read by name, as in a mapping."""

    values: dict[str, float]

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def __contains__(self, name: object) -> bool:
        return name in self.values

    def __iter__(self) -> Iterator[str]:
        return iter(self.values)

    def __len__(self) -> int:
        return len(self.values)

    def keys(self) -> KeysView[str]:
        """Names of the scores."""
        return self.values.keys()
