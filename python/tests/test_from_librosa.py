"""The page "coming from librosa" beside librosa's own list of names."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path

import corsmal_feat
import pytest

PAGE = Path(__file__).parents[2] / "docs" / "from-librosa.md"
SECTIONS = re.split(r"\n## (librosa[\w.]*)\n", PAGE.read_text(encoding="utf-8"))[1:]
TABLES = dict(zip(SECTIONS[::2], SECTIONS[1::2], strict=True))
MODULES = {
    "core", "beat", "decompose", "display", "effects", "feature", "filters", "onset", "segment",
    "sequence", "util",
}  # fmt: skip
#: in librosa's documentation, and not in the list of its module
UNLISTED = {"librosa.effects": {"preemphasis", "deemphasis"}}


def rows(section: str) -> dict[str, tuple[str, str]]:
    found = re.findall(r"^\| `(\w+)` \| (\w+) \| (.*?) ?\|$", TABLES[section], re.M)
    return {name: (state, note) for name, state, note in found}


def test_every_module_of_librosa_has_a_table() -> None:
    wanted = {f"librosa.{module}" for module in MODULES - {"core"}}
    assert set(TABLES) == wanted | {"librosa", "librosa.feature.inverse"}


@pytest.mark.parametrize("section", TABLES)
def test_names_and_states(section: str) -> None:
    theirs = import_module(section)
    listed = set(theirs.__all__) | UNLISTED.get(section, set())
    if section in ("librosa", "librosa.feature"):
        listed -= MODULES | {"inverse"}
    table = rows(section)
    assert set(table) == listed
    ours: object = corsmal_feat
    for part in section.split(".")[1:]:
        ours = getattr(ours, part, None)
    for name, (state, note) in table.items():
        assert state in ("equal", "differs", "absent"), name
        assert hasattr(ours, name) == (state != "absent"), name
        assert bool(note) == (state == "differs"), name
    there = sum(state != "absent" for state, _ in table.values())
    assert f"\n{there} of {len(table)}.\n" in TABLES[section]


def parameters(function: object) -> dict[str, tuple[str, str]]:
    """Kind and default of each, without what librosa no longer wants and what it passes on."""
    assert callable(function)
    found = inspect.signature(inspect.unwrap(function)).parameters.values()
    return {
        p.name: (p.kind.name, repr(p.default))
        for p in found
        if p.kind is not inspect.Parameter.VAR_KEYWORD and "DEPRECATED" not in repr(p.default)
    }


@pytest.mark.parametrize("section", TABLES)
def test_parameters_and_defaults(section: str) -> None:
    theirs = import_module(section)
    for name, (state, note) in rows(section).items():
        if state == "absent" or inspect.isclass(getattr(theirs, name)):
            continue
        ours: object = corsmal_feat
        for part in (*section.split(".")[1:], name):
            ours = getattr(ours, part)
        if not callable(ours):
            continue
        wanted, found = parameters(getattr(theirs, name)), parameters(ours)
        missing = {key for key, value in wanted.items() if found.get(key) != value}
        if state == "equal":
            assert not missing, f"{name}: {missing}"
            order = [key for key in found if key in wanted]
            assert order == list(wanted), name
        else:
            assert not [key for key in missing if f"`{key}`" not in note], f"{name}: {missing}"
