"""Runs librosa's own tests with corsmal_feat in its place and holds the result against `left.txt`.

    python python/tests/librosa_suite/run.py FOLDER [TEST_FILE ...]

FOLDER is where the source distribution of librosa 0.11.0 lies, or is put (`pip download`). Without
TEST_FILEs the fixed list of CI runs. A test that passes without a call of ours does not count. A
test that fails must stand in `left.txt`, and one that stands there and passes must go from it.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import soundfile

HERE = Path(__file__).resolve().parent
#: What runs in CI.
FIXED = (
    "test_convert.py",
    "test_effects.py",
    "test_filters.py",
    "test_failures.py",
    "test_decompose.py",
    "test_onset.py",
    "test_features.py",
)
#: Fewest functions of librosa that are replaced: the list may only grow.
FEWEST = 88


def source(folder: Path) -> Path:
    """The unpacked source distribution."""
    unpacked = folder / "librosa-0.11.0"
    if not unpacked.exists():
        folder.mkdir(parents=True, exist_ok=True)
        download = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps"]
        subprocess.run(
            [*download, "--no-binary", ":all:", "librosa==0.11.0", "-d", str(folder)], check=True
        )
        with tarfile.open(folder / "librosa-0.11.0.tar.gz") as archive:
            archive.extractall(folder, filter="data")
    stand_ins(unpacked / "tests" / "data")
    return unpacked


def stand_ins(folder: Path) -> None:
    """Recordings under the names of librosa's, which the source distribution does not hold: five
    seconds of plucked notes, two channels."""
    folder.mkdir(exist_ok=True)
    for name, rate in (("test1_22050", 22050), ("test1_44100", 44100), ("test2_8000", 8000)):
        path = folder / f"{name}.wav"
        if path.exists():
            continue
        rng = np.random.default_rng(rate)
        samples = 0.001 * rng.standard_normal((2, 5 * rate))
        for beat in range(20):
            t = np.arange(5 * rate - beat * rate // 4) / rate
            hz = 220 * 2 ** (rng.integers(0, 24) / 12)
            note = sum(np.sin(2 * np.pi * k * hz * t) / k for k in (1, 2, 3)) * np.exp(-6 * t)
            samples[:, -len(t) :] += 0.2 * note * rng.uniform(0.3, 1, (2, 1))
        soundfile.write(path, np.clip(samples.T, -1, 1), rate)


def main() -> int:
    folder, files = Path(sys.argv[1]).resolve(), sys.argv[2:] or FIXED
    sys.path.insert(0, str(HERE))
    import replaced

    if len(replaced.replaced) < FEWEST:
        print(f"only {len(replaced.replaced)} functions are replaced, {FEWEST} were")
        return 1
    os.chdir(source(folder))
    options = ["-q", "-o", "addopts=", "-p", "no:cacheprovider", "--tb=no", "--disable-warnings"]
    pytest.main([*options, *(f"tests/{name}" for name in files)], plugins=[replaced])
    left = set((HERE / "left.txt").read_text(encoding="utf-8").split("\n")) - {""}
    # An error of the set-up is a file that the source distribution does not hold.
    failed = set(replaced.failed)
    counts = Counter(
        "counted" if test in replaced.counted else "without a call of ours"
        for test in replaced.passed
    )
    print(f"\n{len(replaced.replaced)} functions replaced; passed: {dict(counts)}")
    ran = replaced.failed | replaced.passed
    new, mended = failed - left, (left & ran) - failed
    for test in sorted(new):
        print(f"fails: {test}")
    for test in sorted(mended):
        print(f"passes, but stands in left.txt: {test}")
    return int(bool(new or mended or not counts["counted"]))


if __name__ == "__main__":
    raise SystemExit(main())
