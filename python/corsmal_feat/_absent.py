"""What librosa has and this package has not."""

from __future__ import annotations


def absent(module: str, name: str) -> AttributeError:
    """The error for a name that is not there; it says where to look."""
    return AttributeError(
        f'module {module!r} has no attribute {name!r}; "Coming from librosa" in the'
        " documentation lists what is available, and librosa works alongside"
    )
