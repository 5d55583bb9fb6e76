"""Calls whose results are kept from librosa 0.11 and compared with ours.

`python python/tests/librosa_cases.py` (with librosa 0.11.0 installed) makes `librosa_goldens.npz`
again. A case is a function of the module, librosa or corsmal_feat; where librosa refuses, the
golden value is the text "refused".
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

GOLDENS = Path(__file__).with_name("librosa_goldens.npz")

_rng = np.random.default_rng(11)
NOISE = _rng.standard_normal(1500)
SINGLE = NOISE.astype(np.float32)
SEVERAL = _rng.standard_normal((2, 3, 1200)).astype(np.float32)
TONE = np.sin(2 * np.pi * 220.5 * np.arange(8192) / 11025)
SWEEP = np.sin(2 * np.pi * np.cumsum(np.linspace(100, 900, 12000)) / 11025)
BURSTS = np.concatenate([np.zeros(3000), TONE[:4000], 1e-5 * np.tile(NOISE, 2), TONE[:2500]])
CHROMA = np.abs(_rng.standard_normal((2, 36, 30)))
MATRIX = _rng.standard_normal((4, 7, 5))
MATRIX[:, :, 2] = 0
HZ = np.array([0.0, 20.0, 27.5, 100.0, 999.9, 1000.0, 1000.1, 4000.0, 22050.0])
COMPLEX = _rng.standard_normal((5, 4)) + 1j * _rng.standard_normal((5, 4))
COMPLEX[1, 2] = 0

Case = Callable[[Any], Any]

_NAMES = (
    "barthann bartlett blackman blackmanharris bohman boxcar cosine exponential flattop hamming "
    "hann lanczos nuttall parzen taylor triang tukey bth brt blk bkh bmn box rect "
    "poisson flt ham han sinc nut par tri tuk"
)
WINDOWS: dict[str, Any] = {name: name for name in _NAMES.split()}
WINDOWS |= {
    "float": 8.6,
    "zero": 0,
    "kaiser": ("kaiser", 14.0),
    "gaussian": ("gaussian", 20.0),
    "general_gaussian": ("general_gaussian", 1.5, 9.0),
    "general_hamming": ("general_hamming", 0.7),
    "general_cosine": ("general_cosine", [0.4, 0.35, 0.25]),
    "tukey_0.3": ("tukey", 0.3),
    "tukey_0": ("tukey", 0.0),
    "exponential_tau": ("exponential", None, 3.0),
    "chebwin": ("chebwin", 80),
    "taylor_5": ("taylor", 5, 40),
    "taylor_plain": ("taylor", 4, 30, False),
    "dpss": ("dpss", 2.5),
    "function": np.hanning,
}


def windows() -> dict[str, Case]:
    cases: dict[str, Case] = {}
    for name, window in WINDOWS.items():
        for n in (1, 2, 9, 64):
            for periodic in (True, False):
                key = f"get_window {name} {n} {periodic}"
                cases[key] = lambda L, w=window, n=n, p=periodic: L.filters.get_window(
                    w, n, fftbins=p
                )
    kbd = ("kaiser_bessel_derived", 4.0)
    cases["get_window kbd"] = lambda L: L.filters.get_window(kbd, 16, fftbins=False)
    cases["get_window kbd periodic"] = lambda L: L.filters.get_window(kbd, 16)
    cases["get_window values"] = lambda L: L.filters.get_window(NOISE[:9], 9)
    cases["get_window other length"] = lambda L: L.filters.get_window(NOISE[:9], 8)
    for name in ("tukey_0.3", "gaussian", "float", "parzen", "function"):
        window = WINDOWS[name]
        cases[f"stft {name}"] = lambda L, w=window: np.abs(
            L.stft(NOISE, n_fft=256, win_length=150, window=w)
        )
        cases[f"istft {name}"] = lambda L, w=window: L.istft(
            L.stft(NOISE, n_fft=256, window=w), n_fft=256, window=w, length=1500
        )
    cases["stft values"] = lambda L: np.abs(L.stft(NOISE, n_fft=64, window=np.hamming(64)))
    cases["stft wrong values"] = lambda L: L.stft(NOISE, n_fft=64, window=np.hamming(63))
    return cases


def conversions() -> dict[str, Case]:
    cases: dict[str, Case] = {}
    for name, values in {"number": 7, "list": [0, 1, 10], "empty": np.zeros(0, int)}.items():
        for n_fft in (None, 2048, 333):
            end = f"{name} {n_fft}"
            cases |= {
                f"frames_to_samples {end}": lambda L, v=values, n=n_fft: L.frames_to_samples(
                    v, hop_length=160, n_fft=n
                ),
                f"samples_to_frames {end}": lambda L, v=values, n=n_fft: L.samples_to_frames(
                    np.asarray(v) * 999, hop_length=160, n_fft=n
                ),
                f"frames_to_time {end}": lambda L, v=values, n=n_fft: L.frames_to_time(
                    v, sr=44100, n_fft=n
                ),
                f"time_to_frames {end}": lambda L, v=values, n=n_fft: L.time_to_frames(
                    np.asarray(v) * 0.1, sr=44100, n_fft=n
                ),
            }
        cases |= {
            f"time_to_samples {name}": lambda L, v=values: L.time_to_samples(np.asarray(v) * 0.3),
            f"samples_to_time {name}": lambda L, v=values: L.samples_to_time(v, sr=16000),
            f"blocks_to_frames {name}": lambda L, v=values: L.blocks_to_frames(v, block_length=9),
            f"blocks_to_samples {name}": lambda L, v=values: L.blocks_to_samples(
                v, block_length=9, hop_length=77
            ),
            f"blocks_to_time {name}": lambda L, v=values: L.blocks_to_time(
                v, block_length=9, hop_length=77, sr=8000
            ),
        }
    cases |= {
        "times_like array": lambda L: L.times_like(MATRIX, sr=8000, hop_length=80),
        "times_like count": lambda L: L.times_like(6, n_fft=512),
        "samples_like axis": lambda L: L.samples_like(MATRIX, axis=1),
        "mel_frequencies": lambda L: L.mel_frequencies(40, fmin=20, fmax=8000),
        "mel_frequencies htk": lambda L: L.mel_frequencies(13, htk=True),
        "fft_frequencies odd": lambda L: L.fft_frequencies(sr=8000, n_fft=333),
        "cqt_frequencies": lambda L: L.cqt_frequencies(30, fmin=32.7, tuning=0.2),
        "tempo_frequencies": lambda L: L.tempo_frequencies(20, hop_length=441, sr=44100)[1:],
        "fourier_tempo_frequencies": lambda L: L.fourier_tempo_frequencies(win_length=100),
        "hz_to_octs": lambda L: L.hz_to_octs(HZ[1:], tuning=0.3, bins_per_octave=36),
        "octs_to_hz": lambda L: L.octs_to_hz([-1.0, 0.0, 4.5], tuning=-0.2),
        "A4_to_tuning": lambda L: L.A4_to_tuning([430.0, 440.0, 445.0], bins_per_octave=36),
        "tuning_to_A4": lambda L: L.tuning_to_A4(0.25),
        "note_to_midi": lambda L: L.note_to_midi(
            ["C", "C#3", "f4", "Bb-1", "A!8", "D♯2+40", "G𝄪3"]
        ),
        "note_to_midi cents": lambda L: L.note_to_midi("A4-32", round_midi=False),
        "note_to_midi bad": lambda L: L.note_to_midi("does not pass"),
        "note_to_hz": lambda L: L.note_to_hz(["C3", "A4"]),
        "hz_to_midi": lambda L: L.hz_to_midi(HZ[1:]),
        "midi_to_hz": lambda L: L.midi_to_hz([-5, 0, 69.5, 127]),
    }
    for htk in (False, True):
        cases[f"hz_to_mel {htk}"] = lambda L, h=htk: L.hz_to_mel(HZ, htk=h)
        cases[f"mel_to_hz {htk}"] = lambda L, h=htk: L.mel_to_hz(np.linspace(0, 50, 21), htk=h)
        for hz in (0.0, 999.9, 1000.0, 5000.0):
            cases[f"hz_to_mel {htk} {hz}"] = lambda L, h=htk, f=hz: L.hz_to_mel(f, htk=h)
    for kind in "ABCDZ":
        for low in (None, -80.0, -20.0):
            cases[f"weighting {kind} {low}"] = lambda L, k=kind, m=low: L.frequency_weighting(
                HZ[1:], kind=k, min_db=m
            )
    cases |= {
        "A_weighting zero": lambda L: L.A_weighting(HZ),
        "multi_frequency_weighting": lambda L: L.multi_frequency_weighting(HZ[1:], kinds="ABCD"),
        "perceptual_weighting": lambda L: L.perceptual_weighting(
            np.abs(MATRIX[0]), HZ[1:8], kind="C", ref=2.0
        ),
        "db_to_power": lambda L: L.db_to_power(MATRIX, ref=3.0),
        "db_to_amplitude": lambda L: L.db_to_amplitude(MATRIX, ref=3.0),
        "magphase": lambda L: L.magphase(COMPLEX, power=2),
        "magphase single": lambda L: L.magphase(COMPLEX.astype(np.complex64)),
        "get_duration y": lambda L: L.get_duration(y=SEVERAL, sr=8000),
        "get_duration S": lambda L: L.get_duration(S=MATRIX, sr=8000, n_fft=100, hop_length=25),
        "get_duration plain": lambda L: L.get_duration(S=MATRIX, sr=8000, center=False),
        "get_duration none": lambda L: L.get_duration(),
    }
    return cases


def utilities() -> dict[str, Case]:
    cases: dict[str, Case] = {
        "frame": lambda L: L.util.frame(NOISE[:50], frame_length=10, hop_length=7),
        "frame first axis": lambda L: L.util.frame(MATRIX, frame_length=2, hop_length=1, axis=0),
        "frame middle": lambda L: L.util.frame(MATRIX, frame_length=3, hop_length=2, axis=1),
        "frame negative": lambda L: L.util.frame(MATRIX, frame_length=3, hop_length=2, axis=-2),
        "frame short": lambda L: L.util.frame(NOISE[:5], frame_length=10, hop_length=7),
        "frame hop": lambda L: L.util.frame(NOISE[:50], frame_length=10, hop_length=0),
        "fix_length more": lambda L: L.util.fix_length(MATRIX, size=9),
        "fix_length less": lambda L: L.util.fix_length(MATRIX, size=2, axis=1),
        "fix_length edge": lambda L: L.util.fix_length(MATRIX, size=9, mode="edge"),
        "pad_center": lambda L: L.util.pad_center(MATRIX, size=8, axis=0),
        "pad_center less": lambda L: L.util.pad_center(MATRIX, size=3),
        "fix_frames": lambda L: L.util.fix_frames([5, 3, 3, 99], x_min=4, x_max=50),
        "fix_frames open": lambda L: L.util.fix_frames([5, 3], x_min=None, x_max=4, pad=False),
        "fix_frames negative": lambda L: L.util.fix_frames([-1, 3]),
        "tiny": lambda L: [L.util.tiny(np.float32(1)), L.util.tiny(1), L.util.tiny(1j)],
        "stack_memory": lambda L: L.feature.stack_memory(MATRIX, n_steps=3, delay=2),
        "stack_memory ahead": lambda L: L.feature.stack_memory(MATRIX, n_steps=2, delay=-3),
        "stack_memory edge": lambda L: L.feature.stack_memory(MATRIX, n_steps=4, mode="edge"),
        "stack_memory vector": lambda L: L.feature.stack_memory(NOISE[:9]),
        "stack_memory none": lambda L: L.feature.stack_memory(MATRIX, n_steps=0),
        "stack_memory still": lambda L: L.feature.stack_memory(MATRIX, delay=0),
        "preemphasis": lambda L: L.effects.preemphasis(NOISE),
        "preemphasis single": lambda L: L.effects.preemphasis(SEVERAL, coef=0.5),
        "preemphasis state": lambda L: L.effects.preemphasis(NOISE, zi=[0.3], return_zf=True),
        "trim": lambda L: L.effects.trim(BURSTS)[1],
        "trim all": lambda L: L.effects.trim(np.zeros(9000), ref=1.0),
        "trim top_db": lambda L: L.effects.trim(BURSTS, top_db=20, frame_length=512, hop_length=99)[
            1
        ],
        "trim ref": lambda L: L.effects.trim(BURSTS, ref=np.mean, top_db=10)[1],
        "trim channels": lambda L: L.effects.trim(np.stack([BURSTS, np.roll(BURSTS, 700)]))[1],
        "split": lambda L: L.effects.split(BURSTS, top_db=40, frame_length=512, hop_length=128),
        "split silent": lambda L: L.effects.split(np.zeros(9000), ref=1.0),
        "split loud": lambda L: L.effects.split(NOISE),
        "split channels": lambda L: L.effects.split(
            np.stack([BURSTS, 0.1 * BURSTS]), aggregate=np.min
        ),
        "yin": lambda L: L.yin(SWEEP, fmin=80, fmax=1000, sr=11025),
        "yin single": lambda L: L.yin(SEVERAL, fmin=100, fmax=4000, sr=11025, frame_length=1024),
        "yin plain": lambda L: L.yin(TONE, fmin=110, fmax=440, sr=11025, center=False),
        "yin reflect": lambda L: L.yin(
            TONE, fmin=110, fmax=440, sr=11025, hop_length=300, pad_mode="reflect"
        ),
        "yin threshold": lambda L: L.yin(
            NOISE, fmin=110, fmax=2000, sr=11025, trough_threshold=0.8
        ),
        "yin silence": lambda L: L.yin(np.zeros(4096), fmin=110, fmax=2000, sr=11025),
        "yin fmax": lambda L: L.yin(NOISE, fmin=110, fmax=9000, sr=11025),
        "yin order": lambda L: L.yin(NOISE, fmin=110, fmax=100, sr=11025),
        "yin long": lambda L: L.yin(NOISE, fmin=2, fmax=100, sr=11025),
        "chroma_cens C": lambda L: L.feature.chroma_cens(C=CHROMA, n_octaves=3, bins_per_octave=12),
        "chroma_cens short": lambda L: L.feature.chroma_cens(
            C=CHROMA, n_octaves=3, bins_per_octave=12, win_len_smooth=8, smoothing_window="hamming"
        ),
        "chroma_cens plain": lambda L: L.feature.chroma_cens(
            C=CHROMA, n_octaves=3, bins_per_octave=12, win_len_smooth=None, norm=np.inf
        ),
        "chroma_cens 0": lambda L: L.feature.chroma_cens(C=CHROMA, win_len_smooth=0),
    }
    for norm in (np.inf, -np.inf, 0, 1, 2, 0.5, None):
        for axis in (0, 1, -1, None):
            for fill in (None, False, True):
                key = f"normalize {norm} {axis} {fill}"
                cases[key] = lambda L, n=norm, a=axis, f=fill: L.util.normalize(
                    MATRIX, norm=n, axis=a, fill=f
                )
    cases |= {
        "normalize threshold": lambda L: L.util.normalize(MATRIX, threshold=2.0, fill=False),
        "normalize zero threshold": lambda L: L.util.normalize(MATRIX, threshold=0),
        "normalize nan": lambda L: L.util.normalize(np.array([1.0, np.nan])),
        "normalize text": lambda L: L.util.normalize(MATRIX, norm="inf"),
        "normalize integers": lambda L: L.util.normalize(np.arange(6).reshape(2, 3)),
    }
    return cases


def resampling() -> dict[str, Case]:
    cases: dict[str, Case] = {}
    rates = [(22050, 16000), (16000, 22050), (44100, 22050), (8000, 8001), (8000, 4000)]
    for kind in ("fft", "scipy", "polyphase"):
        for source, target in rates:
            if kind == "polyphase" and target == 8001:
                continue
            cases[f"resample {kind} {source} {target}"] = lambda L, k=kind, s=source, t=target: (
                L.resample(NOISE[:1001], orig_sr=s, target_sr=t, res_type=k)
            )
        cases[f"resample {kind} channels"] = lambda L, k=kind: L.resample(
            SEVERAL, orig_sr=3, target_sr=2, res_type=k, scale=True
        )
        cases[f"resample {kind} axis"] = lambda L, k=kind: L.resample(
            SEVERAL.T, orig_sr=2, target_sr=3, res_type=k, axis=0, fix=False
        )
    cases["resample polyphase fraction"] = lambda L: L.resample(
        NOISE, orig_sr=22050, target_sr=16000.5, res_type="polyphase"
    )
    return cases


def cases() -> dict[str, Case]:
    return windows() | conversions() | utilities() | resampling()


def values(case: Case, module: Any) -> list[np.ndarray] | str:
    """What a case gives, as a list of arrays, or "refused"."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            result = case(module)
    except (ValueError, module.ParameterError):
        return "refused"
    parts = result if isinstance(result, tuple) else (result,)
    return [np.asarray(part) for part in parts]


def save(found: dict[str, list[np.ndarray] | str]) -> None:
    """Writes the golden values: all bytes in one array, and where in it each value lies."""
    index: dict[str, Any] = {}
    data = b""
    for name, parts in found.items():
        if isinstance(parts, str):
            index[name] = parts
            continue
        index[name] = []
        for part in parts:
            index[name].append([part.dtype.str, part.shape, len(data)])
            data += part.tobytes()
    text = np.frombuffer(json.dumps(index).encode(), np.uint8)
    np.savez_compressed(GOLDENS, index=text, data=np.frombuffer(data, np.uint8))


def load() -> dict[str, list[np.ndarray] | str]:
    """The golden values by case."""
    with np.load(GOLDENS, allow_pickle=False) as archive:
        index, data = json.loads(archive["index"].tobytes()), archive["data"].tobytes()

    def array(kind: str, shape: list[int], offset: int) -> np.ndarray:
        return np.frombuffer(data, kind, int(np.prod(shape)), offset).reshape(shape)

    return {
        name: parts if isinstance(parts, str) else [array(*part) for part in parts]
        for name, parts in index.items()
    }


def main() -> None:
    import librosa

    assert librosa.__version__ == "0.11.0", librosa.__version__
    save({name: values(case, librosa) for name, case in cases().items()})
    print(len(cases()), "cases,", GOLDENS.stat().st_size, "bytes")


if __name__ == "__main__":
    main()
