"""Runs the fuzz targets one after another and logs the results: python fuzz/run.py --seconds 300

Build them first: RUSTC_BOOTSTRAP=1 cargo fuzz build --fuzz-dir fuzz --sanitizer none. New inputs
are added to the corpus; inputs that crash, hang or take more than 2 GiB go to `artifacts` in it.
"""

from __future__ import annotations

import argparse
import csv
import datetime
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

HERE = Path(__file__).resolve().parent
#: In memory where the system has such a place.
MEMORY = Path("/dev/shm")
TARGETS = [path.stem for path in sorted((HERE / "targets").glob("*.rs"))]
#: An input that takes longer is a finding.
SECONDS = 20
FIELDS = ["date", "target", "executions", "cpu_s", "corpus", "findings"]


def cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def was_starved(binary: Path, artifacts: Path) -> bool:
    """Whether the newest finding timed out only because the processor was busy; removes it then."""
    newest = max(artifacts.iterdir(), key=lambda path: path.stat().st_mtime, default=None)
    if newest is None or not newest.name.startswith("timeout-"):
        return False
    before = cpu_of_children()
    subprocess.run([str(binary), "-timeout=600", str(newest)], capture_output=True, check=False)
    if cpu_of_children() - before >= SECONDS:
        return False
    newest.unlink()
    return True


def one(target: str, options: argparse.Namespace) -> dict[str, object]:
    """Runs a target for some seconds, and starts it again after each finding."""
    corpus, artifacts = options.corpus / target, options.corpus / "artifacts" / target
    corpus.mkdir(parents=True, exist_ok=True)
    artifacts.mkdir(parents=True, exist_ok=True)
    before = cpu_of_children()
    end = datetime.datetime.now() + datetime.timedelta(seconds=options.seconds)
    executions = findings = 0
    work = tempfile.mkdtemp(prefix="corsmal-fuzz-", dir=MEMORY if MEMORY.is_dir() else None)
    while (left := (end - datetime.datetime.now()).total_seconds()) > 1 and findings < 5:
        command = [
            str(options.binaries / target),
            str(corpus),
            f"-artifact_prefix={artifacts}/",
            f"-max_total_time={int(left)}",
            "-rss_limit_mb=2048",
            f"-timeout={SECONDS}",
            "-max_len=65536",
            "-print_final_stats=1",
        ]
        environment = {**os.environ, "RUST_BACKTRACE": "0", "CORSMAL_FUZZ_FOLDER": work}
        with (options.corpus / f"{target}.out").open("w+") as out:
            done = subprocess.run(command, stdout=out, stderr=out, check=False, env=environment)
            out.seek(0)
            text = out.read()
        counts = re.findall(r"number_of_executed_units: (\d+)", text)
        # A target that was stopped says no final figure.
        counts = counts or re.findall(r"^#(\d+)\s", text, re.MULTILINE)
        executions += int(counts[-1]) if counts else 0
        if done.returncode != 0 and not was_starved(options.binaries / target, artifacts):
            findings += 1
            print(f"{target}: exit {done.returncode}, see {artifacts}", file=sys.stderr)
    shutil.rmtree(work, ignore_errors=True)
    cpu = cpu_of_children() - before
    count = sum(1 for _ in corpus.iterdir())
    date = datetime.date.today().isoformat()
    return dict(zip(FIELDS, [date, target, executions, round(cpu), count, findings], strict=True))


def summary(log: Path) -> None:
    """The table of LOG.md."""
    totals: dict[str, list[float]] = defaultdict(lambda: [0, 0, 0, 0])
    with log.open() as file:
        for row in csv.DictReader(file):
            total = totals[row["target"]]
            total[0] += int(row["executions"])
            total[1] += float(row["cpu_s"])
            total[2] = int(row["corpus"])
            total[3] += int(row["findings"])
    print("| target | executions | CPU minutes | corpus | stops |\n|---|---|---|---|---|")
    for target, (executions, cpu, corpus, stops) in sorted(totals.items()):
        print(f"| {target} | {executions:,} | {cpu / 60:.1f} | {corpus} | {stops} |")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("targets", nargs="*", default=TARGETS)
    parser.add_argument("--seconds", type=int, default=300, help="seconds per target and round")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--corpus", type=Path, default=HERE / "corpus")
    built = HERE / "target/x86_64-unknown-linux-gnu/release"
    parser.add_argument("--binaries", type=Path, default=built)
    parser.add_argument("--summary", action="store_true", help="only print the results so far")
    options = parser.parse_args()
    log = options.corpus / "log.csv"
    if options.summary:
        return summary(log)
    for _ in range(options.rounds):
        for target in options.targets:
            row = one(target, options)
            new = not log.exists()
            with log.open("a", newline="") as file:
                writer = csv.DictWriter(file, FIELDS)
                if new:
                    writer.writeheader()
                writer.writerow(row)
            print(row, flush=True)


if __name__ == "__main__":
    main()
