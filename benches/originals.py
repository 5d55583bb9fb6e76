"""The computation behind each preset, in the packages that the original code used.

Rewritten from the descriptions of the methods, with librosa 0.11 and the conventions of the librosa
version that they ran on (reflected edges, resampy's kernels), so that the cost is the same. If a
method has only a paper, this follows its text in numpy and librosa. Values are compared with the
published ones elsewhere (docs/parity.md); here, they are only timed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

Compute = Callable[[str], Any]


def of(preset: str) -> Compute:
    """The function of a preset, from a path to an array."""
    import librosa
    import resampy
    import soundfile
    from skimage.transform import resize

    feature = librosa.feature

    def mono(path: str, rate: int, kernel: str) -> Any:
        return librosa.load(path, sr=rate, res_type=kernel)[0]

    def esc26(path: str) -> Any:
        y = mono(path, 22050, "kaiser_best")
        rows = feature.mfcc(y=y, sr=22050)[1:13], feature.zero_crossing_rate(y)
        return np.concatenate([f(row, axis=1) for row in rows for f in (np.mean, np.std)])

    def esc28(path: str) -> Any:
        y = mono(path, 22050, "kaiser_best")
        rows = feature.mfcc(y=y, sr=22050)[1:14], feature.zero_crossing_rate(y)
        return np.concatenate([f(row, axis=1) for row in rows for f in (np.mean, np.std)])

    def af193_rows(path: str) -> list[Any]:
        y, sr = soundfile.read(path, dtype="float32", always_2d=True)
        y = np.ascontiguousarray(y[:, 0])
        magnitude = np.abs(librosa.stft(y, pad_mode="reflect"))
        return [
            feature.mfcc(y=y, sr=sr, n_mfcc=40, pad_mode="reflect"),
            feature.chroma_stft(S=magnitude, sr=sr),
            feature.melspectrogram(y=y, sr=sr, pad_mode="reflect"),
            feature.spectral_contrast(S=magnitude, sr=sr),
            feature.tonnetz(y=librosa.effects.harmonic(y), sr=sr),
        ]

    def af193(path: str) -> Any:
        return np.concatenate([row.mean(axis=1) for row in af193_rows(path)])

    def af193_paper(path: str) -> Any:
        rows = af193_rows(path)
        return np.concatenate([f(row, axis=1) for row in rows for f in (np.mean, np.std)])

    def image(y: Any, n_fft: int, hop: int) -> Any:
        y = np.pad(y[:220_500], (0, max(0, 220_500 - len(y))))
        spectrum = librosa.stft(y, n_fft=n_fft, hop_length=hop, pad_mode="reflect")
        decibels = librosa.amplitude_to_db(np.abs(spectrum))
        return resize(decibels, (96, 96), anti_aliasing=True).ravel()

    def spec9216(path: str) -> Any:
        y = mono(path, 22050, "kaiser_best")
        return image(y / np.sqrt(np.mean(y**2)), 512, 128)

    def m1(path: str) -> Any:
        y, _ = librosa.load(path, sr=None)
        return np.abs(librosa.stft(y))

    def m2(path: str) -> Any:
        y = mono(path, 22050, "kaiser_fast")[: 30 * 22050]
        rows = feature.mfcc(y=y, sr=22050, n_mfcc=40, hop_length=441, pad_mode="reflect")
        rows = (rows - rows.mean(axis=1, keepdims=True)) / rows.std(axis=1, keepdims=True)
        return np.pad(rows, ((0, 0), (0, max(0, 1501 - rows.shape[1]))))[:, :1501].T

    def m3(path: str) -> Any:
        y = mono(path, 16600, "soxr_hq")[-32_000:]
        y = np.pad(y, (32_000 - len(y), 0))
        return np.abs(librosa.stft(y, n_fft=1124, hop_length=3087, center=False))

    def m4(path: str, paper: bool) -> Any:
        counts, sr = soundfile.read(path, dtype="int16", always_2d=True)
        length, step = round(0.025 * sr), round(0.01 * sr)
        n_fft = 1 << (length - 1).bit_length() if paper else 512
        frames = -(-abs(len(counts) - length) // step)
        top = 2595.0 * np.log10(1.0 + sr / 2.0 / 700.0)
        hertz = 700.0 * (10.0 ** (np.linspace(0.0, top, 66) / 2595.0) - 1.0)
        corners = np.floor((n_fft + 1) * hertz / sr).astype(int)
        bank = np.zeros((64, n_fft // 2 + 1))
        for band, (low, centre, high) in enumerate(
            zip(corners[:-2], corners[1:-1], corners[2:], strict=True)
        ):
            bank[band, low:centre] = (np.arange(low, centre) - low) / max(centre - low, 1)
            bank[band, centre:high] = (high - np.arange(centre, high)) / max(high - centre, 1)
        window = np.hamming(length)
        rows = np.arange(frames)[:, None] * step + np.arange(length)
        out = np.empty((frames, 64, counts.shape[1]))
        for channel in range(counts.shape[1]):
            signal = counts[:, channel].astype(float)
            signal = np.append(signal[0], signal[1:] - 0.97 * signal[:-1])
            signal = np.pad(signal, (0, max(0, frames * step + length - len(signal))))
            power = np.abs(np.fft.rfft(signal[rows] * window, n_fft)) ** 2 / n_fft
            energy = power @ bank.T
            energy[energy == 0.0] = np.finfo(float).eps
            out[:, :, channel] = (10.0 if paper else 20.0) * np.log10(energy)
        return out

    def vggish(path: str) -> Any:
        y, sr = soundfile.read(path, dtype="int16", always_2d=True)
        y = resampy.resample((y / 32768.0).mean(axis=1), sr, 16_000)
        frames = max(0, 1 + (len(y) - 400) // 160)
        rows = np.arange(frames)[:, None] * 160 + np.arange(400)
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi / 400 * np.arange(400))
        magnitude = np.abs(np.fft.rfft(y[rows] * window, 512))
        mel = 1127.0 * np.log1p(np.arange(257) * 16_000 / 512 / 700.0)
        edges = np.linspace(1127.0 * np.log1p(125 / 700), 1127.0 * np.log1p(7500 / 700), 66)
        rising = (mel[:, None] - edges[:-2]) / (edges[1:-1] - edges[:-2])
        falling = (edges[2:] - mel[:, None]) / (edges[2:] - edges[1:-1])
        bank = np.maximum(0.0, np.minimum(rising, falling))
        bank[0] = 0.0
        log_mel = np.log(magnitude @ bank + 0.01)
        patches = frames // 96
        return log_mel[: patches * 96].reshape(patches, 96, 64)

    def m6(path: str, onsets: bool) -> Any:
        y = mono(path, 22050, "kaiser_fast")
        y = y / max(np.abs(y).max(), np.finfo(np.float32).tiny)
        if onsets:
            found = librosa.onset.onset_detect(y=y, sr=22050, units="samples")
            y = y[found[1] :] if len(found) > 1 else y
        return image(y, 2048, 512)

    def logmel(path: str) -> Any:
        y, sr = librosa.load(path, sr=None, mono=False)
        return librosa.power_to_db(feature.melspectrogram(y=y, sr=sr))

    def mfcc_zcr(path: str) -> Any:
        y, sr = librosa.load(path, sr=None, mono=False)
        rows = np.concatenate([feature.mfcc(y=y, sr=sr), feature.zero_crossing_rate(y)], axis=-2)
        return np.concatenate([rows.mean(axis=-1), rows.std(axis=-1)], axis=-1)

    functions: dict[str, Compute] = {
        "logmel": logmel,
        "mfcc-zcr": mfcc_zcr,
        "esc26": esc26,
        "esc28": esc28,
        "af193": af193,
        "af193-paper": af193_paper,
        "spec9216-code": spec9216,
        "m1": m1,
        "m2": m2,
        "m3": m3,
        "m4-code": lambda path: m4(path, False),
        "m4-paper": lambda path: m4(path, True),
        "m5-vggish": vggish,
        "m6-code": lambda path: m6(path, True),
        "m6-paper": lambda path: m6(path, False),
    }
    return functions[preset]


#: in the order of the table; `a34f136` has pyAudioAnalysis itself as its original
PRESETS = [
    *("logmel", "mfcc-zcr", "esc26", "esc28", "af193", "af193-paper", "spec9216-code"),
    *("m1", "m2", "m3", "m4-code", "m4-paper", "a34f136", "m5-vggish", "m6-code", "m6-paper"),
]
