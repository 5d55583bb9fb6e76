"""Transforms, mel, cepstra, decibels, levels and resampling against librosa: random parameters."""

from __future__ import annotations

from typing import Any

import corsmal_feat
import numpy as np
import pytest
from test_spectral_vs_librosa import SIGNALS, agree, both

N_FFTS = (2048, 1024, 512, 400, 257, 64, 31, 16, 2)
WINDOWS = ("hann", "hamming", "blackman", "boxcar", ("kaiser", 6.0))


def drawn(seed: int) -> tuple[Any, dict[str, Any], Any]:
    """A signal, a framing and a generator for more."""
    rng = np.random.default_rng(seed)
    y = SIGNALS[rng.choice(list(SIGNALS))].astype(rng.choice([np.float32, np.float64]))
    n_fft = int(rng.choice(N_FFTS))
    options = {
        "n_fft": n_fft,
        "hop_length": int(rng.integers(max(1, n_fft // 8), n_fft)),
        "win_length": int(rng.integers(max(1, n_fft // 2), n_fft + 1)),
        "window": WINDOWS[rng.integers(len(WINDOWS))],
        "center": bool(rng.random() < 0.7),
        "pad_mode": str(rng.choice(["constant", "edge", "symmetric"])),
    }
    return y, options, rng


def scale(y: Any, single: float, double: float = 1e-9) -> float:
    return single if y.dtype == np.float32 else double


SEEDS = pytest.mark.parametrize("seed", range(40))


@SEEDS
def test_stft(seed: int) -> None:
    y, options, _ = drawn(seed)
    agree(*both("stft", y, **options), scale(y, 1e-6, 1e-12))


@SEEDS
def test_melspectrogram(seed: int) -> None:
    y, options, rng = drawn(1000 + seed)
    options |= {
        "sr": float(rng.choice([8000, 22050, 44100])),
        "n_mels": int(rng.integers(1, 60)),
        "power": float(rng.choice([1.0, 2.0, 1.5])),
        "htk": bool(rng.random() < 0.5),
        "norm": (None, "slaney", 1, np.inf)[rng.integers(4)],
        "fmin": float(rng.choice([0.0, 120.0])),
    }
    agree(*both("feature.melspectrogram", y=y, **options), scale(y, 2e-6))


@SEEDS
def test_mfcc(seed: int) -> None:
    y, options, rng = drawn(2000 + seed)
    options |= {
        "n_mels": int(rng.integers(20, 50)),
        "n_mfcc": int(rng.integers(1, 20)),
        "dct_type": int(rng.integers(1, 4)),
        "norm": ("ortho", None)[rng.integers(2)],
        "lifter": float(rng.choice([0, 22])),
    }
    if options["n_fft"] < 256:
        options["n_fft"], options["win_length"] = 512, 400
    agree(*both("feature.mfcc", y=y, **options), scale(y, 3e-5, 1e-8))


@SEEDS
def test_time_domain(seed: int) -> None:
    y, options, rng = drawn(3000 + seed)
    framing = {
        "frame_length": options["n_fft"],
        "hop_length": options["hop_length"],
        "center": options["center"],
    }
    crossings = {
        "pad": bool(rng.random() < 0.5),
        "zero_pos": bool(rng.random() < 0.5),
        "threshold": float(rng.choice([1e-10, 0.0, 0.05])),
    }
    level = both("feature.rms", y=y, pad_mode=options["pad_mode"], **framing)
    agree(*level, 1e-6)
    agree(*both("feature.zero_crossing_rate", y, **framing, **crossings), 1e-12)


@SEEDS
def test_decibels(seed: int) -> None:
    rng = np.random.default_rng(4000 + seed)
    s = rng.exponential(size=rng.integers(1, 90, 3)) ** 6
    s = s.astype(rng.choice([np.float32, np.float64]))
    options = {
        "ref": (1.0, 0.0, -3.0, np.max, np.median)[rng.integers(5)],
        "amin": float(10.0 ** rng.integers(-12, 0)),
        "top_db": (None, 0.0, 35.5, 80.0)[rng.integers(4)],
    }
    for name in ("power_to_db", "amplitude_to_db"):
        agree(*both(name, s, **options), scale(s, 1e-6, 1e-13))


@SEEDS
def test_delta(seed: int) -> None:
    rng = np.random.default_rng(5000 + seed)
    data = rng.normal(size=(2, 5, 31)).astype(rng.choice([np.float32, np.float64]))
    options = {
        "width": int(rng.choice([3, 5, 9, 31])),
        "order": int(rng.integers(1, 3)),
        "axis": int(rng.integers(-1, 3)),
        "mode": str(rng.choice(["interp", "nearest", "mirror", "constant", "wrap"])),
    }
    # Derivatives of numbers around 1: those along an axis of two cancel to rounding noise.
    agree(*both("feature.delta", data, **options), scale(data, 3e-6, 1e-10), least=1.0)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("more", [{"cval": 3.5, "mode": "constant"}, {"delta": 0.02}, {"deriv": 1}])
def test_delta_passes_on_what_the_filter_takes(order: int, more: dict[str, Any]) -> None:
    data = np.random.default_rng(order).standard_normal((3, 40))
    ours, theirs = both("feature.delta", data, order=order, **more)
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)
    with pytest.raises(corsmal_feat.ParameterError, match="does not take 'polyorders'"):
        corsmal_feat.feature.delta(data, polyorders=3)


def test_foreign_byte_order_gives_the_same_numbers() -> None:
    y = np.random.default_rng(1).standard_normal(5000)
    for kind in ("f4", "f8"):
        native, foreign = y.astype(kind), y.astype(">" + kind)
        assert np.array_equal(corsmal_feat.stft(foreign), corsmal_feat.stft(native))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_types_of_results(dtype: Any) -> None:
    y = np.random.default_rng(1).standard_normal(5000).astype(np.float32)
    for name in ("feature.rms", "feature.melspectrogram", "feature.mfcc"):
        ours, theirs = both(name, y=y, dtype=dtype)
        assert ours.dtype == theirs.dtype, name
        np.testing.assert_allclose(ours, theirs, rtol=2e-5, atol=2e-4)
    with pytest.raises(corsmal_feat.ParameterError, match="float32 or float64"):
        corsmal_feat.feature.rms(y=y, dtype=np.int16)


@pytest.mark.parametrize("rates", [(44100, 22050), (22050, 44100), (48000, 16000), (8000, 8000)])
@pytest.mark.parametrize("signal", ["one sample", "short", "noise", "silence", "stereo", "nested"])
def test_resample(signal: str, rates: tuple[int, int]) -> None:
    y = SIGNALS[signal]
    scaled = signal == "noise"
    results = both("resample", y, orig_sr=rates[0], target_sr=rates[1], scale=scaled)
    agree(*results, 1e-5)


def layouts(y: Any) -> dict[str, Any]:
    """The same values [shape=(2, n)] in other arrangements of memory."""
    wide = np.zeros((2, 2 * y.shape[1]), y.dtype)
    wide[:, ::2] = y
    locked = y.copy()
    locked.flags.writeable = False
    return {
        "interleaved": np.ascontiguousarray(y.T).T,
        "every other sample": wide[:, ::2],
        "reversed twice": np.ascontiguousarray(y[:, ::-1])[:, ::-1],
        "read-only": locked,
        "a list": y.tolist() if y.dtype == np.float64 else locked,
    }


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_layouts_of_memory_do_not_matter(dtype: Any) -> None:
    y = np.random.default_rng(1).normal(size=(2, 5000)).astype(dtype)
    functions = (
        corsmal_feat.stft,
        corsmal_feat.feature.zero_crossing_rate,
        *(
            lambda y, name=name: getattr(corsmal_feat.feature, name)(y=y)
            for name in ("melspectrogram", "mfcc", "rms", "spectral_contrast", "spectral_centroid")
        ),
    )
    for function in functions:
        want = function(y)
        for layout, other in layouts(y).items():
            np.testing.assert_array_equal(function(other), want, err_msg=layout)


def test_channels_are_independent_and_leading_axes_are_kept() -> None:
    y = np.random.default_rng(2).normal(size=(2, 3, 4000)).astype(np.float32)
    for function in (
        corsmal_feat.stft,
        lambda y: corsmal_feat.feature.melspectrogram(y=y),
        lambda y: corsmal_feat.feature.spectral_bandwidth(y=y),
        lambda y: corsmal_feat.feature.rms(y=y),
    ):
        together = function(y)
        assert together.shape[:2] == (2, 3)
        np.testing.assert_array_equal(together[1, 2], function(y[1, 2]))


@pytest.mark.filterwarnings("ignore:n_fft=")
@pytest.mark.parametrize(
    ("y", "message"),
    [
        (np.zeros(3000, np.int16), r"divide int16 samples by 2\*\*15"),
        (np.zeros(3000, np.float16), "cast it first"),
        (np.zeros(3000, complex), "dtype complex128"),
        (np.full(3000, np.nan), "NaN or infinite"),
        (np.full((2, 3000), np.inf, np.float32)[:, ::2], "NaN or infinite"),
        (np.zeros(0, np.float32), "y has 0"),
        (np.float32(1.0), "0 dimensions"),
        (None, "dtype object|must be given"),
    ],
)
def test_what_is_no_signal_is_refused(y: Any, message: str) -> None:
    for function in (
        corsmal_feat.stft,
        lambda y: corsmal_feat.feature.mfcc(y=y),
        lambda y: corsmal_feat.feature.rms(y=y),
        lambda y: corsmal_feat.feature.spectral_flatness(y=y),
    ):
        with pytest.raises(corsmal_feat.ParameterError, match=message):
            function(y)


@pytest.mark.filterwarnings("ignore:n_fft=")
def test_other_framings_are_refused_by_name() -> None:
    y = np.zeros(5000, np.float32)
    for options, name in (
        ({"n_fft": 0}, r"n_fft must be .*, not 0"),
        ({"hop_length": 0}, r"hop_length must be .*, not 0"),
        ({"win_length": 4096}, r"win_length must be .*, not 4096"),
        ({"pad_mode": "wrap"}, r"pad_mode must be .*, not wrap"),
        ({"window": "hanm"}, "hanm"),
        ({"n_fft": 8192, "center": False}, "y has 5000"),
    ):
        with pytest.raises(corsmal_feat.ParameterError, match=name):
            corsmal_feat.stft(y, **options)


@pytest.mark.parametrize(
    "call",
    [
        lambda y: corsmal_feat.stft(y, n_fft="x"),
        lambda y: corsmal_feat.stft(y, hop_length=100.5),
        lambda y: corsmal_feat.feature.mfcc(y=y, sr="44100"),
        lambda y: corsmal_feat.feature.melspectrogram(y=y, n_mels=3.5),
        lambda y: corsmal_feat.feature.spectral_rolloff(y=y, roll_percent="x"),
        lambda y: corsmal_feat.feature.chroma_stft(y=y, tuning="x"),
        lambda y: corsmal_feat.feature.delta(y, width="a"),
        lambda y: corsmal_feat.pcen(np.ones((4, 5)), gain="x"),
        lambda y: corsmal_feat.pcen(np.ones((4, 5)), max_size=1.5),
        lambda y: corsmal_feat.cqt(y, fmin="C1"),
        lambda y: corsmal_feat.resample(y, orig_sr="a", target_sr=3),
        lambda y: corsmal_feat.onset.onset_detect(y=y, sr=None),
        lambda y: corsmal_feat.effects.hpss(y, kernel_size="a"),
        lambda y: corsmal_feat.power_to_db(np.ones(3), top_db="x"),
        lambda y: corsmal_feat.frames_to_time([1, 2], sr=None),
        lambda y: corsmal_feat.yin(y, fmin="a", fmax=900),
        lambda y: corsmal_feat.filters.mel(sr=None, n_fft=512),
    ],
)
def test_what_is_no_number_is_refused_by_name(call: Any) -> None:
    with pytest.raises(corsmal_feat.ParameterError, match=r"must be (a|an|one)"):
        call(np.zeros(5000, np.float32))
