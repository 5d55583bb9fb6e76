"""Threads, forks and what a number of threads must not change."""

from __future__ import annotations

import multiprocessing
import os
import sys
import threading
import time
from pathlib import Path
from typing import Any

import corsmal_feat
import numpy as np
import pytest
from test_arrow import write

Y = np.random.default_rng(0).normal(size=(3, 30000)).astype(np.float32)


def features(y: np.ndarray) -> list[np.ndarray]:
    f = corsmal_feat.feature
    return [
        corsmal_feat.stft(y),
        f.mfcc(y=y),
        f.spectral_contrast(y=y),
        f.zero_crossing_rate(y),
        f.rms(y=y),
        corsmal_feat.KNN(1).fit(y[:, :50], ["a", "b", "c"]).predict_proba(y[:, :50]),
    ]


def test_threads_take_turns_at_one_signal() -> None:
    extractor = corsmal_feat.SignalExtractor(8000, preset="mfcc-zcr")
    blocks, faults = 200, []

    def push() -> None:
        try:
            for _ in range(blocks):
                extractor.push(np.ones(80, np.float32))
        except Exception as error:
            faults.append(error)

    threads = [threading.Thread(target=push) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not faults
    alone = corsmal_feat.SignalExtractor(8000, preset="mfcc-zcr")
    alone.push(np.ones(3 * blocks * 80, np.float32))
    np.testing.assert_array_equal(extractor.finish(), alone.finish())


@pytest.mark.parametrize("jobs", ["1", "2", "7"])
def test_the_number_of_threads_changes_nothing(monkeypatch: pytest.MonkeyPatch, jobs: str) -> None:
    want = features(Y)
    monkeypatch.setenv("CORSMAL_FEAT_JOBS", jobs)
    for got, expected in zip(features(Y), want, strict=True):
        np.testing.assert_array_equal(got, expected)


@pytest.mark.parametrize("jobs", ["0", "-1", "many", ""])
def test_an_impossible_number_of_threads_is_refused(
    monkeypatch: pytest.MonkeyPatch, jobs: str
) -> None:
    monkeypatch.setenv("CORSMAL_FEAT_JOBS", jobs)
    with pytest.raises(corsmal_feat.ParameterError, match="CORSMAL_FEAT_JOBS"):
        corsmal_feat.stft(Y)


def checksum(_: int) -> float:
    return float(sum(np.abs(values).sum(dtype=np.float64) for values in features(Y)))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_fork_of_a_used_package_goes_on() -> None:
    want = checksum(0)
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(checksum, range(4)).get(timeout=60) == [want] * 4
    assert checksum(0) == want


def table(folder: str) -> list[float]:
    values = corsmal_feat.extract(folder, preset="esc26").summary
    assert values is not None
    return [float(x) for x in values.sum(axis=0)]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_fork_of_a_process_that_has_extracted_goes_on(tmp_path: Path) -> None:
    for seed in range(4):
        write(tmp_path / f"r{seed}.wav", seed)
    want = table(str(tmp_path))
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(table, [str(tmp_path)] * 4).get(timeout=60) == [want] * 4


def test_other_threads_run_meanwhile() -> None:
    y = np.random.default_rng(1).normal(size=(8, 400_000))
    ticks = []
    stop = threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    corsmal_feat.stft(y, hop_length=64, n_fft=4096)
    end = time.perf_counter()
    stop.set()
    thread.join()
    # With the lock held all the time there would be none but at the edges.
    assert sum(start + 0.01 < t < end - 0.01 for t in ticks) > 3, (end - start, sys.version)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_forked_processes_read_one_file(tmp_path: Path) -> None:
    names = [tmp_path / f"{k}.wav" for k in range(40)]
    for name in names:
        write(name, 1)
    out = tmp_path / "frames.npz"
    corsmal_feat.extract(names, config={"features": {"melspectrogram": {}}}, out=out)
    features = corsmal_feat.load_features(out)
    want = features[features.ids[0]]
    context = multiprocessing.get_context("fork")

    def read(faults: Any) -> None:
        try:
            for recording in features.ids[1:]:
                assert np.array_equal(features[recording], want)
            faults.put("")
        except Exception as error:
            faults.put(repr(error))

    faults = context.Queue()
    processes = [context.Process(target=read, args=(faults,)) for _ in range(4)]
    for process in processes:
        process.start()
    assert [faults.get(timeout=60) for _ in processes] == [""] * 4
    for process in processes:
        process.join()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_fork_in_another_folder_reads_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path / "x.wav", 1)
    monkeypatch.chdir(tmp_path)
    corsmal_feat.extract(["x.wav"], config="[features.rms]\n", out="f.npz")
    features = corsmal_feat.load_features("f.npz")
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir("sub")
    child = os.fork()
    if child == 0:
        try:
            os._exit(0 if features["x"].size else 1)
        except BaseException:
            os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
