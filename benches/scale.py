"""CPU time of `extract` on many small recordings: folder, tar shards, bucket, shards in a bucket.

    python benches/scale.py --count 10000 [--store versitygw|moto] [--jobs 2]

Needs the command (CORSMAL_FEAT, or target/release/corsmal-feat) built with `--features cloud`, and
an S3 server: versitygw on the path, or moto (`pip install 'moto[server]'`). Measures user and
system time of the command by getrusage, without that of the server.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import shutil
import socket
import struct
import subprocess
import sys
import tarfile
import tempfile
import time
from pathlib import Path

RATE, SECONDS = 16_000, 0.2
KEY, SECRET = "benchmark", "benchmark-secret"


def wav(seed: int) -> bytes:
    """A recording of 6.4 KB, different for each seed."""
    data = random.Random(seed).randbytes(int(2 * RATE * SECONDS))
    head = struct.pack("<4sI4s4sIHHIIHH4sI", b"RIFF", 36 + len(data), b"WAVE", b"fmt ", 16, 1, 1,
                       RATE, 2 * RATE, 2, 16, b"data", len(data))  # fmt: skip
    return head + data


def make(folder: Path, count: int) -> None:
    """`count` recordings in folders of 1,000 and in shards of 10,000."""
    (folder / "shards").mkdir(parents=True)
    for first in range(0, count, 10_000):
        with tarfile.open(folder / "shards" / f"{first // 10_000:03d}.tar", "w") as tar:
            for i in range(first, min(count, first + 10_000)):
                place = folder / "audio" / f"{i // 1000:03d}" / f"r{i:06d}.wav"
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(wav(i))
                tar.add(place, place.name)


def serve(kind: str, root: Path) -> tuple[subprocess.Popen[bytes], str]:
    """An S3 server and its address. Folders in `root` are versitygw's buckets."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    if kind == "versitygw":
        access = ["--access", KEY, "--secret", SECRET, "--port", f"127.0.0.1:{port}"]
        command = [shutil.which("versitygw") or kind, *access, "posix", str(root)]
    else:
        command = [sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    server = subprocess.Popen(command, **quiet)  # type: ignore[call-overload]
    for _ in range(300):
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return server, f"http://127.0.0.1:{port}"
        time.sleep(0.1)
    server.kill()
    raise SystemExit(f"{kind} did not start")


def measured(tool: str, source: str, out: Path, more: list[str]) -> tuple[float, float, int]:
    """CPU seconds, wall seconds and peak memory in MiB of one run."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run(
        [tool, "extract", "--in", source, "--out", out, "-q", "--overwrite", *more], check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return cpu, time.monotonic() - begin, after.ru_maxrss // 1024


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--store", choices=("versitygw", "moto"), default="versitygw")
    parser.add_argument("--jobs", default="2")
    parser.add_argument("--preset", default="esc26")
    given = parser.parse_args()
    tool = os.environ.get("CORSMAL_FEAT", "target/release/corsmal-feat")
    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary)
        bucket = root / "store" / "lab"
        make(bucket, given.count)
        server, endpoint = serve(given.store, root / "store")
        os.environ |= {
            "AWS_ENDPOINT_URL": endpoint,
            "AWS_ACCESS_KEY_ID": KEY,
            "AWS_SECRET_ACCESS_KEY": SECRET,
            "AWS_REGION": "us-east-1",
            "no_proxy": "127.0.0.1",
        }
        try:
            if given.store == "moto":
                fill(endpoint, bucket)
            print(f"{'from':<18}{'CPU s':>8}{'ms each':>9}{'wall s':>8}{'MiB':>6}")
            for name, source in (
                ("folder", f"{bucket}/audio"),
                ("tar shards", f"{bucket}/shards/*.tar"),
                ("objects", "s3://lab/audio/"),
                ("shards in bucket", "s3://lab/shards/*.tar"),
            ):
                more = ["--preset", given.preset, "--jobs", given.jobs]
                cpu, wall, memory = measured(tool, source, root / "out.npz", more)
                each = 1000 * cpu / given.count
                print(f"{name:<18}{cpu:>8.1f}{each:>9.2f}{wall:>8.1f}{memory:>6}", flush=True)
        finally:
            server.kill()
            server.wait()


def fill(endpoint: str, bucket: Path) -> None:
    """Uploads the files of a folder to a bucket with its name."""
    import urllib.request

    headers = {
        "Authorization": f"AWS4-HMAC-SHA256 Credential={KEY}/20261127/us-east-1/s3/x",
        "Content-Type": "application/octet-stream",
    }
    for path in [bucket, *sorted(p for p in bucket.rglob("*") if p.is_file())]:
        content = path.read_bytes() if path.is_file() else b""
        url = f"{endpoint}/{path.relative_to(bucket.parent)}"
        urllib.request.urlopen(urllib.request.Request(url, content, headers, method="PUT")).close()


if __name__ == "__main__":
    main()
