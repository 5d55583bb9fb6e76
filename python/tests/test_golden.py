"""Every golden case of `shared/parity`, one test for each function."""

from __future__ import annotations

import functools
import importlib
import json
import os
import warnings
from pathlib import Path

import corsmal_feat
import numpy as np
import pytest

SHARED = Path(os.environ.get("CORSMAL_SHARED", Path(__file__).parents[3] / "shared"))
GOLDEN = SHARED / "parity" / "golden"

if not (GOLDEN / "manifest.json").is_file():
    pytest.skip(f"{GOLDEN} is absent: golden cases were not run", allow_module_level=True)

MANIFEST = json.loads((GOLDEN / "manifest.json").read_text())
CASES = [case for case in MANIFEST["cases"] if not case.get("ill_conditioned")]
FUNCTIONS = sorted({case["function"] for case in CASES})


@functools.cache
def archive(name: str) -> np.lib.npyio.NpzFile:
    return np.load(GOLDEN / name)


@functools.cache
def inputs_of(name: str) -> np.ndarray:
    return archive(MANIFEST["inputs_file"])[name]


def function_of(name: str):
    """`librosa.a.b` is `corsmal_feat.a.b`, `corsmal.a` is `corsmal_feat.corsmal.a`."""
    head, path = name.split(".", 1)
    found = corsmal_feat if head == "librosa" else importlib.import_module("corsmal_feat.corsmal")
    return functools.reduce(getattr, path.split("."), found)


def arguments_of(case: dict) -> dict:
    def cast(array: np.ndarray) -> np.ndarray:
        return array.astype(case["input_dtype"]) if array.dtype.kind == "f" else array

    return {key: cast(inputs_of(name)) for key, name in case["inputs"].items()} | case["params"]


def trouble(case: dict) -> str:
    """What is wrong with a case; empty if nothing."""
    function, arguments = function_of(case["function"]), arguments_of(case)
    if "raises" in case:
        try:
            function(**arguments)
        except (ValueError, TypeError):
            return ""
        return "was not refused"
    got = np.asarray(function(**arguments))
    if list(got.shape) != case["full_shape"]:
        return f"has shape {got.shape}, expected {tuple(case['full_shape'])}"
    if "select" in case:
        got = np.take(got, case["select"]["indices"], case["select"]["axis"])
    want, tolerance = archive(case["file"])[case["key"]], case["tolerance"]
    error = np.abs(got - want)
    off = ~(error <= tolerance["atol"] + tolerance["rtol"] * np.abs(want))
    if off.sum() > np.ceil(tolerance.get("mismatch_fraction", 0) * want.size):
        return f"{off.sum()} of {want.size} values are off by up to {np.nanmax(error[off]):.3g}"
    if off.any() and error[off].max() > tolerance.get("mismatch_atol", np.inf):
        return f"is off by {error[off].max():.3g} somewhere"
    return ""


@pytest.mark.parametrize("function", FUNCTIONS)
def test_golden_cases(function: str):
    cases = [case for case in CASES if case["function"] == function]
    with warnings.catch_warnings():
        # Cases without content warn, as librosa does; that is tested where it belongs.
        warnings.simplefilter("ignore")
        failures = [f"{c['id']} {c['params']}: {why}" for c in cases if (why := trouble(c))]
    assert not failures, f"{len(failures)} of {len(cases)} cases:\n" + "\n".join(failures)
