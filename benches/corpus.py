"""Recordings for the benchmarks: a synthetic corpus, and variants of it."""

from __future__ import annotations

import pathlib
import wave
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

Pcm = npt.NDArray[np.int16]

RATE = 44_100
#: lengths of the 48 recordings in seconds, about 480 together
SECONDS = [3.0 + 27.0 * (i / 47) ** 2.94 for i in range(48)]


def write(path: pathlib.Path, pcm: Pcm, rate: int = RATE) -> None:
    """Writes `pcm [samples, channels]` as a 16-bit WAV file."""
    with wave.open(str(path), "wb") as file:
        file.setnchannels(pcm.shape[1])
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(pcm.astype("<i2").tobytes())


def read(path: pathlib.Path) -> Pcm:
    """The samples of a 16-bit WAV file, `[samples, channels]`."""
    with wave.open(str(path), "rb") as file:
        samples = np.frombuffer(file.readframes(file.getnframes()), dtype="<i2")
        return samples.reshape(-1, file.getnchannels())


def seconds(folder: pathlib.Path) -> float:
    """Total length in seconds of all recordings in a folder."""
    total = 0.0
    for path in folder.glob("*.wav"):
        with wave.open(str(path), "rb") as file:
            total += file.getnframes() / file.getframerate()
    return total


def recording(rng: np.random.Generator, length: float, channels: int = 8) -> Pcm:
    """Knocks and rustling over noise, with another level and delay in each channel."""
    n = int(length * RATE)
    time = np.arange(n) / RATE
    source = np.zeros(n)
    for _ in range(3):
        centre, width = rng.uniform(0.1, 0.9) * length, rng.uniform(0.05, 0.2) * length
        envelope = np.exp(-0.5 * ((time - centre) / width) ** 2)
        source += rng.uniform(0.1, 0.4) * envelope * rng.standard_normal(n)
    for _ in range(12):
        first = int(rng.uniform(0.0, 0.95) * n)
        ring = time[: min(n - first, RATE // 2)]
        for pitch in rng.uniform(150.0, 6000.0, size=3):
            decay = np.exp(-rng.uniform(8.0, 80.0) * ring)
            source[first : first + len(ring)] += decay * np.sin(2.0 * np.pi * pitch * ring)
    out = np.empty((n, channels))
    for channel in range(channels):
        # A running sum of noise, as rooms hum: most energy at low frequencies.
        hum = np.cumsum(rng.standard_normal(n)) / np.sqrt(np.arange(1, n + 1))
        delayed = np.roll(source, int(rng.integers(0, 60)))
        out[:, channel] = rng.uniform(0.6, 1.0) * delayed + 0.03 * hum
    return np.round(out * (0.3 * 32767 / np.abs(out).max())).astype(np.int16)


def make(folder: pathlib.Path) -> None:
    """Makes 48 recordings of 8 channels, with the same bytes in every run of one numpy version."""
    folder.mkdir(parents=True, exist_ok=True)
    order = np.random.default_rng(2026).permutation(len(SECONDS))
    for i, which in enumerate(order):
        rng = np.random.default_rng([2026, i])
        write(folder / f"rec{i:02d}.wav", recording(rng, SECONDS[which]))


def subset(corpus: pathlib.Path, every: int = 4) -> Iterator[tuple[str, Pcm]]:
    """Every n-th recording by name."""
    for path in sorted(corpus.glob("*.wav"))[::every]:
        yield path.name, read(path)


def regrouped(corpus: pathlib.Path, folder: pathlib.Path, channels: int) -> None:
    """A quarter of the corpus with fewer channels, one after another in time: as many files, the
    same samples."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, pcm in subset(corpus):
        groups = np.split(pcm, pcm.shape[1] // channels, axis=1)
        write(folder / name, np.concatenate(groups, axis=0))


def at_rate(corpus: pathlib.Path, folder: pathlib.Path, rate: int) -> None:
    """A quarter of the corpus, declared to have another sample rate."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, pcm in subset(corpus):
        write(folder / name, pcm, rate)


def shortened(corpus: pathlib.Path, folder: pathlib.Path, longest: float) -> None:
    """Half of the corpus, cut to the usual length of a recording in the CORSMAL data set."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, pcm in subset(corpus, 2):
        write(folder / name, pcm[: int(longest * RATE)])


def joined(corpus: pathlib.Path, path: pathlib.Path, every: int) -> None:
    """Every n-th recording, joined into one long recording."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, np.concatenate([pcm for _, pcm in subset(corpus, every)]))
