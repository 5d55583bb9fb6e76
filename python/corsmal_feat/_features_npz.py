"""Outputs in `.npz` archives."""

from __future__ import annotations

import json
import zipfile
from contextlib import ExitStack
from typing import Any

import numpy as np

from ._members import Members, read_member
from .errors import ParameterError

_TIMES = "__times__/"
_LABELS = "__labels__/"
#: Members of every output.
_NEEDED = ("__meta__", "__config__", "__ids__", "__outcomes__")


def of_npz(name: str) -> dict[str, Any]:
    """The fields of `Features` from an archive. Arrays of frames are read on first access."""
    # numpy leaves a file open that is no archive.
    with ExitStack() as stack:
        file: Any = stack.enter_context(open(name, "rb"))
        try:
            archive = np.load(file, allow_pickle=False)
        except (ValueError, EOFError, zipfile.BadZipFile) as error:
            raise ParameterError(
                f"{name} is not an output of corsmal-feat: it is not an .npz archive;"
                " corsmal_feat.load reads recordings"
            ) from error
        except Exception as error:  # whatever zipfile makes of a damaged directory
            raise ParameterError(f"{name} is damaged: {error}") from error
        if not isinstance(archive, np.lib.npyio.NpzFile):
            raise ParameterError(f"{name} is not an output of corsmal-feat: it is a single array")
        archive.fid = file
        fields = _fields(archive, name)
        stack.pop_all()  # it is closed with the archive from now on
        return fields


def _fields(archive: Any, name: str) -> dict[str, Any]:
    members: list[str] = archive.files
    absent = next((k for k in _NEEDED if k not in members), None)
    if absent is not None:
        objects = [member for member in members if _holds_objects(archive, member)]
        why = f"{objects[0]} holds Python objects, which are never read" if objects else ""
        raise ParameterError(
            f"{name} is not an output of corsmal-feat: {why or f'it has no {absent}'}"
        )
    # A directory entry that is part of another one: we write neither comments nor such fields.
    if any(info.comment or b"PK\1\2" in info.extra for info in archive.zip.infolist()):
        raise ParameterError(f"{name} is damaged: its directory hides members")
    frames = [member for member in members if _is_frames(member)]
    run = {k: read_member(archive, name, k) for k in members if not _is_frames(k)}
    config = json.loads(run["__config__"].tobytes())
    ids = [str(i) for i in run["__ids__"]]
    known = set(ids)
    arrays: dict[str, Any] = {}
    times: dict[str, Any] = {}
    several = len(config["features"]) > 1
    for member in frames:
        key = member.removeprefix(_TIMES)
        into = arrays if key == member else times
        recording, _, feature = key.rpartition("/") if several else (key, "", "")
        if recording not in known:
            # Added by someone, or renamed by damage, which reading notices.
            read_member(archive, name, member)
        if several:
            into.setdefault(recording, {})[feature] = member
        else:
            into[key] = member
    summary, names = run.get("__summary__"), [str(n) for n in run.get("__summary_names__", ())]
    if summary is not None and summary.shape != (len(ids), len(names)):
        raise ParameterError(
            f"{name} is damaged: a summary of shape {summary.shape} of {len(ids)} recordings and"
            f" {len(names)} names"
        )
    if summary is None:
        keys = list(config["features"]) if several else None
        for what, found in (("frames", arrays), ("times", times)):
            _require(name, what, found, ids, keys)
    if not frames:
        archive.close()
    return {
        "ids": ids,
        "arrays": Members(archive, name, arrays) if arrays else {},
        "times": Members(archive, name, times) if times else {},
        "summary": summary,
        "names": names,
        "labels": {k.removeprefix(_LABELS): v for k, v in run.items() if k.startswith(_LABELS)},
        "config": config,
        "config_hash": json.loads(run["__meta__"].tobytes())["config_hash"],
        "outcomes": [json.loads(line) for line in run["__outcomes__"].tobytes().splitlines()],
    }


def _require(
    name: str, what: str, found: dict[str, Any], ids: list[str], features: list[str] | None
) -> None:
    """Refuses an archive that lacks members of a recording: damage renames or hides some."""
    wanted = set(features or ())
    for recording in ids:
        if recording not in found or (wanted and not wanted <= found[recording].keys()):
            raise ParameterError(f"{name} is damaged: it lacks {what} of {recording!r}")


def _holds_objects(archive: Any, member: str) -> bool:
    """Whether the header of a member says so; its values are not read."""
    try:
        with archive.zip.open(f"{member}.npy") as file:
            return b"'|O'" in file.read(256)
    except (KeyError, EOFError, zipfile.BadZipFile):
        return False


def _is_frames(member: str) -> bool:
    return member.startswith(_TIMES) or not member.startswith("__")
