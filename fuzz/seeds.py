"""Writes seeds for every fuzz target with the command itself: python fuzz/seeds.py CORSMAL_FEAT

They go to fuzz/corpus/TARGET, where cargo fuzz looks for them, or to FUZZ_CORPUS/TARGET. The
hostile files of CORSMAL_SHARED, if it exists, are added.
"""

from __future__ import annotations

import io
import json
import os
import pickle
import random
import shutil
import struct
import subprocess
import sys
import tempfile
import types
import wave
import zipfile
import zlib
from pathlib import Path

HERE = Path(__file__).resolve().parent
CORPUS = Path(os.environ.get("FUZZ_CORPUS", HERE / "corpus"))
SHARED = Path(os.environ.get("CORSMAL_SHARED", HERE.parent.parent / "shared"))
HOSTILE = SHARED / "cases" / "hostile"


def seed(target: str, name: str, content: bytes) -> None:
    """Writes one seed, unless it is too long: long seeds cost more than they find."""
    if len(content) <= 200_000:
        folder = CORPUS / target
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def pair(first: bytes, second: bytes) -> bytes:
    """Two files as one input."""
    return struct.pack("<I", len(first)) + first + second


def torch_archive() -> bytes:
    """A tensor as torch.save writes it, without PyTorch."""
    torch, utils = types.ModuleType("torch"), types.ModuleType("torch._utils")
    sys.modules.update({"torch": torch, "torch._utils": utils})

    class FloatStorage:
        pass

    def _rebuild_tensor_v2(*_: object) -> None:
        pass

    for thing, module in ((FloatStorage, torch), (_rebuild_tensor_v2, utils)):
        thing.__module__, thing.__qualname__ = module.__name__, thing.__name__
        setattr(module, thing.__name__, thing)

    class Numbers:
        pass

    class Tensor:
        def __reduce__(self) -> tuple[object, ...]:
            return _rebuild_tensor_v2, (Numbers(), 0, (2, 3), (3, 1), False, {})

    class Saver(pickle.Pickler):
        def persistent_id(self, thing: object) -> object:
            return ("storage", FloatStorage, "0", "cpu", 6) if isinstance(thing, Numbers) else None

    text = io.BytesIO()
    Saver(text, protocol=2).dump({"a.weight": Tensor()})
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("net/data.pkl", text.getvalue())
        file.writestr("net/data/0", struct.pack("<6f", *range(6)))
    return archive.getvalue()


def calibration() -> bytes:
    """A camera as Python 2 pickles it: a list of its intrinsic and its extrinsic part."""

    def array(*values: float) -> str:
        text = "".join(f"\\x{byte:02x}" for byte in struct.pack(f"<{len(values)}d", *values))
        return (
            f"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n(I3\n"
            f"I{len(values) // 3}\ntcnumpy\ndtype\n(S'f8'\nI0\nI1\ntR(I3\nS'<'\nNNNI-1\nI-1\nI0\nt"
            f"bI00\nS'{text}'\ntb"
        )

    matrix = array(920, 0, 640, 0, 920, 360, 0, 0, 1)
    turn, shift = array(0.1, 0.2, 0.3), array(0, 0, 1)
    outer = f"(dS'rgb'\n(dS'rvec'\n{turn}sS'tvec'\n{shift}ss"
    return f"(l(dS'rgb'\n{matrix}sa{outer}a.".encode()


def png() -> bytes:
    """A grey image of 8 by 4 pixels of 16 bits."""
    rows = b"".join(b"\0" + struct.pack(">8H", *range(8)) for _ in range(4))

    def chunk(kind: bytes, content: bytes) -> bytes:
        check = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", check)

    head = struct.pack(">IIBBBBB", 8, 4, 16, 0, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*one) for one in chunks)


TABLES = {
    "2020": "Container ID,Sequence,Filling type,Filling level,Container Capacity\n1,0,1,2,300\n",
    "2022": "Configuration ID,Container capacity,Container mass,Filling mass,None,Pasta,Rice,Water,"
    "Filling type,Empty,Half-full,Full,Filling level,Width at the top,Width at the bottom,Height,"
    "Object safety,Distance,Angle difference,Execution time\n"
    "0,300,10,50,-1,-1,-1,-1,1,-1,-1,-1,2,70,60,90,1,5,0,1\n",
    "annotations": "id,container id,scenario,background,illumination,width at the top,"
    "width at the bottom,height,depth,container capacity,container mass,filling type,filling level,"
    "filling density,filling mass,object mass,handover starting frame\n"
    "0,1,0,0,0,69.8,60,130,0,185,2,1,1,0.41,37,39,200\n",
    "capacities": "fileName,capacity[mL]\nid10_0000.png,300.5\n",
    "predictions": "Object,Sequence,p0,p1\n10,0002,1,0\n1,s0_fi1_fu1_b0_l0,0.5,0.5\n",
    "m3": json.dumps({"kind": "corsmal-feat capacity", "format": 1, "m3": {}}),
}


def networks(work: Path) -> None:
    """Weights in each format, and items of a network as an archive."""
    header = {"a.weight": {"dtype": "F32", "shape": [2, 3], "data_offsets": [0, 24]}}
    about = {**header, "__metadata__": {"corsmal-feat": json.dumps({"format": 1, "network": "m1"})}}
    for name, value in (("weights", header), ("model", about)):
        text = json.dumps(value).encode()
        content = struct.pack("<Q", len(text)) + text + struct.pack("<6f", *range(6))
        seed("nets", f"{name}.safetensors", content)
    seed("nets", "weights.pth", torch_archive())
    for path in sorted(work.glob("*.npz")):
        seed("nets", path.name, path.read_bytes())


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
        files = [(work / n).read_bytes() for n in ("frames.npz", "small.npz", "table.npz")]
        table = (work / "table.parquet").read_bytes()
        seed("parquet", "hashes.parquet", table)
        # As files of version 0.1.0, whose damage no hash hides from the readers.
        table = table.replace(b"corsmal.hash", b"corsmal.cash").replace(b"corsmal.b", b"corsmal.d")
        seed("parquet", "table.parquet", table)
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

        networks(work)

        # A strict run leaves the record of what it has done.
        (work / "audio/r9.wav").write_bytes(b"RIFF")
        strict = ["extract", "audio", "--preset", "logmel", *few, "--max-errors", "0"]
        run(*strict, "--jobs", "1", "--out", "strict.npz", code=2)
        ledger = (work / "strict.npz.ledger").read_bytes().splitlines()
        text = b"\n".join(line[33:] for line in ledger[1:])
        seed("ledger", "strict", pair(text, (work / "strict.npz.part").read_bytes()))

        seed("manifest", "csv", manifest.encode())
        seed("manifest", "jsonl", lines.encode())
        seed("manifest", "tar", (work / "list.tar").read_bytes())
    for path in (HERE.parent / "presets").glob("*.toml"):
        seed("configuration", path.name, path.read_bytes())
    for name, text in TABLES.items():
        seed("submissions", name, text.encode())
    seed("vision", "image.png", png())
    seed("vision", "calib.pickle", calibration())
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
    for path in SHARED.glob("data/lode/calib/*.pickle"):
        seed("vision", path.name, path.read_bytes())
    for folder in sorted(path for path in CORPUS.iterdir() if path.is_dir()):
        print(folder.name, len(list(folder.iterdir())))


if __name__ == "__main__":
    if shutil.which("tar") is None:
        raise SystemExit("tar is not installed")
    main()
