"""Arrays of an archive, read on first access."""

from __future__ import annotations

import os
from collections.abc import Iterator, MutableMapping
from typing import Any

import numpy as np
import numpy.typing as npt

from .errors import ParameterError

Values = npt.NDArray[Any]
#: The member of a recording, or of each of its features.
Names = str | dict[str, str]


def read_member(archive: Any, name: str, member: str) -> Values:
    """A member of the archive `name`.

    Raises
    ------
    ParameterError
        The member is damaged, or holds Python objects.
    """
    # `archive[member]` looks through the list of all members.
    try:
        with archive.zip.open(f"{member}.npy") as file:
            values: Values = np.lib.format.read_array(file, allow_pickle=False)
    except Exception as error:  # whatever numpy and zipfile make of damaged bytes
        what = "holds Python objects" if "pickle" in str(error) else f"cannot be read: {error}"
        raise ParameterError(f"{name}: member {member} {what}") from error
    return values


class Members(MutableMapping[str, Any]):
    """The arrays of each recording by id; they are read from the open archive on first access, and
    kept."""

    def __init__(self, archive: Any, name: str, members: dict[str, Names]) -> None:
        self._archive, self._name = archive, name
        # The folder may be left before it is opened again.
        self._path = os.path.abspath(getattr(archive.zip.fp, "name", name))
        self._process = os.getpid()
        self._members = members
        self._read: dict[str, Any] = {}

    def __getitem__(self, recording: str) -> Any:
        if recording not in self._read:
            names = self._members[recording]
            if self._process != os.getpid():
                self._open_again()
            self._read[recording] = (
                read_member(self._archive, self._name, names)
                if isinstance(names, str)
                else {k: read_member(self._archive, self._name, v) for k, v in names.items()}
            )
        return self._read[recording]

    def _open_again(self) -> None:
        """In a forked process, whose open file would move the parent's place in it."""
        file = self._archive.zip.fp
        if hasattr(file, "name"):
            try:
                ours, there = os.fstat(file.fileno()), os.stat(self._path)
                if (ours.st_dev, ours.st_ino) != (there.st_dev, there.st_ino):
                    raise FileNotFoundError
                self._archive = np.load(self._path)
            except OSError as error:
                raise ParameterError(
                    f"{self._name} was moved or replaced after it was loaded: load it again"
                ) from error
        self._process = os.getpid()

    def __setitem__(self, recording: str, values: Any) -> None:
        self._members.setdefault(recording, "")
        self._read[recording] = values

    def __delitem__(self, recording: str) -> None:
        del self._members[recording]
        self._read.pop(recording, None)

    def __contains__(self, recording: object) -> bool:
        return recording in self._members

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def __repr__(self) -> str:
        return f"<arrays of {len(self)} recordings, {len(self._read)} read>"

    def __reduce__(self) -> tuple[type[dict[str, Any]], tuple[dict[str, Any]]]:
        # What another process is sent has the arrays themselves.
        return dict, (dict(self),)
