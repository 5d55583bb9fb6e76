"""Feature files of which a bit has flipped: refused in words, or the same as before."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import corsmal_feat as cf
import numpy as np
import pytest
import soundfile

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("audio")
    rng = np.random.default_rng(1)
    for name in ("a", "b"):
        soundfile.write(folder / f"{name}.wav", 0.1 * rng.standard_normal(4000), 8000)
    return folder


def content(path: Path) -> list[Any]:
    features = cf.load_features(path)
    read = [(i, features[i].tobytes()) for i in features.ids]
    times = [(i, features.times[i].tobytes()) for i in features.times]
    labels = {k: v.tolist() for k, v in features.labels.items()}
    return [read, times, labels, features.names, features.config, features.outcomes]


@pytest.mark.parametrize("ending", ["npz", "parquet"])
@pytest.mark.parametrize("preset", ["mfcc-zcr", "logmel"])
def test_no_flipped_bit_gives_other_values(
    folder: Path, tmp_path: Path, ending: str, preset: str
) -> None:
    out, damaged = tmp_path / f"out.{ending}", tmp_path / f"damaged.{ending}"
    cf.extract([folder], preset=preset, out=out)
    whole, bytes_ = content(out), out.read_bytes()
    refused = 0
    # Evenly over the file, and all bits in turn.
    bits = range(0, 8 * len(bytes_), 8 * len(bytes_) // 150 | 1)
    for bit in bits:
        changed = bytearray(bytes_)
        changed[bit // 8] ^= 1 << bit % 8
        damaged.write_bytes(changed)
        try:
            assert content(damaged) == whole
        except cf.CorsmalFeatError as error:
            assert damaged.name in str(error), error
            refused += 1
    assert refused > len(bits) // 2


def test_a_damaged_table_says_so(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    cf.extract([folder], preset="mfcc-zcr", out=out)
    changed = out.read_bytes().replace(b"mfcc[7].std", b"mfcc[8].std")
    out.write_bytes(changed)
    with pytest.raises(cf.ParameterError, match="do not match their hash"):
        cf.load_features(out)
    with pytest.raises(cf.CorsmalFeatError, match="do not match their hash"):
        cf.cross_validate(out, target="class")


def test_an_archive_without_its_ids_is_no_output(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    texts = {f"__{k}__": np.frombuffer(b"{}", np.uint8) for k in ("meta", "config", "outcomes")}
    np.savez(path, **texts)
    with pytest.raises(cf.ParameterError, match="it has no __ids__"):
        cf.load_features(path)


def test_damaged_frames_are_refused_when_they_are_read(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "frames.npz"
    cf.extract([folder], preset="logmel", out=out)
    with zipfile.ZipFile(out) as archive:
        at = archive.getinfo("b.npy").header_offset + 400
    content = bytearray(out.read_bytes())
    content[at] ^= 1
    out.write_bytes(content)
    features = cf.load_features(out)
    assert features["a"].size
    with pytest.raises(cf.ParameterError, match=r"frames\.npz: member b cannot be read"):
        features["b"]
