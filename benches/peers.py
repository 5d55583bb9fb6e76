"""Feature extraction as users of other packages write it, timed on a folder of recordings.

    python benches/peers.py librosa logmel --corpus DIR --out DIR [--processes 2] [--n-fft 2048]

Each worker process imports its package and computes the shortest recording once; then all start
together. The time is taken from there: each file is read from disk, computed, and written as one
.npz. Prints one line of JSON: seconds, CPU seconds, peak memory of all workers together, and the
start-up time before.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import multiprocessing
import multiprocessing.synchronize
import pathlib
import resource
import threading
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any

Compute = Callable[[str], Any]
_compute: Compute
_all_ready: multiprocessing.synchronize.Barrier


def librosa(workload: str, n_fft: int, n_mels: int) -> Compute:
    import librosa
    import numpy as np

    feature, hop = librosa.feature, n_fft // 4

    def logmel(path: str) -> Any:
        y, sr = librosa.load(path, sr=None, mono=False)
        mel = feature.melspectrogram(y=y, sr=sr, n_fft=n_fft, hop_length=hop, n_mels=n_mels)
        return librosa.power_to_db(mel)

    def mfcc_zcr(path: str) -> Any:
        y, sr = librosa.load(path, sr=None, mono=False)
        rows = feature.mfcc(y=y, sr=sr), feature.zero_crossing_rate(y)
        return np.concatenate(rows, axis=-2, dtype=np.float32)

    def esc26(path: str) -> Any:
        y, sr = librosa.load(path)
        parts = feature.mfcc(y=y, sr=sr)[1:13], feature.zero_crossing_rate(y)
        return np.concatenate([f(rows, axis=1) for rows in parts for f in (np.mean, np.std)])

    def af193(path: str) -> Any:
        y, sr = librosa.load(path, sr=None, mono=False)
        y = np.ascontiguousarray(y[0])
        magnitude = np.abs(librosa.stft(y))
        parts = (
            feature.mfcc(y=y, sr=sr, n_mfcc=40),
            feature.chroma_stft(S=magnitude, sr=sr),
            feature.melspectrogram(y=y, sr=sr),
            feature.spectral_contrast(S=magnitude, sr=sr),
            feature.tonnetz(y=librosa.effects.harmonic(y), sr=sr),
        )
        return np.concatenate([part.mean(axis=1) for part in parts])

    return {"logmel": logmel, "mfcc-zcr": mfcc_zcr, "esc26": esc26, "af193": af193}[workload]


def pyaudioanalysis(workload: str, n_fft: int, n_mels: int) -> Compute:
    import numpy as np
    from pyAudioAnalysis.MidTermFeatures import mid_feature_extraction
    from scipy.io import wavfile

    assert workload == "a34f136", workload

    def a34f136(path: str) -> Any:
        sr, y = wavfile.read(path)
        mean = y.mean(axis=1)
        mono = np.trunc(mean + np.copysign(0.5, mean))  # 16-bit counts, halves away from zero
        mid, _, _ = mid_feature_extraction(mono, sr, sr, sr, round(0.05 * sr), round(0.05 * sr))
        return mid.mean(axis=1)

    return a34f136


def original(workload: str, n_fft: int, n_mels: int) -> Compute:
    import originals

    return originals.of(workload)


#: by name: factory and the name of the distribution
PEERS: dict[str, tuple[Callable[[str, int, int], Compute], str]] = {
    "librosa": (librosa, "librosa"),
    "pyAudioAnalysis": (pyaudioanalysis, "pyAudioAnalysis"),
    "original": (original, "librosa"),
}


def version(peer: str) -> str | None:
    """Version of an installed peer."""
    try:
        return importlib.metadata.version(PEERS[peer][1])
    except importlib.metadata.PackageNotFoundError:
        return None


def _start(
    factory: tuple[str, str, int, int], shortest: str, ready: multiprocessing.synchronize.Barrier
) -> None:
    global _compute, _all_ready
    warnings.simplefilter("ignore")
    peer, *arguments = factory
    _compute = PEERS[peer][0](*arguments)
    _compute(shortest)
    _all_ready = ready


def _wait_for_the_others() -> None:
    _all_ready.wait(300)


def _extract(job: tuple[str, str]) -> tuple[int, float, float]:
    import numpy as np

    path, out = job
    before = time.process_time()
    np.savez(out, np.asarray(_compute(path), dtype=np.float32))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return multiprocessing.current_process().pid or 0, time.process_time() - before, peak


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("peer", choices=PEERS)
    parser.add_argument("workload")
    parser.add_argument("--corpus", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--n-fft", type=int, default=2048)
    parser.add_argument("--n-mels", type=int, default=128)
    args = parser.parse_args()
    # Longest first, so that the processes end together.
    paths = sorted(args.corpus.glob("*.wav"), key=lambda p: (-p.stat().st_size, p.name))
    args.out.mkdir(parents=True, exist_ok=True)
    jobs = [(str(path), str(args.out / f"{path.stem}.npz")) for path in paths]
    context = multiprocessing.get_context("spawn")
    ready = context.Barrier(args.processes)
    factory = (args.peer, args.workload, args.n_fft, args.n_mels)
    begin = time.perf_counter()
    arguments = (factory, str(paths[-1]), ready)
    try:
        with ProcessPoolExecutor(args.processes, context, _start, arguments) as pool:
            waits = [pool.submit(_wait_for_the_others) for _ in range(args.processes)]
            try:
                for wait in waits:
                    wait.result()
            except threading.BrokenBarrierError:
                # The pool would wait for the one that hangs.
                for process in multiprocessing.active_children():
                    process.kill()
                raise SystemExit(f"{args.peer}: not every process was ready in time") from None
            start = time.perf_counter()
            done = list(pool.map(_extract, jobs))
            seconds = time.perf_counter() - start
    except BrokenProcessPool:
        raise SystemExit(f"{args.peer}: a process died, perhaps with a message above") from None
    peaks: dict[int, float] = {}
    for process, _, peak in done:
        peaks[process] = max(peak, peaks.get(process, 0.0))
    result = {
        "seconds": seconds,
        "cpu": sum(cpu for _, cpu, _ in done),
        "mib": sum(peaks.values()),
        "start": start - begin,
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
