"""Time of `corsmal_feat.ray` for many small recordings with one process and with two.

    python benches/cluster.py --count 10000 [--rows 500] [--preset esc26]

Needs Ray and the package. Wall time is that of the job, without the start of the cluster, which is
said apart; CPU time is that of all processes of the cluster (Linux), of which `idle` is what a
cluster spends that does nothing for as long. A busy machine shows in the wall time: its load is
said, too.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from scale import make

JOB = """
import os, sys, threading, time
begin = time.monotonic()
import ray
import corsmal_feat.ray
from cluster import spent

ray.init("local", num_cpus=int(sys.argv[1]), include_dashboard=False, log_to_driver=False,
         object_store_memory=100 << 20)
started = time.monotonic() - begin
before, begin, workers = spent(), time.monotonic(), [0]

# Ray ends workers without work: their memory is looked at while they have some.
def watch():
    while True:
        workers.append(spent()[1])
        time.sleep(1)

threading.Thread(target=watch, daemon=True).start()
found = corsmal_feat.ray.extract(
    sys.argv[2], sys.argv[3], preset=sys.argv[4], rows=int(sys.argv[5])
)
wall = time.monotonic() - begin
after = spent()
time.sleep(wall / 4)
idle = 4 * (spent()[0] - after[0])
assert found.statuses == {"ok": found.recordings}, found.statuses
print(found.recordings, started, wall, after[0] - before[0], idle, max(workers) >> 10)
"""


def spent() -> tuple[float, int]:
    """CPU seconds of all processes of this session, and the most memory of a worker in KiB."""
    ticks, session, worker = os.sysconf("SC_CLK_TCK"), os.getsid(0), 0
    total = 0.0
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) != session:
                continue
            # With children that have ended.
            total += sum(map(int, fields[11:15])) / ticks
            if "compute_part" in (entry / "cmdline").read_text():
                status = (entry / "status").read_text().split("VmHWM:")[1]
                worker = max(worker, int(status.split()[0]))
        except (OSError, ValueError, IndexError):
            continue  # It has ended.
    return total, worker


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--rows", type=int, default=500)
    parser.add_argument("--preset", default="esc26")
    given = parser.parse_args()
    # Ray starts workers at niceness 15: whatever else runs would take their time.
    environment = os.environ | {"RAY_USAGE_STATS_ENABLED": "0", "RAY_worker_niceness": "0"}
    paths = [str(Path(__file__).parent), environment.get("PYTHONPATH", "")]
    environment["PYTHONPATH"] = os.pathsep.join(path for path in paths if path)
    with tempfile.TemporaryDirectory() as temporary:
        root = Path(temporary)
        make(root / "lab", given.count)
        names = (
            "processes",
            "start s",
            "wall s",
            "CPU s",
            "of it idle",
            "ms each",
            "worker MiB",
            "load",
        )
        print(*(f"{name:>11}" for name in names))
        for source in ("audio", "shards/*.tar"):
            for processes in (1, 2):
                out = root / f"{processes}-{len(source)}"
                arguments = [str(processes), f"{root}/lab/{source}", str(out), given.preset]
                command = [sys.executable, "-c", JOB, *arguments, str(given.rows)]
                done = subprocess.run(
                    command, env=environment, stdout=subprocess.PIPE, text=True, check=True,
                    start_new_session=True,
                )  # fmt: skip
                count, start, wall, cpu, idle, worker = map(float, done.stdout.split()[-6:])
                row = (start, wall, cpu, idle, 1000 * cpu / count, worker, os.getloadavg()[0])
                print(f"{processes:>11}", *(f"{value:>11.1f}" for value in row), source, flush=True)
                time.sleep(1)


if __name__ == "__main__":
    main()
