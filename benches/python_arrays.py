"""Functions on arrays in memory: corsmal_feat and librosa, as a Markdown table.

    python benches/python_arrays.py [--channels 8] [--seconds 10] [--n-fft 2048] [--only REGEX]

Both run on the same array in one process. Each makes its calls in a row, after a pause, because the
BLAS threads behind librosa spin for a while after a call and would take a core from the next one.
The figures are medians.
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


def cases(y: Any, n_fft: int) -> dict[str, Callable[[Any], Any]]:
    """Calls to make with either module, by name; defaults except for the transform."""
    framing = {} if n_fft == 2048 else {"n_fft": n_fft, "hop_length": n_fft // 4}
    power = librosa.feature.melspectrogram(y=y, sr=SR, **framing)
    spectrum = librosa.stft(y, **framing)
    inverse = {} if n_fft == 2048 else {"hop_length": n_fft // 4}
    shape = ("centroid", "bandwidth", "rolloff", "flatness", "contrast")

    def of_shape(name: str) -> Callable[[Any], Any]:
        rate = {} if name == "flatness" else {"sr": SR}
        return lambda m: getattr(m.feature, f"spectral_{name}")(y=y, **rate, **framing)

    return {
        "stft": lambda m: m.stft(y, **framing),
        "feature.melspectrogram": lambda m: m.feature.melspectrogram(y=y, sr=SR, **framing),
        "feature.mfcc": lambda m: m.feature.mfcc(y=y, sr=SR, **framing),
        "power_to_db": lambda m: m.power_to_db(power),
        "feature.zero_crossing_rate": lambda m: m.feature.zero_crossing_rate(y),
        "feature.rms": lambda m: m.feature.rms(y=y),
        **{f"feature.spectral_{name}": of_shape(name) for name in shape},
        "feature.poly_features": lambda m: m.feature.poly_features(y=y, sr=SR, **framing),
        "feature.delta": lambda m: m.feature.delta(power),
        "feature.chroma_stft": lambda m: m.feature.chroma_stft(y=y, sr=SR, **framing),
        "onset.onset_strength": lambda m: m.onset.onset_strength(y=y[0], sr=SR, **framing),
        "istft": lambda m: m.istft(spectrum, **inverse),
        "decompose.hpss": lambda m: m.decompose.hpss(spectrum[0]),
        "cqt": lambda m: m.cqt(y[0], sr=SR),
        "feature.chroma_cqt": lambda m: m.feature.chroma_cqt(y=y[0], sr=SR),
        "feature.tonnetz": lambda m: m.feature.tonnetz(y=y[0], sr=SR),
        "piptrack": lambda m: m.piptrack(y=y[0], sr=SR, **framing),
        "resample 44.1 to 16 kHz": lambda m: m.resample(y, orig_sr=SR, target_sr=16000),
        "resample 44.1 to 22.05 kHz": lambda m: m.resample(y, orig_sr=SR, target_sr=SR / 2),
    }


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
    print("| function | corsmal_feat, ms | librosa, ms | ratio |\n|---|---|---|---|")
    for name, case in cases(y, args.n_fft).items():
        if re.search(args.only, name):
            modules = (corsmal_feat, librosa)
            ours, theirs = (median(partial(case, module), args.repeats) for module in modules)
            print(f"| `{name}` | {1e3 * ours:.1f} | {1e3 * theirs:.1f} | {theirs / ours:.1f} |")


if __name__ == "__main__":
    main()
