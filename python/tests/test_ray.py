"""A local cluster of Ray whose workers and driver are killed: every recording has one row."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import tarfile
import time
import wave
from pathlib import Path

import corsmal_feat as cf
import numpy as np
import pytest

pytest.importorskip("ray", reason="Ray is not installed: the cluster is not tested")
pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

import corsmal_feat.ray  # noqa: E402
from corsmal_feat.arrow import extract_batch, join_pieces  # noqa: E402

RECORDINGS = 400
ROWS = 16

#: Runs in every process of the cluster: slows a recording down, writes down which process reads
#: which one when, and dies of the recording `poison`.
HOOK = """
import os, signal, sys, time

class Hook:
    def find_spec(self, name, path=None, target=None):
        if name == "corsmal_feat._parts":
            sys.meta_path.remove(self)
            from corsmal_feat import arrow
            arrow.extract_batch = slow(arrow.extract_batch)

def slow(real):
    def extract_batch(batch, **options):
        for name in batch["id"].to_pylist():
            with open(os.environ["SCALE_TEST_LOG"], "a") as log:
                log.write(f"{os.getpid()} {name}\\n")
            if name == "poison":
                os.kill(os.getpid(), signal.SIGKILL)
            time.sleep(0.02)
        return real(batch, **options)
    return extract_batch

sys.meta_path.insert(0, Hook())
"""


def write(path: Path, seed: int, channels: int = 2) -> Path:
    rng = np.random.default_rng(seed)
    samples = (rng.normal(size=(3200, channels)) * 3000).astype("<i2")
    with wave.open(str(path), "wb") as file:
        file.setnchannels(channels)
        file.setsampwidth(2)
        file.setframerate(16000)
        file.writeframes(samples.tobytes())
    return path


@pytest.fixture(scope="module")
def audio(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("audio")
    for seed in range(RECORDINGS - 3):
        write(folder / f"r{seed:03d}.wav", seed)
    write(folder / "poison.wav", 1000)
    write(folder / "mono.wav", 1001, channels=1)
    (folder / "text.wav").write_text("no audio at all")
    return folder


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    site = tmp_path / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(HOOK)
    package = Path(cf.__file__).parent.parent
    path = os.pathsep.join([str(site), str(package)])
    return os.environ | {
        "PYTHONPATH": path,
        "SCALE_TEST_LOG": str(tmp_path / "log"),
        "RAY_USAGE_STATS_ENABLED": "0",
        # Ray's workers are at 15: on a busy machine their imports alone take a minute.
        "RAY_worker_niceness": "0",
        "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
    }


DRIVER = """
import sys, ray
from ray.cluster_utils import Cluster
import corsmal_feat.ray
memory = 100 << 20
cluster = Cluster(initialize_head=True, head_node_args={
    "num_cpus": 1, "object_store_memory": memory, "include_dashboard": False})
cluster.add_node(num_cpus=1, object_store_memory=memory)
ray.init(address=cluster.address, log_to_driver=False)
sys.exit(corsmal_feat.ray._main(sys.argv[1:]))
"""


def drive(audio: Path, out: Path, environment: dict[str, str]) -> subprocess.Popen[bytes]:
    arguments = [str(audio), "--out", str(out), "--preset", "mfcc-zcr", "--rows", str(ROWS)]
    command = [sys.executable, "-W", "ignore", "-c", DRIVER, *arguments]
    with told_by(out).open("wb") as told:
        return subprocess.Popen(
            command, env=environment, stdout=told, stderr=told, start_new_session=True
        )


def told_by(out: Path) -> Path:
    return out.with_suffix(".told")


def lines(log: Path) -> list[str]:
    return log.read_text().splitlines() if log.exists() else []


def until(condition, seconds: float, process: subprocess.Popen[bytes], out: Path) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, told_by(out).read_text()[-2000:]
        assert time.monotonic() < end, "the cluster is too slow"
        time.sleep(0.05)


def end_session(process: subprocess.Popen[bytes]) -> None:
    """Ends what a driver that was killed has left running: its own session, nobody else's."""
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, session = (
                int(entry.parent.name),
                int(entry.read_text().rpartition(")")[2].split()[3]),
            )
        except (OSError, ValueError):
            continue
        if session == process.pid:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


@pytest.mark.skipif(not Path("/proc").exists(), reason="finds processes by /proc")
def test_workers_and_driver_are_killed_and_no_row_is_lost(
    audio: Path, tmp_path: Path, environment: dict[str, str]
):
    out, log = tmp_path / "out", tmp_path / "log"
    parts = out / "parts"
    first = drive(audio, out, environment)
    try:
        # Workers die while they have a batch open, three times.
        for _ in range(3):
            wanted = len(lines(log)) + 20
            until(lambda least=wanted: len(lines(log)) >= least, 60, first, out)
            os.kill(int(lines(log)[-1].split()[0]), signal.SIGKILL)
        # So does the driver, with batches open and some parts done.
        until(lambda: len(list(parts.glob("*.parquet"))) >= 6, 60, first, out)
        first.kill()
        first.wait(10)
    finally:
        end_session(first)
    done = {path.name: path.stat().st_mtime_ns for path in parts.glob("*.parquet")}
    assert 6 <= len(done) < RECORDINGS // ROWS
    read_before = len(lines(log))

    second = drive(audio, out, environment)
    try:
        second.wait(120)
    finally:
        end_session(second)
    assert second.returncode == 1, told_by(out).read_text()[-2000:]
    for name, time_ns in done.items():
        assert (parts / name).stat().st_mtime_ns == time_ns, "a finished part was made again"
    # Parts that were done were not read again: what was is all else, and the poison's batch: once
    # with the others of its batch, twice alone.
    assert len(lines(log)) - read_before <= RECORDINGS - ROWS * len(done) + 3 * ROWS
    assert [line.split()[1] for line in lines(log)].count("poison") == 3

    accounting = json.loads((out / "accounting.json").read_text())
    assert accounting == {
        "recordings": RECORDINGS,
        "statuses": {"mismatch": 1, "crashed": 1, "ok": RECORDINGS - 3, "not_audio": 1},
    }
    # Row by row what one process has, but for the one that kills it.
    found = pa.concat_tables([pq.read_table(path) for path in sorted(parts.glob("*.parquet"))])
    with pytest.warns(UserWarning, match="sets the width"):
        run = cf.extract(audio, preset="mfcc-zcr")
    assert found["id"].to_pylist() == [row["id"] for row in run.outcomes]
    values = np.stack([found[name].to_numpy() for name in run.names], axis=1)
    for row, outcome, features in zip(found.to_pylist(), run.outcomes, values, strict=True):
        if row["id"] == "poison":
            assert row["status"] == "crashed" and "ended 2 times" in row["reason"]
            assert np.isnan(features).all()
            continue
        if row["status"] == "mismatch":
            # Says what sets the width: there a recording, here a number.
            assert row["reason"].startswith("1 channel where the table has 2")
            outcome["reason"] = row["reason"]
        assert {key: row[key] for key in outcome} == outcome
        if outcome["status"] == "ok":
            np.testing.assert_array_equal(features, run[row["id"]])


@pytest.fixture(scope="module")
def cluster():
    import ray

    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_worker_niceness", "0")
    package = str(Path(cf.__file__).parent.parent)
    ray.init(
        "local",
        num_cpus=2,
        include_dashboard=False,
        object_store_memory=100 << 20,
        log_to_driver=False,
        runtime_env={"env_vars": {"PYTHONPATH": package}},
    )
    yield ray
    ray.shutdown()


def test_a_folder_is_one_job_and_stays_whole(audio: Path, tmp_path: Path, cluster):
    some = sorted(audio.glob("r00*.wav"))
    out = tmp_path / "out"
    heard: list[tuple[int, int]] = []
    found = cf.ray.extract(
        some, out, preset="esc26", rows=4, progress=lambda *now: heard.append(now)
    )
    assert (found.recordings, found.failed, found.done_before) == (10, 0, 0)
    assert heard == [(1, 3), (2, 3), (3, 3)] and len(found.parts) == 3
    again = cf.ray.extract(some, out, preset="esc26", rows=4)
    assert again.done_before == 3 and again.parts == found.parts
    with pytest.raises(cf.RunError, match="another job: config_hash"):
        cf.ray.extract(some, out, preset="mfcc-zcr", rows=4)
    with pytest.raises(cf.RunError, match="another job: manifest"):
        cf.ray.extract(some[1:], out, preset="esc26", rows=4)
    # A part that holds other rows is found, whoever has put it there.
    part = Path(found.parts[1])
    table = pq.read_table(part)
    pq.write_table(table.slice(1), part)
    with pytest.raises(cf.RunError, match="does not hold the recordings"):
        cf.ray.extract(some, out, preset="esc26", rows=4)
    part.write_bytes(b"cut")
    with pytest.raises(cf.RunError, match="remove it and run again"):
        cf.ray.extract(some, out, preset="esc26", rows=4)
    part.unlink()
    mended = cf.ray.extract(some, out, preset="esc26", rows=4)
    assert mended.done_before == 2 and pq.read_table(part) == table
    with pytest.raises(cf.ParameterError, match="more than once"):
        cf.ray.extract(pa.table({"path": ["a.wav", "a.wav"]}), tmp_path / "twice", preset="esc26")
    with pytest.raises(cf.ParameterError, match="did you mean"):
        cf.ray.extract(some, tmp_path / "none", preset="esc62")


def test_tar_shards_are_read_by_workers(audio: Path, tmp_path: Path, cluster):
    some = sorted(audio.glob("r00*.wav"))[:4]
    for shard in range(2):
        with tarfile.open(tmp_path / f"{shard}.tar", "w") as tar:
            for path in some[2 * shard : 2 * shard + 2]:
                tar.add(path, path.name)
    found = cf.ray.extract(str(tmp_path / "{0..1}.tar"), tmp_path / "out", preset="esc26", rows=2)
    parts = pa.concat_tables([pq.read_table(path) for path in found.parts])
    assert parts["id"].to_pylist() == ["0/r000", "0/r001", "1/r002", "1/r003"]
    run = cf.extract(some, preset="esc26")
    values = np.stack([parts[name].to_numpy() for name in run.names], axis=1)
    np.testing.assert_array_equal(values, run.summary)


def test_pieces_of_recordings_come_from_several_tasks(audio: Path, tmp_path: Path, cluster):
    some = sorted(audio.glob("r00*.wav"))[:3]
    config = "[features.melspectrogram]\nn_fft = 512\nhop_length = 160\n[features.rms]"
    out = tmp_path / "out"
    found = cf.ray.extract(some, out, config=config, longest=0.1, rows=1)
    assert found.recordings == len(found.parts) == 6
    parts = pa.concat_tables([pq.read_table(path) for path in found.parts])
    whole = extract_batch(cf.ray.manifest(some), config=config)
    assert join_pieces(parts).to_pylist() == whole.to_pylist()
    assert cf.ray.extract(some, out, config=config, longest=0.1, rows=1).done_before == 6
    with pytest.raises(cf.RunError, match="another job: manifest"):
        cf.ray.extract(some, out, config=config, rows=1)


# Of Ray itself.
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
def test_ray_data_takes_the_function_as_it_is(audio: Path, cluster):
    data = pytest.importorskip("ray.data")
    some = [str(path) for path in sorted(audio.glob("r00*.wav"))]
    table = pa.table({"id": [Path(path).stem for path in some], "path": some})
    found = data.from_arrow(table).map_batches(
        extract_batch,
        batch_format="pyarrow",
        batch_size=4,
        fn_kwargs={"preset": "esc26", "channels": 2},
    )
    rows = {row["id"]: row for row in found.take_all()}
    want = extract_batch(table, preset="esc26", channels=2).to_pylist()
    assert [rows[row["id"]] for row in want] == want
