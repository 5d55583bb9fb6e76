"""The source distribution holds all that its build reads."""

from __future__ import annotations

import re
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_files_that_the_sources_include_are_there(tmp_path: Path) -> None:
    pytest.importorskip("maturin")
    subprocess.run(
        [sys.executable, "-m", "maturin", "sdist", "--out", tmp_path],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
        archive.extractall(tmp_path, filter="data")
    root = next(path for path in tmp_path.iterdir() if path.is_dir())
    included = 0
    for source in root.rglob("src/**/*.rs"):
        text = source.read_text(encoding="utf-8")
        for name in re.findall(r'include_(?:str|bytes)!\("([^"]+)"\)', text):
            included += 1
            assert (source.parent / name).exists(), f"{source.relative_to(root)}: {name}"
    assert included > 5
    for preset in (ROOT / "presets").glob("*.toml"):
        assert (root / "presets" / preset.name).exists(), preset.name
    assert (root / "Cargo.lock").exists() and (root / "CITATION.cff").exists()
