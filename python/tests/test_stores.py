"""Recordings in a bucket, from Python: moto's server stands for S3."""

from __future__ import annotations

import importlib.util
import multiprocessing
import os
import socket
import subprocess
import sys
import time
import urllib.parse
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import corsmal_feat as cf
import numpy as np
import pytest
from test_arrow import batch_of, write

pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")

from corsmal_feat._batches import failed_batch  # noqa: E402
from corsmal_feat.arrow import extract_batch  # noqa: E402
from corsmal_feat.ray import manifest  # noqa: E402

PLACES = ("path", "identity")


class Bucket:
    """A bucket, and a folder with the same recordings."""

    def __init__(self, folder: Path, endpoint: str) -> None:
        self.folder, self.endpoint = folder, endpoint
        self.put("lab", b"")
        for name, seed in [("a.wav", 1), ("deep/b c.wav", 2), ("deep/ü.wav", 3)]:
            path = folder / name
            path.parent.mkdir(exist_ok=True)
            self.put(f"lab/audio/{name}", write(path, seed).read_bytes())

    def put(self, key: str, content: bytes) -> None:
        url = f"{self.endpoint}/{urllib.parse.quote(key)}"
        headers = {
            "Authorization": "AWS4-HMAC-SHA256 Credential=test/20261127/us-east-1/s3/x",
            "Content-Type": "application/octet-stream",
        }
        request = urllib.request.Request(url, content, headers, method="PUT")
        with urllib.request.urlopen(request) as answer:
            assert answer.status == 200


@pytest.fixture(scope="module")
def bucket(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bucket]:
    if importlib.util.find_spec("moto") is None:
        pytest.skip("moto is not installed (pip install 'moto[server]'): no bucket to read")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    endpoint = f"http://127.0.0.1:{port}"
    variables = {
        "AWS_ENDPOINT_URL": endpoint,
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test-secret",
        "AWS_REGION": "us-east-1",
        "no_proxy": "127.0.0.1",
    }
    quiet = subprocess.DEVNULL
    with (
        pytest.MonkeyPatch.context() as patch,
        subprocess.Popen(command, stdout=quiet, stderr=quiet) as server,
    ):
        try:
            for name, value in variables.items():
                patch.setenv(name, value)
            wait_for(port)
            yield Bucket(tmp_path_factory.mktemp("audio"), endpoint)
        finally:
            server.kill()


def wait_for(port: int) -> None:
    for _ in range(600):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.1)
    pytest.fail("moto's server does not start")


def test_a_bucket_gives_the_numbers_of_a_folder(bucket: Bucket):
    local = cf.extract([bucket.folder], preset="mfcc-zcr")
    stored = cf.extract(["s3://lab/audio/"], preset="mfcc-zcr")
    assert stored.ids == local.ids == ["a", "deep/b c", "deep/ü"]
    assert stored.summary is not None and local.summary is not None
    np.testing.assert_array_equal(stored.summary, local.summary)
    for ours, theirs in zip(stored.outcomes, local.outcomes, strict=True):
        assert {**ours, **dict.fromkeys(PLACES)} == {**theirs, **dict.fromkeys(PLACES)}
    assert stored.outcomes[0]["path"] == "s3://lab/audio/a.wav"


def test_rows_of_batches_may_be_objects(bucket: Bucket):
    paths = [bucket.folder / "a.wav", bucket.folder / "deep/b c.wav", bucket.folder / "none.wav"]
    local = batch_of(paths)
    uris = [f"s3://lab/audio/{path.relative_to(bucket.folder)}" for path in paths]
    stored = local.set_column(local.schema.get_field_index("path"), "path", pa.array(uris))
    expected = extract_batch(local, preset="mfcc-zcr", channels=2)
    found = extract_batch(stored, preset="mfcc-zcr", channels=2)
    assert found["status"].to_pylist() == ["ok", "ok", "io"]
    assert found["path"].to_pylist() == uris
    assert "no such object" in found["reason"].to_pylist()[2]
    for name in set(expected.schema.names) - {*PLACES, "reason"}:
        assert found[name].equals(expected[name]), name


def test_a_manifest_for_a_cluster_names_objects(bucket: Bucket):
    table = manifest("s3://lab/audio/deep")
    assert table["id"].to_pylist() == ["b c", "ü"]
    assert table["path"].to_pylist() == ["s3://lab/audio/deep/b c.wav", "s3://lab/audio/deep/ü.wav"]


def test_what_no_store_has_is_refused(bucket: Bucket):
    del bucket
    for uri in ("hdfs://n/a.wav", "ftp://n/a.wav", "s3://lab//a.wav"):
        batch = pa.RecordBatch.from_pydict({"path": [uri]})
        with pytest.raises(cf.ParameterError) as caught:
            extract_batch(batch, preset="esc26")
        assert uri in str(caught.value)
    with pytest.raises(cf.RunError, match="no such file"):
        cf.extract(["s3://lab/audio/none.wav"], preset="esc26")


def test_a_process_without_credentials_is_a_fault_of_the_job(bucket: Bucket):
    # In a process of its own, as a worker would be: this one has asked the store already.
    code = """
import pyarrow as pa
from corsmal_feat.arrow import extract_batch
extract_batch(pa.table({"path": ["s3://lab/audio/a.wav"] * 50}), preset="mfcc-zcr", channels=2)
"""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("AWS_")}
    # Where a machine asks for credentials: nobody is there.
    environment["AWS_METADATA_ENDPOINT"] = "http://127.0.0.1:9"
    environment["AWS_ENDPOINT_URL"] = bucket.endpoint
    environment["PYTHONPATH"] = str(Path(cf.__file__).parent.parent)
    command = [sys.executable, "-c", code]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode != 0 and "RunError" in done.stderr, done.stderr
    assert "s3://lab/audio/a.wav: no credentials found" in done.stderr, done.stderr


def test_signed_addresses_are_read_and_their_signatures_stand_nowhere(
    bucket: Bucket, tmp_path: Path
):
    address = f"{bucket.endpoint}/lab/audio/a.wav"
    signed = f"{address}?X-Amz-Signature=the-secret"
    (tmp_path / "list.csv").write_text(f"path,type\n{signed},rice\n")
    table = manifest(tmp_path / "list.csv")
    assert table["path"].to_pylist() == [signed], "a worker needs it"
    found = extract_batch(table, preset="mfcc-zcr", channels=2)
    assert found["status"].to_pylist() == ["ok"], found["reason"].to_pylist()
    assert found["path"].to_pylist() == [address]
    assert "the-secret" not in str(found.to_pydict()) + str(found.schema.metadata)
    # Without an id, a row is called by its path.
    unnamed = extract_batch(pa.table({"path": [signed]}), preset="mfcc-zcr", channels=2)
    assert unnamed["id"].to_pylist() == [address]
    options = {"config": {"features": {"rms": {}}}, "model": None, "channels": None}
    failed = failed_batch(table, "crashed", "x", summary="columns", **options)
    assert failed["path"].to_pylist() == [address]


def test_outputs_go_to_a_bucket_and_come_back(bucket: Bucket, tmp_path: Path):
    work = tmp_path / "work"
    work.mkdir()
    for name, preset in [("x.npz", "logmel"), ("x.parquet", "mfcc-zcr")]:
        local = cf.extract([bucket.folder], preset=preset, out=tmp_path / name)
        uri = f"s3://lab/out/{name}"
        sent = cf.extract([bucket.folder], preset=preset, out=uri, work=work)
        assert list(work.iterdir()) == []
        for found in (sent, cf.load_features(uri)):
            assert found.ids == local.ids and found.outcomes == local.outcomes
            if local.summary is not None:
                np.testing.assert_array_equal(found.summary, local.summary)
            for key in local.arrays:
                np.testing.assert_array_equal(found[key], local[key])
    with pytest.raises(cf.RunError, match="another configuration"):
        cf.extract([bucket.folder], preset="esc26", out="s3://lab/out/x.parquet", work=work)
    with pytest.raises(cf.ParameterError, match="need out"):
        cf.extract([bucket.folder], work=work)
    with pytest.raises(cf.RunError, match="no such object"):
        cf.load_features("s3://lab/out/none.npz")


#: A cluster of two nodes that reads objects: the driver of `test_ray`, but what it extracts.
CLUSTER = """
import os, sys, ray
from ray.cluster_utils import Cluster
import corsmal_feat.ray
memory = 100 << 20
cluster = Cluster(initialize_head=True, head_node_args={
    "num_cpus": 1, "object_store_memory": memory, "include_dashboard": False})
cluster.add_node(num_cpus=1, object_store_memory=memory)
ray.init(address=cluster.address, log_to_driver=False)
found = corsmal_feat.ray.extract(sys.argv[1], sys.argv[2], preset="mfcc-zcr", rows=8)
print(found.recordings, found.statuses)
"""


def test_a_cluster_reads_a_bucket(bucket: Bucket, tmp_path: Path):
    pytest.importorskip("ray")
    for seed in range(24):
        path = write(tmp_path / f"r{seed:02d}.wav", seed)
        bucket.put(f"lab/many/{path.name}", path.read_bytes())
    package = str(Path(cf.__file__).parent.parent)
    environment = os.environ | {
        "RAY_USAGE_STATS_ENABLED": "0",
        "RAY_worker_niceness": "0",
        "PYTHONPATH": package,
    }
    out = tmp_path / "out"
    command = [sys.executable, "-W", "ignore", "-c", CLUSTER, "s3://lab/many/", str(out)]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=240, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert "24 {'ok': 24}" in done.stdout
    parts = [parquet.read_table(path) for path in sorted((out / "parts").glob("*.parquet"))]
    rows = pa.concat_tables(parts)
    local = cf.extract([tmp_path / f"r{seed:02d}.wav" for seed in range(24)], preset="mfcc-zcr")
    assert rows["id"].to_pylist() == local.ids
    for i, name in enumerate(local.names):
        np.testing.assert_array_equal(rows[name].to_numpy(), local.summary[:, i])


def statuses(uris: list[str]) -> list[str]:
    batch = pa.RecordBatch.from_pydict({"path": uris})
    found: list[str] = extract_batch(batch, preset="mfcc-zcr", channels=2)["status"].to_pylist()
    return found


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_fork_of_a_process_that_has_read_objects_reads_on(bucket: Bucket):
    uris = ["s3://lab/audio/a.wav", f"{bucket.endpoint}/lab/audio/a.wav?X-Amz-Signature=x"] * 2
    assert statuses(uris) == ["ok"] * 4
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(statuses, [uris] * 4).get(timeout=120) == [["ok"] * 4] * 4
    assert statuses(uris) == ["ok"] * 4
