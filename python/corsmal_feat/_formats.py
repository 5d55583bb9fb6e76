"""Sample rates and channels of recordings, as far as they matter to features."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

#: Sample rate and number of channels; None if unknown.
Format = tuple[int | None, int | None]


def taken(
    config: dict[str, Any], known: Collection[Format]
) -> tuple[list[int] | None, list[int] | None]:
    """Sample rates and numbers of channels that fit the recordings with the formats `known`; None
    for any. The same rule as that of model files."""
    signal, summary = config["signal"], config["summary"] or {}
    own_rate = not signal["sample_rate"]
    every_channel = signal["channels"] == "all" and not summary.get("average_channels")
    selected = isinstance(signal["channels"], list)
    rates = sorted({rate for rate, _ in known if rate is not None})
    channels = sorted({count for _, count in known if count is not None})
    return (
        rates if own_rate and rates else None,
        channels if (every_channel or selected) and channels else None,
    )


def mismatch(
    found: Format, rates: list[int] | None, channels: list[int] | None, owner: str
) -> str | None:
    """Why a recording with the format `found` does not fit; None if it does."""
    for value, known, what in zip(found, (rates, channels), ("Hz", "channels"), strict=True):
        if value is not None and known is not None and value not in known:
            trained = ", ".join(map(str, known))
            return f"{value} {what}, but {owner} was trained on {trained}"
    return None
