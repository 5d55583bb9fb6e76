"""The examples in the docstrings, and that every public function has one."""

from __future__ import annotations

import doctest
import json
from collections.abc import Iterator
from importlib import import_module
from inspect import getattr_static, isclass, signature
from pathlib import Path
from types import FunctionType
from typing import Any

import corsmal_feat
import matplotlib
import numpy as np
import pytest
import soundfile
from matplotlib import pyplot
from PIL import Image

PACKAGE = Path(corsmal_feat.__file__).parent
#: every module that has an example
MODULES = sorted(p.stem for p in PACKAGE.glob("*.py") if ">>> " in p.read_text(encoding="utf-8"))

ANNOTATIONS = """\
id,container id,scenario,background,illumination,width at the top,width at the bottom,height,\
depth,container capacity,container mass,filling type,filling level,filling density,filling mass,\
object mass,handover starting frame,handover start timestamp,handover hand
0,2,2,1,0,69.0,42.0,72.0,-1.0,185.0,2.0,2,1,0.82,76.0,78.0,-1,-1,-1
1,7,0,0,0,193.0,193.0,241.0,69.0,3209.397,59.0,0,0,0.0,0.0,59.0,-1,-1,-1
"""
SUBMISSION = """\
Container ID,Sequence,Filling level,Filling type,Container Capacity
2,73,50,2,200
7,0,0,0,3000
"""


def record(path: Path, hz: float, seed: int, rate: int = 22050, channels: int = 1) -> None:
    """A second of a tone in noise."""
    path.parent.mkdir(parents=True, exist_ok=True)
    noise = 0.02 * np.random.default_rng(seed).standard_normal((rate, channels))
    tone = 0.2 * np.sin(2 * np.pi * hz * np.arange(rate) / rate)
    soundfile.write(path, tone[:, None] + noise, rate)


def view(folder: Path, name: str, around: float) -> None:
    """A camera 1 m from the origin, 5 cm above it, and its mask of a cylinder of 60 by 100 mm."""
    s, c = np.sin(around), np.cos(around)
    rotation = [[-s, c, 0.0], [0.0, 0.0, -1.0], [-c, -s, 0.0]]
    intrinsic = [[900.0, 0.0, 320.0], [0.0, 900.0, 320.0], [0.0, 0.0, 1.0]]
    camera = {"rvec": rotation, "tvec": [[0.0], [0.05], [1.0]]}
    numbers = {"intrinsic": {"rgb": intrinsic}, "extrinsic": {"rgb": camera}}
    (folder / f"{name}.json").write_text(json.dumps(numbers))
    mask = np.zeros((700, 640), np.uint8)
    mask[275:366, 293:348] = 255
    Image.fromarray(mask).save(folder / f"{name}.png")
    depth = np.where(mask, 970 + np.abs(np.arange(640) - 320)[None, :], 0)
    Image.fromarray(depth.astype(np.uint16)).save(folder / f"{name}_depth.png")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the examples speak of."""
    folder = tmp_path_factory.mktemp("examples")
    record(folder / "recording.wav", 440, 0, rate=44100, channels=2)
    for kind, hz in (("rice", 3000), ("water", 300)):
        record(folder / f"{kind}.wav", hz, 99)
        for take in range(6):
            record(folder / "audio" / kind / f"{take}.wav", hz + 10 * take, take)
    features = corsmal_feat.extract([folder / "audio"], preset="esc26", out=folder / "features.npz")
    labels = [name.split("/")[0] for name in features.ids]
    forest = corsmal_feat.RandomForest(20, random_state=1).fit(features.summary, labels)
    forest.save(folder / "bottles.model", features=features)
    paths = [folder / "audio" / f"{name}.wav" for name in features.ids]
    network = corsmal_feat.nets.train("m1", paths, labels, recipe={"epochs": 20})
    network.save(folder / "pouring.safetensors")
    for name in ("rf", "knn"):
        result = corsmal_feat.cross_validate(
            folder / "features.npz", labels="folders", cv=3, classifier=name
        )
        result.predictions.save(folder / f"{name}.csv")
    (folder / "annotations.csv").write_text(ANNOTATIONS)
    (folder / "team.csv").write_text(SUBMISSION)
    for i in (1, 2):
        view(folder, f"c{i}", i * np.pi / 2)
    return folder


@pytest.fixture
def inside(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(folder)
    matplotlib.use("Agg")
    yield
    pyplot.close("all")


@pytest.mark.usefixtures("inside")
@pytest.mark.parametrize("module", MODULES)
def test_examples(module: str) -> None:
    names = {"np": np, "corsmal_feat": corsmal_feat}
    result = doctest.testmod(import_module(f"corsmal_feat.{module}"), extraglobs=names)
    assert not result.failed


NAMESPACES = (
    "", "feature", "onset", "effects", "decompose", "filters", "util", "display", "corsmal",
    "vision", "nets", "classifiers",
)  # fmt: skip


def public(kind: type) -> list[tuple[str, Any]]:
    """Every public function, or class, with its name."""
    found = []
    for namespace in NAMESPACES:
        module = getattr(corsmal_feat, namespace) if namespace else corsmal_feat
        for name in module.__all__:
            member = getattr(module, name)
            if isinstance(member, kind):
                found.append(pytest.param(member, id=f"{namespace}.{name}".strip(".")))
    return found


@pytest.mark.parametrize("function", public(FunctionType))
def test_functions_are_typed_and_documented(function: FunctionType) -> None:
    text = function.__doc__ or ""
    parameters = signature(function).parameters
    for name, parameter in parameters.items():
        assert parameter.annotation is not parameter.empty, name
        assert name in text, f"{name} is not in the docstring"
    assert signature(function).return_annotation is not signature(function).empty
    assert "Parameters\n" in text or not parameters
    nothing = signature(function).return_annotation == "None"
    assert "Returns\n" in text or "Yields\n" in text or nothing
    assert ">>> " in text and "+SKIP" not in text


@pytest.mark.parametrize("kind", public(type))
def test_classes_are_typed_and_documented(kind: type) -> None:
    assert kind.__doc__
    is_error, is_dict = issubclass(kind, Exception), issubclass(kind, dict)
    if is_error or is_dict:
        return
    assert "Parameters\n" in kind.__doc__ or "Attributes\n" in kind.__doc__, kind
    assert ">>> " in kind.__doc__, kind
    for name in dir(kind):
        if name.startswith("_") or not (kind.__module__ or "").startswith("corsmal_feat"):
            continue
        member = getattr_static(kind, name)
        owner = next(base for base in kind.__mro__ if name in vars(base))
        if not owner.__module__.startswith("corsmal_feat") or isclass(member):
            continue
        if isinstance(member, (FunctionType, classmethod, staticmethod, property)):
            function = member.fget if isinstance(member, property) else member
            function = getattr(function, "__func__", function)
            assert function.__doc__, f"{kind.__name__}.{name}"
            assert signature(function).return_annotation is not signature(function).empty, name
