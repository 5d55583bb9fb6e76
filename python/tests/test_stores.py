"""Recordings in a bucket, from Python: moto's server stands for S3."""

from __future__ import annotations

import importlib.util
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
