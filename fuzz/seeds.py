"""Writes seeds for every target with the tool itself: python fuzz/seeds.py CORSMAL_FEAT

They go to fuzz/corpus/TARGET, where cargo fuzz looks for them. The hostile files of CORSMAL_SHARED,
if it is there, go along.
"""

from __future__ import annotations

import os
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import wave
from pathlib import Path

HERE = Path(__file__).resolve().parent
CORPUS = HERE / "corpus"
SHARED = Path(os.environ.get("CORSMAL_SHARED", HERE.parent.parent / "shared"))
HOSTILE = SHARED / "cases" / "hostile"


def seed(target: str, name: str, content: bytes) -> None:
    """One seed; what is long costs more than it finds."""
    if len(content) <= 200_000:
        folder = CORPUS / target
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def pair(first: bytes, second: bytes) -> bytes:
    """Two files as one input."""
    return struct.pack("<I", len(first)) + first + second


def main() -> None:
    feat = str(Path(sys.argv[1]).resolve())
    rng = random.Random(1)
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)

        def run(*arguments: str, code: int = 0) -> None:
            done = subprocess.run([feat, *arguments], cwd=work, capture_output=True, text=True)
            if done.returncode != code:
                raise SystemExit(f"{arguments}: {done.returncode}\n{done.stderr}")

        (work / "audio").mkdir()
        for i in range(8):
            with wave.open(str(work / f"audio/r{i}.wav"), "wb") as file:
                file.setnchannels(1 + i % 2)
                file.setsampwidth(2)
                file.setframerate(8000)
                file.writeframes(rng.randbytes(4 * (1 + i % 2) * 600))
        rows = "".join(f"audio/r{i}.wav,{i},{'ab'[i % 2]},0,0.1\n" for i in range(8))
        manifest = "path,id,y,start,end\n" + rows
        (work / "list.csv").write_text(manifest)
        lines = "".join(f'{{"path": "a.wav", "id": "{i}", "y": {i % 2}}}\n' for i in range(8))
        subprocess.run(["tar", "cf", "list.tar", "audio/r0.wav"], cwd=work, check=True)

        samples = HERE.parent / "crates/audio/tests/audio/samples"
        for path in [*samples.iterdir(), *(work / "audio").iterdir()]:
            if path.suffix != ".py":
                seed("audio", path.name, path.read_bytes())
        mean = ["--preset", "mfcc-zcr", "--set", "signal.channels=mean"]
        for name in ("table.npz", "table.parquet"):
            run("extract", "list.csv", *mean, "--out", name)
        few = ["--set", "melspectrogram.n_mels=8", "--set", "melspectrogram.n_fft=256"]
        run("extract", "list.csv", "--preset", "logmel", *few, "--out", "frames.npz")
        run("extract", "list.csv", "--preset", "logmel", *few, "--compress", "--out", "small.npz")
        for path in sorted(work.glob("*.npz")):
            seed("npz", path.name, path.read_bytes())
        seed("parquet", "table.parquet", (work / "table.parquet").read_bytes())
        files = [(work / n).read_bytes() for n in ("frames.npz", "small.npz", "table.npz")]
        table = (work / "table.parquet").read_bytes()
        for i, (a, b) in enumerate([(files[0], files[1]), (files[2], table), (table, table)]):
            seed("compare", str(i), pair(a, b))
        for kind in ("knn", "rf", "svm", "logistic", "tree"):
            model = ["--features", "table.npz", "--target", "y", "--classifier", kind]
            done = subprocess.run(
                [feat, "train", *model, "--out", f"{kind}.model"], cwd=work, capture_output=True
            )
            if done.returncode == 0:
                seed("model", kind, (work / f"{kind}.model").read_bytes()[:-32])
        classify = ["classify", "--features", "table.npz", "--model", "knn.model"]
        run(*classify, "--out", "predictions.csv")
        seed("predictions", "ours", (work / "predictions.csv").read_bytes())

        # A strict run leaves the record of what it has done.
        (work / "audio/r9.wav").write_bytes(b"RIFF")
        strict = ["extract", "audio", "--preset", "logmel", *few, "--max-errors", "0"]
        run(*strict, "--jobs", "1", "--out", "strict.npz", code=1)
        ledger = (work / "strict.npz.ledger").read_bytes().splitlines()
        text = b"\n".join(line[33:] for line in ledger[1:])
        seed("ledger", "strict", pair(text, (work / "strict.npz.part").read_bytes()))

        seed("manifest", "csv", manifest.encode())
        seed("manifest", "jsonl", lines.encode())
        seed("manifest", "tar", (work / "list.tar").read_bytes())
    for path in (HERE.parent / "presets").glob("*.toml"):
        seed("configuration", path.name, path.read_bytes())
    seed(
        "vision",
        "detections.csv",
        b"frame,view,label,score,x_min,y_min,x_max,y_max,mask\n0,1,cup,0.9,1,2,30,40,\n",
    )
    seed(
        "vision",
        "detections.json",
        b'[{"frame": 0, "view": 1, "label": 47, "score": 0.9, "box": [1, 2, 30, 40]}]',
    )
    if HOSTILE.is_dir():
        for path in HOSTILE.iterdir():
            kind = {".npz": "npz", ".parquet": "parquet", ".toml": "configuration"}.get(path.suffix)
            if kind:
                seed(kind, path.name, path.read_bytes())
    for folder in sorted(CORPUS.iterdir()):
        print(folder.name, len(list(folder.iterdir())))


if __name__ == "__main__":
    if shutil.which("tar") is None:
        raise SystemExit("tar is needed")
    main()
