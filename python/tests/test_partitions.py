"""Partitioned outputs: for pyarrow, pandas and this package."""

from __future__ import annotations

import json
from pathlib import Path

import corsmal_feat as cf
import numpy as np
import pytest
from test_arrow import write

pa = pytest.importorskip("pyarrow")
dataset = pytest.importorskip("pyarrow.dataset")
pq = pytest.importorskip("pyarrow.parquet")


@pytest.fixture(scope="module")
def listed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("audio")
    rows = ["path,type,take"]
    for i, kind in enumerate(["rice", "water/ü", "", "rice", "7", "water/ü", "rice"]):
        write(folder / f"r{i}.wav", i)
        rows.append(f"r{i}.wav,{kind},{i}")
    (folder / "r3.wav").write_text("no audio")
    (folder / "list.csv").write_text("\n".join(rows) + "\n")
    return folder / "list.csv"


@pytest.mark.parametrize("preset", ["mfcc-zcr", "logmel"])
def test_a_partitioned_output_is_the_whole_one_in_parts(listed: Path, tmp_path: Path, preset: str):
    whole = cf.extract(listed, preset=preset, out=tmp_path / "whole.parquet")
    out = tmp_path / "parts"
    made = cf.extract(listed, preset=preset, out=out, partition_by="type")
    for found in (made, cf.load_features(out)):
        assert found.ids == whole.ids and found.outcomes == whole.outcomes
        assert found.names == whole.names and found.config == whole.config
        assert list(found.labels) == ["type", "take"]
        for label in found.labels:
            assert found.labels[label].tolist() == whole.labels[label].tolist()
        if whole.summary is not None:
            np.testing.assert_array_equal(found.summary, whole.summary)
        assert list(found.arrays) == list(whole.arrays)
        for key in whole.arrays:
            np.testing.assert_array_equal(found[key], whole[key])
            np.testing.assert_array_equal(found.times[key], whole.times[key])
    # As others read it.
    table = dataset.dataset(out, format="parquet", partitioning="hive").to_table()
    assert sorted(table["id"].to_pylist()) == sorted(whole.ids)
    kinds = dict(zip(table["id"].to_pylist(), table["type"].to_pylist(), strict=True))
    assert kinds == {
        "r0": "rice",
        "r1": "water/ü",
        "r2": None,
        "r4": "7",
        "r5": "water/ü",
        "r6": "rice",
    }
    names = {path.name for path in out.iterdir()}
    assert names == {
        "type=rice",
        "type=water%2F%C3%BC",
        "type=7",
        "type=__HIVE_DEFAULT_PARTITION__",
    }
    one = cf.load_features(out / "type=rice" / "part.parquet")
    assert one.ids == ["r0", "r6"] and [row["status"] for row in one.outcomes] == [
        "ok",
        "not_audio",
        "ok",
    ]


def test_folders_that_are_none_are_refused(listed: Path, tmp_path: Path):
    out = tmp_path / "parts"
    cf.extract(
        listed, preset="esc26", set={"signal.channels": "mean"}, out=out, partition_by="type"
    )
    with pytest.raises(cf.ParameterError, match="without parts"):
        cf.load_features(tmp_path)
    (out / "type=7" / "part.parquet").unlink()
    with pytest.raises(cf.ParameterError, match="a part of the output is missing"):
        cf.load_features(out)
    (out / "type=7").rmdir()
    (out / "type=rice").rename(out / "type=7")
    with pytest.raises(cf.ParameterError, match="holds the part type=rice"):
        cf.load_features(out)
    (out / "type=7").rename(out / "type=rice")
    (out / "notes.txt").write_text("mine")
    with pytest.raises(cf.RunError, match="not a partitioned output"):
        cf.extract(listed, preset="esc26", out=out, partition_by="type", overwrite=True)
    with pytest.raises(cf.RunError, match="labels of the inputs are type, take"):
        cf.extract(listed, preset="esc26", out=tmp_path / "x", partition_by="kind")
    with pytest.raises(cf.ParameterError, match="need out"):
        cf.extract(listed, partition_by="type")


@pytest.mark.parametrize(
    "wrong",
    [
        [],
        [1],
        {"label": 7},
        {"inputs": -1},
        {"inputs": "7"},
        {"column": None},
        {"places": [0, True]},
    ],
)
def test_metadata_of_other_kinds_are_refused(
    listed: Path, tmp_path: Path, wrong: list[int] | dict[str, object]
):
    out = tmp_path / "parts"
    cf.extract(listed, preset="mfcc-zcr", out=out, partition_by="type")
    part = out / "type=rice" / "part.parquet"
    table = pq.ParquetFile(part).read()
    metadata = dict(table.schema.metadata)
    meta = json.loads(metadata[b"corsmal.meta"])
    meta["part"] = meta["part"] | wrong if isinstance(wrong, dict) else wrong
    metadata[b"corsmal.meta"] = json.dumps(meta).encode()
    pq.write_table(table.replace_schema_metadata(metadata), part)
    with pytest.raises(cf.ParameterError, match="is not a part of an output"):
        cf.load_features(out)


def test_the_number_of_inputs_takes_no_memory(listed: Path, tmp_path: Path):
    out = tmp_path / "parts"
    cf.extract(listed, preset="mfcc-zcr", out=out, partition_by="type")
    for part in out.glob("*/part.parquet"):
        table = pq.ParquetFile(part).read()
        metadata = dict(table.schema.metadata)
        meta = json.loads(metadata[b"corsmal.meta"])
        meta["part"]["inputs"] = 2**62
        metadata[b"corsmal.meta"] = json.dumps(meta).encode()
        pq.write_table(table.replace_schema_metadata(metadata), part)
    with pytest.raises(cf.ParameterError, match="a part of the output is missing"):
        cf.load_features(out)


def test_the_last_part_is_missed_too(listed: Path, tmp_path: Path):
    rows = listed.read_text().splitlines()
    ordered = listed.with_name("ordered.csv")
    ordered.write_text("\n".join([rows[0], *sorted(rows[1:], key=lambda row: row.split(",")[1])]))
    out = tmp_path / "parts"
    cf.extract(ordered, preset="mfcc-zcr", out=out, partition_by="type")
    last = max(out.iterdir())
    (last / "part.parquet").unlink()
    last.rmdir()
    with pytest.raises(cf.ParameterError, match="a part of the output is missing"):
        cf.load_features(out)
