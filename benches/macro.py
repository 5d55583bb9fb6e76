"""Benchmarks of whole commands: corsmal-feat and the packages that it replaces.

    cargo build --release
    python benches/macro.py all                  # measures everything, writes docs/speed.*
    python benches/macro.py peers --repeats 5    # one part; `report` rewrites the documents

Needs numpy here, the peers (librosa, resampy, scikit-image, pyAudioAnalysis, scipy) in the
interpreter given by --python, and valgrind for `instructions`. The first run makes the corpus;
--corpus uses another one. Results are collected in --results until `report` writes them between the
markers in docs/speed.md and draws docs/speed.svg. Each timed command runs in its own process, and
the contenders take turns. --prefix puts a command before each, for example one that keeps the
machine quiet.
"""

from __future__ import annotations

import argparse
import datetime
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import corpus
import numpy as np
import numpy.typing as npt
import originals
import peers
import report
from workloads import MFCC_ZCR, WORKLOADS, Workload

ROOT = pathlib.Path(__file__).resolve().parent.parent
Arrays = Mapping[str, npt.NDArray[Any]]


class Bench:
    """Options, scratch folder, and results so far."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.args = args
        self.binary = str(args.binary.resolve())
        self.work: pathlib.Path = args.work.resolve()
        self.work.mkdir(parents=True, exist_ok=True)
        (self.work / "mfcc-zcr.toml").write_text(MFCC_ZCR)
        self.corpus: pathlib.Path = (args.corpus or self.work / "corpus").resolve()
        if not any(self.corpus.glob("*.wav")):
            print(f"making {self.corpus}", file=sys.stderr)
            corpus.make(self.corpus)
        self.results: dict[str, Any] = {}
        if args.results.exists():
            self.results = json.loads(args.results.read_text())

    def keep(self, part: str, rows: Any) -> None:
        """Stores the results of one part, and the machine that it was measured on."""
        self.results[part] = {"rows": rows, **machine(self.binary)}
        self.args.results.write_text(json.dumps(self.results, indent=1))

    def once(self, command: Sequence[str], count: int = 1) -> dict[str, Any]:
        """Runs a command `count` times in a row: lists of seconds, CPU seconds and MiB, and what a
        peer reports about itself."""
        here = [sys.executable, str(pathlib.Path(__file__).resolve()), "_once", str(count)]
        prefix = shlex.split(self.args.prefix)
        done = subprocess.run([*prefix, *here, *command], stdout=subprocess.PIPE, check=True)
        return dict(json.loads(done.stdout))

    def extract(self, arguments: Sequence[str], inputs: pathlib.Path, jobs: int = 2) -> list[str]:
        """The command that extracts into the scratch folder."""
        arguments = [argument.format(work=self.work) for argument in arguments]
        out = str(self.work / "ours.npz")
        command = [self.binary, "extract", "--quiet", "--overwrite", "--jobs", str(jobs)]
        return [*command, "--in", str(inputs), "--out", out, *arguments]

    def peer(self, name: str, task: str, inputs: pathlib.Path, *options: str) -> list[str]:
        """The command that runs a peer in two processes."""
        out = self.work / "theirs"
        shutil.rmtree(out, ignore_errors=True)
        script = str(ROOT / "benches" / "peers.py")
        command = [str(self.args.python), script, name, task, "--corpus", str(inputs)]
        return [*command, "--out", str(out), *options]

    def median(self, commands: Mapping[Any, Callable[[], list[str]]]) -> dict[Any, dict[str, Any]]:
        """Runs all commands in turn, --repeats times: lists of what `once` measures."""
        runs: dict[Any, dict[str, Any]] = {key: {} for key in commands}
        for repeat in range(self.args.repeats):
            for key, command in commands.items():
                run = self.once(command())
                for name, values in run.items():
                    runs[key].setdefault(name, []).extend(values)
                print(f"[{repeat}] {key}: {run['seconds'][0]:.3f} s", file=sys.stderr)
        return runs


def once(count: int, command: Sequence[str]) -> None:
    """Times a command in this process's children and prints JSON. A last line of JSON that the
    command prints replaces what is measured from outside."""
    runs: dict[str, list[float]] = {}
    # One pool of threads for each worker: the peers' own would compete with their processes.
    env = dict(os.environ, **{f"{pool}_NUM_THREADS": "1" for pool in ("OMP", "OPENBLAS", "MKL")})
    for _ in range(count):
        # Each begins with nothing left to write, so that none waits for what another wrote.
        os.sync()
        begin = time.perf_counter()
        process = subprocess.Popen(command, stdout=subprocess.PIPE, env=env)
        assert process.stdout is not None
        printed = process.stdout.read().decode().splitlines()
        _, status, usage = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - begin
        if os.waitstatus_to_exitcode(status) != 0:
            sys.exit(f"failed: {shlex.join(command)}")
        cpu, mib = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024
        run = {"seconds": seconds, "cpu": cpu, "mib": mib}
        if printed and printed[-1].startswith("{"):
            run.update(json.loads(printed[-1]))
        for name, value in run.items():
            runs.setdefault(name, []).append(value)
    print(json.dumps(runs))


def machine(binary: str) -> dict[str, str]:
    """The machine and versions that results depend on."""
    cpu = "unknown processor"
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            cpu = line.split(":", 1)[1].strip()
        if line.startswith("flags") and "avx512f" in line.split():
            cpu += " with AVX-512"
            break
    version = subprocess.run([binary, "--version"], capture_output=True, text=True, check=True)
    today = datetime.date.today().isoformat()
    cores = len(os.sched_getaffinity(0))
    return {"date": today, "machine": f"{cores} cores, {cpu}", "version": version.stdout.strip()}


def ours(work: pathlib.Path, workload: Workload) -> Arrays:
    """Values of our last run, by recording."""
    with np.load(work / "ours.npz") as npz:
        ids = [str(name) for name in npz["__ids__"]]
        if "__summary__" in npz:
            return dict(zip(ids, npz["__summary__"], strict=True))
        if not workload.features:
            return {name: npz[name] for name in ids}
        parts = {name: [npz[f"{name}/{f}"] for f in workload.features] for name in ids}
        return {name: np.concatenate(rows, axis=1) for name, rows in parts.items()}


def difference(work: pathlib.Path, workload: Workload) -> dict[str, float]:
    """Largest difference from the peer's last run: absolute, and relative to the tolerance."""
    absolute, relative = workload.tolerance
    worst, share = 0.0, 0.0
    for name, mine in ours(work, workload).items():
        with np.load(work / "theirs" / f"{name}.npz") as npz:
            theirs = npz["arr_0"]
        if mine.shape != theirs.shape:
            sys.exit(f"{workload.title}: {name} is {mine.shape}, the peer's {theirs.shape}")
        apart = np.abs(mine - theirs)
        worst = max(worst, float(apart.max()))
        share = max(share, float((apart / (absolute + relative * np.abs(theirs))).max()))
    return {"largest": worst, "of_tolerance": share}


def measure_peers(bench: Bench) -> None:
    """Every workload against its peer; values are compared."""
    rows: dict[str, Any] = {}
    for key in bench.args.workloads.split(","):
        workload = WORKLOADS[key]
        runs = bench.median(
            {
                "ours": lambda w=workload: bench.extract(w.arguments, bench.corpus),
                "theirs": lambda w=workload: bench.peer(w.peer, w.task, bench.corpus),
            }
        )
        rows[key] = {**runs, "difference": difference(bench.work, workload)}
        rows[key].update(title=workload.title, peer=workload.peer)
        rows[key].update(tolerance=workload.tolerance, peer_version=peers.version(workload.peer))
        if rows[key]["difference"]["of_tolerance"] > 1.0:
            sys.exit(f"{key}: values differ by more than the tolerance: {rows[key]['difference']}")
    merged = bench.results.get("peers", {}).get("rows", {}).get("workloads", {})
    seconds = corpus.seconds(bench.corpus)
    bench.keep("peers", {"workloads": {**merged, **rows}, "seconds": seconds})


def measure_presets(bench: Bench) -> None:
    """Every preset, with librosa 0.8's conventions, against the code that it replaces."""
    folder = bench.work / "takes"
    if not folder.exists():
        corpus.shortened(bench.corpus, folder, 7.0)
    commands: dict[Any, Callable[[], list[str]]] = {}
    for preset in originals.PRESETS:
        arguments = ["--preset", preset, "--set", "librosa=0.8"]
        whose = ("pyAudioAnalysis", preset) if preset == "a34f136" else ("original", preset)
        commands[preset, "ours"] = lambda a=arguments: bench.extract(a, folder)
        commands[preset, "theirs"] = lambda w=whose: bench.peer(*w, folder)
    runs = bench.median(commands)
    rows = {p: {side: runs[p, side] for side in ("ours", "theirs")} for p in originals.PRESETS}
    number = len(list(folder.glob("*.wav")))
    bench.keep("presets", {"runs": rows, "seconds": corpus.seconds(folder), "number": number})


def measure_scaling(bench: Bench) -> None:
    """One job and two: many files, one long file by spans of time, one by channels."""
    long, short = bench.work / "long" / "all.wav", bench.work / "long" / "eighth.wav"
    if not short.exists():
        corpus.joined(bench.corpus, long, 1)
        corpus.joined(bench.corpus, short, 8)
    cases = {
        "log-mel, 48 files": (WORKLOADS["W1"].arguments, bench.corpus),
        "AF193, 48 files": (WORKLOADS["W4"].arguments, bench.corpus),
        "log-mel, one file of 480 s": (WORKLOADS["W1"].arguments, long),
        "MFCC and ZCR statistics, one file of 480 s": (["--preset", "mfcc-zcr"], long),
        "AF193 of all 8 channels, one file of 60 s": (
            ["--preset", "af193", "--set", "signal.channels=all"],
            short,
        ),
    }
    commands = {
        (title, jobs): lambda a=arguments, i=inputs, j=jobs: bench.extract(a, i, j)
        for title, (arguments, inputs) in cases.items()
        for jobs in (1, 2)
    }
    runs = bench.median(commands)
    bench.keep("scaling", {title: [runs[title, 1], runs[title, 2]] for title in cases})


def measure_benchmark(bench: Bench) -> None:
    """All baselines on 1,140 recordings: features and learning, and learning alone."""
    data, out = bench.work / "ccm", bench.work / "report"
    if not data.exists():
        subprocess.run([bench.binary, "synth", "--full", "--quiet", "--out", str(data)], check=True)

    def command(jobs: int, kept: bool) -> list[str]:
        if not kept:
            shutil.rmtree(out, ignore_errors=True)
        folders = ["--data", str(data), "--out", str(out)]
        return [bench.binary, "benchmark", "--quiet", "--jobs", str(jobs), *folders]

    cases = {"from recordings": False, "from kept features": True}
    commands = {
        (title, jobs): lambda j=jobs, k=kept: command(j, k)
        for jobs in (1, 2)
        for title, kept in cases.items()
    }
    runs = bench.median(commands)
    bench.keep("benchmark", {title: [runs[title, 1], runs[title, 2]] for title in cases})


def measure_channels(bench: Bench) -> None:
    """The same samples as recordings of 1, 2 and 8 channels."""
    folders = {channels: bench.work / f"channels{channels}" for channels in (1, 2, 8)}
    for channels, folder in folders.items():
        if not folder.exists():
            corpus.regrouped(bench.corpus, folder, channels)
    cases = {"log-mel": ["--preset", "logmel"], "MFCC and ZCR": WORKLOADS["W2"].arguments}
    commands = {
        (title, channels): lambda a=arguments, f=folder: bench.extract(a, f)
        for title, arguments in cases.items()
        for channels, folder in folders.items()
    }
    runs = bench.median(commands)
    channel_seconds = 8.0 * corpus.seconds(folders[8])
    rows = {title: {str(n): runs[title, n] for n in folders} for title in cases}
    bench.keep("channels", {"runs": rows, "channel_seconds": channel_seconds})


def measure_nfft(bench: Bench) -> None:
    """Transform lengths at 16 kHz against librosa."""
    folder = bench.work / "rate16000"
    if not folder.exists():
        corpus.at_rate(bench.corpus, folder, 16_000)
    commands: dict[Any, Callable[[], list[str]]] = {}
    for n_fft in (512, 1024, 2048, 4096):
        values = {"n_fft": n_fft, "hop_length": n_fft // 4, "n_mels": 64}
        sets = [f"--set=melspectrogram.{key}={value}" for key, value in values.items()]
        options = ["--n-fft", str(n_fft), "--n-mels", "64"]
        commands[n_fft, "ours"] = lambda s=sets: bench.extract(["--preset", "logmel", *s], folder)
        commands[n_fft, "theirs"] = lambda o=options: bench.peer("librosa", "logmel", folder, *o)
    runs = bench.median(commands)
    rows = {str(n): {"ours": runs[n, "ours"], "theirs": runs[n, "theirs"]} for n, _ in commands}
    bench.keep("nfft", {"runs": rows, "seconds": corpus.seconds(folder)})


def measure_startup(bench: Bench) -> None:
    """`--version`, and what `import corsmal_feat` adds to numpy's import, if it is installed."""
    rows = {"corsmal-feat --version": bench.once([bench.binary, "--version"], 20)}
    python = [str(bench.args.python), "-c"]
    probe = subprocess.run([*python, "import corsmal_feat"], capture_output=True)
    if probe.returncode == 0:
        for code in ("import numpy", "import numpy, corsmal_feat"):
            rows[f'python -c "{code}"'] = bench.once([*python, code], 10)
    bench.keep("startup", rows)


def measure_memory(bench: Bench) -> None:
    """Peak memory of each workload with two jobs."""
    runs = {
        key: bench.once(bench.extract(workload.arguments, bench.corpus))
        for key, workload in WORKLOADS.items()
    }
    bench.keep("memory", {key: run["mib"][0] for key, run in runs.items()})


def measure_instructions(bench: Bench) -> None:
    """Instructions of each workload on the shortest recording, as counted by valgrind."""
    shortest = min(bench.corpus.glob("*.wav"), key=lambda path: path.stat().st_size)
    counter = ["valgrind", "--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"]
    cases = {"--version": [bench.binary, "--version"]}
    for key, workload in WORKLOADS.items():
        cases[key] = bench.extract(workload.arguments, shortest, 1)
    rows = {}
    for key, command in cases.items():
        done = subprocess.run([*counter, *command], capture_output=True, text=True, check=True)
        counted = re.search(r"I\s+refs:\s+([\d,]+)", done.stderr)
        rows[key] = int(counted[1].replace(",", "")) if counted else 0
        print(f"{key}: {rows[key] / 1e6:.1f} million instructions", file=sys.stderr)
    seconds = (shortest.stat().st_size - 44) / 2 / 8 / corpus.RATE
    bench.keep("instructions", {"counts": rows, "seconds": seconds})


PARTS: dict[str, Callable[[Bench], None]] = {
    "startup": measure_startup,
    "memory": measure_memory,
    "peers": measure_peers,
    "presets": measure_presets,
    "scaling": measure_scaling,
    "benchmark": measure_benchmark,
    "channels": measure_channels,
    "nfft": measure_nfft,
    "instructions": measure_instructions,
}


def main() -> None:
    if sys.argv[1:2] == ["_once"]:
        once(int(sys.argv[2]), sys.argv[3:])
        return
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("part", choices=["all", "report", *PARTS], help="what to do")
    path = pathlib.Path
    parser.add_argument("--binary", type=path, default=ROOT / "target/release/corsmal-feat")
    parser.add_argument("--python", type=path, default=path(sys.executable), help="runs the peers")
    parser.add_argument("--corpus", type=path, help="folder of 8-channel WAV files, 16 bit")
    parser.add_argument("--work", type=path, default=ROOT / "target/macro", help="scratch folder")
    parser.add_argument("--results", type=path, default=ROOT / "target/macro.json")
    parser.add_argument("--docs", type=path, default=ROOT / "docs")
    parser.add_argument("--prefix", default="", help="command put before every timed one")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--workloads", default=",".join(WORKLOADS), help="for peers")
    args = parser.parse_args()
    bench = Bench(args)
    for name, measure in PARTS.items():
        if args.part in (name, "all"):
            measure(bench)
    if args.part in ("all", "report"):
        report.write(bench.results, args.docs)


if __name__ == "__main__":
    main()
