"""Feature files of which a bit has flipped: refused in words, or the same as before."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import corsmal_feat as cf
import numpy as np
import pytest
import soundfile

pytest.importorskip("pyarrow")


def content(path: Path) -> list[Any]:
    features = cf.load_features(path)
    read = [(i, features[i].tobytes()) for i in features.ids]
    times = [(i, features.times[i].tobytes()) for i in features.times]
    labels = {k: v.tolist() for k, v in features.labels.items()}
    return [read, times, labels, features.names, features.config, features.outcomes]


@pytest.mark.parametrize("ending", ["npz", "parquet"])
@pytest.mark.parametrize("preset", ["mfcc-zcr", "logmel"])
def test_no_flipped_bit_gives_other_values(tmp_path: Path, ending: str, preset: str) -> None:
    rng = np.random.default_rng(1)
    for name in ("a", "b"):
        soundfile.write(tmp_path / f"{name}.wav", 0.1 * rng.standard_normal(4000), 8000)
    out, damaged = tmp_path / f"out.{ending}", tmp_path / f"damaged.{ending}"
    cf.extract([tmp_path], preset=preset, out=out)
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


def test_a_damaged_table_says_so(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    soundfile.write(tmp_path / "a.wav", 0.1 * rng.standard_normal(4000), 8000)
    out = tmp_path / "out.parquet"
    cf.extract([tmp_path], preset="mfcc-zcr", out=out)
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
