"""Batches of Arrow: the same rows as a run, whatever is wrong with a recording."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import tarfile
import wave
from pathlib import Path

import corsmal_feat as cf
import numpy as np
import pytest

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

from corsmal_feat.arrow import extract_batch  # noqa: E402

RATE = 16000


def write(path: Path, seed: int, channels: int = 2, seconds: float = 0.3, rate: int = RATE) -> Path:
    rng = np.random.default_rng(seed)
    samples = (rng.normal(size=(int(seconds * rate), channels)) * 3000).astype("<i2")
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(samples.tobytes())
    return path


@pytest.fixture
def recordings(tmp_path: Path) -> list[Path]:
    """Good ones, and one of each kind of trouble."""
    folder = tmp_path / "audio"
    folder.mkdir()
    good = [write(folder / f"r{seed}.wav", seed) for seed in range(3)]
    cut = write(folder / "cut.wav", 5)
    cut.write_bytes(cut.read_bytes()[:9000])
    empty = write(folder / "empty.wav", 6, seconds=0.0)
    text = folder / "text.wav"
    text.write_text("no audio at all")
    mono = write(folder / "mono.wav", 7, channels=1)
    return [*good, cut, empty, text, mono]


def batch_of(paths: list[Path]) -> pa.RecordBatch:
    return pa.RecordBatch.from_pydict(
        {
            "id": [path.stem for path in paths],
            "path": [str(path) for path in paths],
            "type": [path.stem[0] for path in paths],
        }
    )


def assert_equal(found: pa.RecordBatch, run: cf.Features) -> None:
    """Row by row what the run has: outcomes, and the bits of features."""
    assert found["id"].to_pylist() == [row["id"] for row in run.outcomes]
    for row, outcome in zip(found.to_pylist(), run.outcomes, strict=True):
        for name, value in outcome.items():
            assert row[name] == value, (outcome["id"], name)
        if run.summary is not None:
            values = [row[name] for name in run.names]
            if outcome["id"] in run.ids:
                np.testing.assert_array_equal(np.float32(values), run[outcome["id"]])
            else:
                assert values == [None] * len(values)


def test_rows_equal_those_of_a_run(recordings: list[Path]):
    with pytest.warns(UserWarning, match="sets the width"):
        run = cf.extract(recordings, preset="mfcc-zcr")
    found = extract_batch(batch_of(recordings), preset="mfcc-zcr")
    assert isinstance(found, pa.RecordBatch)
    statuses = found["status"].to_pylist()
    assert statuses == ["ok"] * 3 + ["truncated", "empty", "not_audio", "mismatch"]
    assert found["type"].to_pylist() == [path.stem[0] for path in recordings]
    assert_equal(found, run)
    meta = json.loads(found.schema.metadata[b"corsmal.meta"])
    assert meta == {"tool_version": cf.__version__, "config_hash": run.config_hash}
    assert json.loads(found.schema.metadata[b"corsmal.config"]) == run.config


def test_rows_do_not_depend_on_the_batch(recordings: list[Path]):
    whole = extract_batch(batch_of(recordings), preset="mfcc-zcr", channels=2)
    single = [
        extract_batch(batch_of([path]), preset="mfcc-zcr", channels=2, jobs=2)
        for path in reversed(recordings)
    ]
    assert all(part.schema == whole.schema for part in single)
    assert [row for part in reversed(single) for row in part.to_pylist()][:6] == (
        whole.to_pylist()[:6]
    )
    assert single[0]["status"].to_pylist() == ["mismatch"]
    none = extract_batch(batch_of(recordings)[:0], preset="mfcc-zcr", channels=2)
    assert none.num_rows == 0 and none.schema == whole.schema
    # Nobody has said how many channels there are: those of this batch.
    mono = extract_batch(batch_of(recordings[-1:]), preset="mfcc-zcr")
    assert mono["status"].to_pylist() == ["ok"]


def test_content_uris_and_members_of_tars_give_the_same_values(
    tmp_path: Path, recordings: list[Path]
):
    good = recordings[:3]
    want = extract_batch(batch_of(good), preset="esc26")
    content = {"id": [p.stem for p in good], "bytes": [p.read_bytes() for p in good]}
    as_bytes = extract_batch(pa.RecordBatch.from_pydict(content), preset="esc26")
    assert as_bytes["path"].to_pylist() == [None] * 3
    uris = {"id": [p.stem for p in good], "path": [p.as_uri() for p in good]}
    as_uris = extract_batch(pa.RecordBatch.from_pydict(uris), preset="esc26")
    shard = tmp_path / "shard.tar"
    with tarfile.open(shard, "w") as tar:
        for path in good:
            tar.add(path, path.name)
    with tarfile.open(shard) as tar:
        members = tar.getmembers()
        place = {
            "id": [p.stem for p in good],
            "path": [f"{shard}/{m.name}" for m in members],
            "archive": [str(shard)] * 3,
            "offset": [m.offset_data for m in members],
            "size": [m.size for m in members],
        }
    as_members = extract_batch(pa.RecordBatch.from_pydict(place), preset="esc26")
    for found in (as_bytes, as_uris, as_members):
        assert found.drop_columns(["path"]) == want.drop_columns(["path", "type"])


def test_tables_stretches_and_labels_of_any_type(recordings: list[Path]):
    table = pa.table(
        {
            "path": [str(recordings[0])] * 2,
            "start": [None, 0.1],
            "end": [0.2, 0.25],
            "level": pa.array([1, 2], pa.int8()),
            "tags": [["a"], []],
        }
    )
    found = extract_batch(table, preset="esc26")
    assert isinstance(found, pa.Table)
    assert found["decoded_frames"].to_pylist() == [3200, 2400]
    assert found["id"].to_pylist() == [str(recordings[0])] * 2
    assert found.schema.field("level").type == pa.int8() and found["tags"].to_pylist() == [
        ["a"],
        [],
    ]


def test_lists_of_fixed_size(recordings: list[Path]):
    wide = extract_batch(batch_of(recordings), preset="mfcc-zcr", channels=2)
    lists = extract_batch(batch_of(recordings), preset="mfcc-zcr", channels=2, summary="list")
    names = json.loads(lists.schema.metadata[b"corsmal.names"])
    assert lists.schema.field("features").type == pa.list_(pa.float32(), len(names))
    assert wide.schema.names[-len(names) :] == names
    for row, values in zip(wide.to_pylist(), lists["features"].to_pylist(), strict=True):
        known = [row[name] for name in names]
        assert known == (values if values is not None else [None] * len(names))


def test_frames_are_nested_lists(recordings: list[Path]):
    config = {"features": {"mfcc": {"n_mfcc": 5}, "rms": {}}}
    run = cf.extract(recordings, config=config)
    found = extract_batch(batch_of(recordings), config=config)
    assert found.schema.field("mfcc").type == pa.list_(pa.list_(pa.list_(pa.float32())))
    for row in found.to_pylist():
        for feature in ("mfcc", "rms"):
            if row["id"] in run.ids:
                want = run[row["id"]][feature]
                np.testing.assert_array_equal(np.float32(row[feature]), want)
            else:
                assert row[feature] is None
    assert extract_batch(batch_of(recordings[4:5]), config=config).schema == found.schema
    # The same of a configuration with a summary, which is left out.
    summary = config | {"summary": {"stats": ["mean"]}}
    frames = extract_batch(batch_of(recordings), config=summary, frames="list")
    assert frames.equals(found) and frames.schema.equals(found.schema, check_metadata=True)
    with pytest.raises(cf.ParameterError, match="stft is complex"):
        extract_batch(batch_of(recordings), config={"features": {"stft": {"output": "complex"}}})


def test_parquet_keeps_all_of_it(tmp_path: Path, recordings: list[Path]):
    found = extract_batch(batch_of(recordings), preset="mfcc-zcr", channels=2)
    pq.write_table(pa.Table.from_batches([found]), tmp_path / "part.parquet")
    again = pq.read_table(tmp_path / "part.parquet")
    assert again.schema.metadata[b"corsmal.meta"] == found.schema.metadata[b"corsmal.meta"]
    assert again.to_pylist() == found.to_pylist()


def test_projections_and_models(tmp_path: Path, recordings: list[Path]):
    folder = recordings[0].parent
    more = [write(folder / f"m{seed}.wav", 20 + seed) for seed in range(8)]
    features = cf.extract(more, preset="esc26", out=tmp_path / "features.npz")
    cf.corsmal.fit_projection(tmp_path / "features.npz", tmp_path / "pca.npz", n_components=3)
    projected = extract_batch(batch_of(more), preset="esc26", projection=tmp_path / "pca.npz")
    run = cf.extract(more, preset="esc26", set={"projection.file": str(tmp_path / "pca.npz")})
    assert_equal(projected, run)

    features = cf.extract(more, preset="mfcc-zcr")
    labels = ["a", "b"] * 4
    forest = cf.RandomForest(random_state=1).fit(features.summary, labels)
    forest.save(str(tmp_path / "forest.model"), features=features)
    other = write(folder / "other.wav", 9, rate=8000)
    rows = [*more, other, folder / "none.wav"]
    found = extract_batch(batch_of(rows), model=tmp_path / "forest.model")
    assert found["predicted"].to_pylist() == [*forest.predict(features.summary), None, None]
    proba = np.stack(
        [
            found["p_a"].to_numpy(zero_copy_only=False)[:8],
            found["p_b"].to_numpy(zero_copy_only=False)[:8],
        ],
        axis=1,
    )
    np.testing.assert_array_equal(proba, forest.predict_proba(features.summary))
    assert found["status"].to_pylist()[8:] == ["mismatch", "io"]
    assert "8000 Hz" in found["reason"].to_pylist()[8]
    assert found["p_a"].null_count == 2
    with pytest.raises(cf.ModelError, match="another configuration"):
        extract_batch(batch_of(rows), preset="esc26", model=tmp_path / "forest.model")


def test_jobs_that_cannot_be(recordings: list[Path]):
    batch = batch_of(recordings)

    def refused(message: str, batch: pa.RecordBatch = batch, **options: object) -> None:
        with pytest.raises(cf.ParameterError, match=message):
            extract_batch(batch, **({"preset": "esc26"} | options))

    refused("did you mean", preset="esc62")
    refused("either preset or config", config={"features": {"rms": {}}})
    refused("jobs must be", jobs=0)
    refused("channels must be", channels=0)
    refused("summary must be", summary="rows")
    refused("frames must be", frames="rows")
    refused("leave out frames", frames="list", model="none.model", preset=None)
    refused("leave out frames", frames="list", projection="pca.npz")
    refused("needs a column path", batch.drop_columns(["path"]))
    refused("rename it", batch.append_column("status", batch["id"]))
    refused("must be called 'start'", batch.append_column("Start", batch["id"]))
    seconds = pa.array([None] * (batch.num_rows - 1) + [0.5])
    onset = batch.append_column("onset", seconds)
    last = batch.num_rows - 1
    refused(f"row {last}: .* from columns `start` and", onset.append_column("offset", seconds))
    refused(
        "if .length. is a label",
        batch.append_column("start", seconds).append_column("length", seconds),
    )
    refused("two columns with the same name", batch.append_column("id", batch["id"]))
    refused("must begin with one of s3://", pa.RecordBatch.from_pydict({"path": ["ftp://b/x.wav"]}))
    refused(
        "at least 0 seconds, not -1", pa.RecordBatch.from_pydict({"path": ["x"], "start": [-1.0]})
    )
    refused("the column start", pa.RecordBatch.from_pydict({"path": ["x"], "start": ["soon"]}))
    refused("none.model", model="none.model", preset=None)
    with pytest.raises(cf.ParameterError, match="RecordBatch or Table"):
        extract_batch({"path": ["x.wav"]}, preset="esc26")


def test_nulls_and_hostile_rows_are_rows():
    batch = pa.RecordBatch.from_pydict(
        {
            "path": [None, "", "/", "\0", "x" * 5000],
            "bytes": pa.array([None, b"", None, None, b"RIFF\xff\xff\xff\xffWAVE"], pa.binary()),
        }
    )
    found = extract_batch(batch, preset="esc26", channels=1)
    statuses = found["status"].to_pylist()
    assert statuses[0] == "io" and statuses[1] == "empty" and statuses[2:4] == ["io", "io"]
    assert statuses[4] in ("corrupt", "empty")
    assert all(found["reason"].to_pylist())
    huge = {"path": ["a.tar/x"], "archive": ["/dev/zero"], "offset": [2**63], "size": [2**64 - 1]}
    table = pa.table(
        {k: pa.array(v, pa.uint64()) if k in ("offset", "size") else v for k, v in huge.items()}
    )
    assert extract_batch(table, preset="esc26", channels=1)["status"].to_pylist() == ["io"]


def test_a_process_keeps_its_plans_and_can_be_forked(recordings: list[Path]):
    from corsmal_feat import _computation

    batch = batch_of(recordings[:1])
    first = extract_batch(batch, preset="esc26")
    kept = dict(_computation.computations)
    assert extract_batch(batch, preset="esc26") == first
    assert _computation.computations == kept
    for n_mels in range(20, 32):
        extract_batch(batch, preset="esc26", set={"mfcc.n_mels": n_mels})
    assert len(_computation.computations) <= _computation.KEPT
    code = (
        "import multiprocessing as m, pickle, sys\n"
        "from corsmal_feat.arrow import extract_batch\n"
        "batch = pickle.load(sys.stdin.buffer)\n"
        "here = extract_batch(batch, preset='esc26')\n"
        "def f(b): return extract_batch(b, preset='esc26', jobs=2)\n"
        "with m.get_context('fork').Pool(1) as pool: assert pool.map(f, [batch]) == [here]\n"
    )
    ran = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], input=pickle.dumps(batch), timeout=60
    )
    assert ran.returncode == 0
