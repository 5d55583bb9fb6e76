"""Functions on arrays in memory: corsmal_feat and librosa, as a Markdown table.

    python benches/python_arrays.py [--channels 8] [--seconds 10] [--n-fft 2048] [--only REGEX]

Both run on the same array in one process. Each makes its calls in a row, after a pause, because the
BLAS threads behind librosa spin for a while after a call and would take a core from the next one.
The figures are medians. "Bytes" is about the least time that this machine needs: in it
numpy, with a thread per core, reads the bytes of the argument and writes those of a new result.
"""

from __future__ import annotations

import argparse
import os
import platform
import re
import statistics
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import corsmal_feat
import librosa
import numpy as np

SR = 44100
# Seconds between rows of calls, and of calls before and while they count.
REST, UNCOUNTED, COUNTED = 0.5, 0.3, 0.4


def recording(channels: int, seconds: float, dtype: Any) -> Any:
    """Noise with a rising resonance in each channel [shape=(channels, n)]."""
    rng = np.random.default_rng(0)
    t = np.arange(int(seconds * SR)) / SR
    tone = 0.3 * np.sin(2 * np.pi * (400 + 150 * t) * t)
    return (tone + 0.1 * rng.standard_normal((channels, t.size))).astype(dtype)


def cases(y: Any, n_fft: int) -> dict[str, tuple[Any, Callable[[Any, Any], Any]]]:
    """Arguments and calls to make with either module; defaults except for the transform."""
    framing = {} if n_fft == 2048 else {"n_fft": n_fft, "hop_length": n_fft // 4}
    power = librosa.feature.melspectrogram(y=y, sr=SR, **framing)
    spectrum = librosa.stft(y, **framing)
    inverse = {} if n_fft == 2048 else {"hop_length": n_fft // 4}
    one = y[0]

    def feature(name: str, **keywords: Any) -> tuple[Any, Callable[[Any, Any], Any]]:
        return y, lambda m, y: getattr(m.feature, name)(y=y, **keywords, **framing)

    def resampled(rate: float) -> tuple[Any, Callable[[Any, Any], Any]]:
        return y, lambda m, y: m.resample(y, orig_sr=SR, target_sr=rate)

    return {
        "stft": (y, lambda m, y: m.stft(y, **framing)),
        "feature.melspectrogram": feature("melspectrogram", sr=SR),
        "feature.mfcc": feature("mfcc", sr=SR),
        "power_to_db": (power, lambda m, power: m.power_to_db(power)),
        "feature.zero_crossing_rate": (y, lambda m, y: m.feature.zero_crossing_rate(y)),
        "feature.rms": (y, lambda m, y: m.feature.rms(y=y)),
        "feature.spectral_centroid": feature("spectral_centroid", sr=SR),
        "feature.spectral_bandwidth": feature("spectral_bandwidth", sr=SR),
        "feature.spectral_rolloff": feature("spectral_rolloff", sr=SR),
        "feature.spectral_flatness": feature("spectral_flatness"),
        "feature.spectral_contrast": feature("spectral_contrast", sr=SR),
        "feature.poly_features": feature("poly_features", sr=SR),
        "feature.delta": (power, lambda m, power: m.feature.delta(power)),
        "feature.chroma_stft": feature("chroma_stft", sr=SR),
        "onset.onset_strength": (one, lambda m, y: m.onset.onset_strength(y=y, sr=SR, **framing)),
        "istft": (spectrum, lambda m, spectrum: m.istft(spectrum, **inverse)),
        "decompose.hpss": (spectrum[0], lambda m, spectrum: m.decompose.hpss(spectrum)),
        "cqt": (one, lambda m, y: m.cqt(y, sr=SR)),
        "feature.chroma_cqt": (one, lambda m, y: m.feature.chroma_cqt(y=y, sr=SR)),
        "feature.tonnetz": (one, lambda m, y: m.feature.tonnetz(y=y, sr=SR)),
        "piptrack": (one, lambda m, y: m.piptrack(y=y, sr=SR, **framing)),
        "resample 44.1 to 16 kHz": resampled(16000),
        "resample 44.1 to 22.05 kHz": resampled(SR / 2),
    }


class Bytes:
    """Reading and writing memory by numpy, with a thread per core."""

    def __init__(self) -> None:
        self.threads = os.cpu_count() or 1
        self.pool = ThreadPoolExecutor(self.threads)

    def move(self, argument: Any, result: int) -> None:
        """Reads the argument once and writes `result` bytes of new memory."""
        # Finding the largest word takes no longer than reading.
        words = np.frombuffer(argument, np.uint64)
        new = np.empty(result // 8, np.uint64)
        list(self.pool.map(np.max, np.array_split(words, self.threads)))
        list(self.pool.map(lambda part: part.fill(1), np.array_split(new, self.threads)))


def seconds(function: Callable[[], Any]) -> float:
    start = time.perf_counter()
    function()
    return time.perf_counter() - start


def median(function: Callable[[], Any], least: int) -> float:
    """Median seconds of at least `least` calls, after a pause and calls that are not counted."""
    time.sleep(REST)
    spent, runs = 0.0, []
    while spent < UNCOUNTED + COUNTED or len(runs) < least:
        run = seconds(function)
        if spent >= UNCOUNTED:
            runs.append(run)
        spent += run
    return statistics.median(runs)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--channels", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--n-fft", type=int, default=2048)
    parser.add_argument("--dtype", choices=("float32", "float64"), default="float32")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--only", default="", help="regular expression on the names")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    y = recording(args.channels, args.seconds, args.dtype)
    print(
        f"{args.channels} channels, {args.seconds:g} s at {SR} Hz, {args.dtype}, "
        f"n_fft {args.n_fft}; median of {args.repeats} or more, one process; "
        f"{os.cpu_count()} cores, {platform.machine()}, {platform.system()}; "
        f"corsmal-feat {corsmal_feat.__version__}, librosa {librosa.__version__}, "
        f"numpy {np.__version__}, Python {platform.python_version()}\n"
    )
    print(
        "| function | corsmal_feat, ms | librosa, ms | ratio | bytes, ms |\n|---|---|---|---|---|"
    )
    memory = Bytes()
    for name, (argument, case) in cases(y, args.n_fft).items():
        if re.search(args.only, name):
            modules = (corsmal_feat, librosa)
            times = (median(partial(case, module, argument), args.repeats) for module in modules)
            ours, theirs = times
            result = case(corsmal_feat, argument)
            size = sum(part.nbytes for part in result) if type(result) is tuple else result.nbytes
            flat = np.ascontiguousarray(argument).ravel().view(np.uint8)
            flat = flat[: flat.size // 8 * 8]
            bound = median(partial(memory.move, flat, size), args.repeats)
            row = (f"{1e3 * ours:.1f}", f"{1e3 * theirs:.1f}", f"{theirs / ours:.1f}")
            print(f"| `{name}` | {' | '.join(row)} | {1e3 * bound:.1f} |", flush=True)


if __name__ == "__main__":
    main()
