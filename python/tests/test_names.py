"""The stub of the extension module and the lists of public names, beside what is there."""

from __future__ import annotations

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path

import corsmal_feat
import pytest
from corsmal_feat import _core

ROOT = Path(__file__).parents[2]
STUB = ast.parse(Path(corsmal_feat.__file__).with_name("_core.pyi").read_text(encoding="utf-8"))
STUBS = {n.name: n for n in STUB.body if isinstance(n, ast.FunctionDef | ast.ClassDef)}
MODULES = (
    "", "arrow", "classifiers", "corsmal", "decompose", "display", "effects", "errors", "feature",
    "filters", "nets", "onset", "ray", "util", "vision",
)  # fmt: skip


def test_every_public_module_is_listed() -> None:
    files = {path.stem for path in (ROOT / "python/corsmal_feat").glob("[!_]*.py")}
    assert files | {""} == set(MODULES)


def parameters(stub: ast.FunctionDef) -> list[str]:
    names = [a.arg for a in (*stub.args.posonlyargs, *stub.args.args, *stub.args.kwonlyargs)]
    return [name for name in names if name not in ("self", "cls")]


def native(function: object) -> list[str]:
    assert callable(function)
    return [name for name in inspect.signature(function).parameters if name != "self"]


def test_the_stub_has_every_native_name() -> None:
    there = {name for name in vars(_core) if not name.startswith("__")}
    assert not there - set(STUBS), "missing in _core.pyi"
    assert not set(STUBS) - there, "in _core.pyi only"
    listed = next(n.value for n in STUB.body if isinstance(n, ast.Assign))
    assert set(ast.literal_eval(listed)) == there | {"__version__"}, "__all__ of _core.pyi"


@pytest.mark.parametrize("name", sorted(STUBS))
def test_the_stub_has_native_parameters(name: str) -> None:
    stub, there = STUBS[name], getattr(_core, name)
    if isinstance(stub, ast.FunctionDef):
        assert parameters(stub) == native(there)
        return
    methods = {n.name: n for n in stub.body if isinstance(n, ast.FunctionDef)}
    public = {method for method in vars(there) if not method.startswith("_")}
    assert public == {method for method in methods if not method.startswith("_")}
    for method in public:
        if callable(getattr(there, method)):
            assert parameters(methods[method]) == native(getattr(there, method)), method


@pytest.mark.parametrize("module", MODULES)
def test_all_has_every_public_name(module: str) -> None:
    found = import_module(f"corsmal_feat.{module}".rstrip("."))
    exported: list[str] = found.__all__
    assert len(set(exported)) == len(exported)
    assert not [name for name in exported if not hasattr(found, name)], "not there"
    own = {
        name
        for name, value in vars(found).items()
        if not name.startswith("_")
        and (inspect.isfunction(value) or inspect.isclass(value))
        and value.__module__ == found.__name__
    }
    assert not own - set(exported), "missing in __all__"


def test_every_public_name_is_documented() -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    text = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    for module in MODULES:
        found = import_module(f"corsmal_feat.{module}".rstrip("."))
        names = [name for name in found.__all__ if not name.startswith("__")]
        missing = [name for name in names if not re.search(rf"\b{re.escape(name)}\b", text)]
        assert not missing, f"{found.__name__}: not in docs/: {missing}"
