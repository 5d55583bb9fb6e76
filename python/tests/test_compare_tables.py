"""`corsmal-feat compare` on tables that other programs wrote."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pandas = pytest.importorskip("pandas")
pytest.importorskip("pyarrow")


def compare(
    folder: Path, a: dict[str, Any], b: dict[str, Any], *options: str
) -> subprocess.CompletedProcess[bytes]:
    command = os.environ.get("CORSMAL_FEAT")
    if not command:
        pytest.skip("CORSMAL_FEAT is not set: the path of the command")
    for name, columns in (("a.parquet", a), ("b.parquet", b)):
        pandas.DataFrame({"id": ["p", "q"], **columns}).to_parquet(folder / name)
    paths = [folder / "a.parquet", folder / "b.parquet"]
    return subprocess.run(
        [command, "compare", *paths, *options, "--json"], capture_output=True, check=False
    )


def compared(folder: Path, a: dict[str, Any], b: dict[str, Any], *options: str) -> dict[str, Any]:
    ran = compare(folder, a, b, *options)
    assert ran.returncode in (0, 1), ran.stderr
    report: dict[str, Any] = json.loads(ran.stdout)
    assert report["within"] == (ran.returncode == 0)
    return report


def test_a_large_column_does_not_hide_a_small_one(tmp_path: Path) -> None:
    centroid = [2000.0, 2100.0]
    a = {"spectral_centroid.mean": centroid, "rms.mean": [0.010, 0.012]}
    report = compared(tmp_path, a, {**a, "rms.mean": [0.020, 0.002]})
    assert not report["within"]
    table = report["features"][0]
    assert table["differing"] == 2
    assert all(cause["kind"] != "rounding" for cause in table["causes"]), table["causes"]
    # Roundings of each column are none.
    near = {name: np.array(values) * (1 + 1e-7) for name, values in a.items()}
    assert compared(tmp_path, a, near)["within"]


def test_the_difference_that_is_told_is_one(tmp_path: Path) -> None:
    a = {"spectral_centroid.mean": [2000.0, 2100.0], "rms.mean": [0.010, 0.012]}
    b = {"spectral_centroid.mean": [2000.0, 2100.01], "rms.mean": [0.010, 0.017]}
    largest = compared(tmp_path, a, b)["features"][0]["largest"]
    assert (largest["array"], largest["position"]) == ("q", "rms.mean")


def test_coefficients_of_a_vector_have_one_scale(tmp_path: Path) -> None:
    a = {"ch0/mfcc[0].mean": [-400.0, -380.0], "ch1/mfcc[12].mean": [0.5, 0.25]}
    near = {**a, "ch1/mfcc[12].mean": [0.501, 0.25]}
    assert compared(tmp_path, a, near)["within"]
    other = {"ch0/mfcc[0].mean": [-400.0, -380.0], "ch0/mfcc[12].std": [0.5, 0.25]}
    near = {**other, "ch0/mfcc[12].std": [0.501, 0.25]}
    assert not compared(tmp_path, other, near)["within"]


def test_nothing_equals_an_infinity(tmp_path: Path) -> None:
    a, b = {"x": [1.0, -np.inf]}, {"x": [np.inf, np.inf]}
    for options in ([], ["--rtol", "1e-5"], ["--atol", "1", "--rtol", "1e-5"]):
        assert not compared(tmp_path, a, b, *options)["within"]
        assert compared(tmp_path, b, b, *options)["within"]


@pytest.mark.parametrize("beside", [{}, {"x": [1.0, 2.0]}])
def test_large_whole_numbers_are_compared_exactly(
    tmp_path: Path, beside: dict[str, list[float]]
) -> None:
    large = {"k": [2**60, 5], **beside}
    assert compared(tmp_path, large, large)["within"]
    report = compared(tmp_path, large, {**large, "k": [2**60 + 1, 5]})
    assert [text["differing"] for text in report["texts"] if text["name"] == "k"] == [1]
    report = compared(tmp_path, large, {**large, "k": [7, 5]})
    assert [text["differing"] for text in report["texts"] if text["name"] == "k"] == [1]
    assert report["only_a"] == report["only_b"] == []
    # As pandas has whole numbers with a gap.
    report = compared(tmp_path, large, {**large, "k": [7.0, np.nan]})
    assert [text["differing"] for text in report["texts"] if text["name"] == "k"] == [2]
    assert report["only_a"] == report["only_b"] == []


def test_tables_of_texts_without_a_common_row_have_nothing_in_common(tmp_path: Path) -> None:
    for a, b in (({"s": ["a", "b"]}, {"s": ["x", "y"]}), ({"k": [1, 2]}, {"k": [2**60, 2**61]})):
        ran = compare(tmp_path, a, {"id": ["u", "v"], **b})
        assert ran.returncode == 2 and b"no recording in common" in ran.stderr, ran
