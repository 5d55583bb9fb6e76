"""Spectral shape, pitch, tuning, chroma and onsets against librosa on inputs made here."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any

import corsmal_feat
import numpy as np
import pytest

librosa = pytest.importorskip("librosa", reason="librosa is absent", exc_type=ImportError)

SHAPES = ("centroid", "bandwidth", "rolloff", "flatness", "contrast")
# Share of frames whose roll-off may be one bin off, as librosa's own between its precisions.
ROLLOFF_FLIPS = 0.01


def signals() -> dict[str, Any]:
    """Signals by name, all lengths and kinds that trip an implementation."""
    rng = np.random.default_rng(7)
    t = np.arange(9000) / 22050
    clicks = np.zeros(6000)
    clicks[[0, 1700, 5999]] = 1.0
    made = {
        "one sample": np.array([0.3]),
        "two samples": np.array([0.3, -0.2]),
        "short": rng.normal(size=701),
        "noise": 0.1 * rng.normal(size=9001),
        "silence": np.zeros(5000),
        "dc": np.full(5000, 0.5),
        "clicks": clicks,
        "full scale": np.where(np.arange(7000) // 50 % 2, 1.0, -1.0),
        "tones": 0.4 * np.sin(2 * np.pi * 440 * t) + 0.2 * np.sin(2 * np.pi * 1330 * t),
        "quiet": 1e-6 * rng.normal(size=6000),
        "stereo": rng.normal(size=(2, 4000)) * [[1.0], [0.01]],
        "nested": rng.normal(size=(2, 3, 2500)),
    }
    return {name: y.astype(np.float32) for name, y in made.items()}


SIGNALS = signals()
FRAMINGS: tuple[dict[str, Any], ...] = (
    {},
    {"n_fft": 1024, "hop_length": 300, "pad_mode": "reflect"},
    {"n_fft": 1001, "hop_length": 250, "pad_mode": "edge"},
    {"n_fft": 600, "hop_length": 150, "win_length": 401, "window": "hamming", "center": False},
)


def both(name: str, *args: Any, **kwargs: Any) -> tuple[Any, Any]:
    """Our and librosa's result of a function; both refuse or neither does."""
    results = []
    for module in (corsmal_feat, librosa):
        function: Any = module
        for part in name.split("."):
            function = getattr(function, part)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                results.append(function(*args, **kwargs))
            except Exception as error:
                results.append(error)
    ours, theirs = results
    assert isinstance(ours, Exception) == isinstance(theirs, Exception), (ours, theirs)
    if isinstance(ours, Exception):
        assert isinstance(ours, corsmal_feat.ParameterError), repr(ours)
        pytest.skip(f"both refuse: {ours}")
    return ours, theirs


def agree(ours: Any, theirs: Any, scale: float, flips: float = 0.0, least: float = 1e-30) -> None:
    """Same shape and dtype, and values within `scale` of the largest (which counts as `least` at
    least), but for a share of `flips`."""
    ours, theirs = np.asarray(ours), np.asarray(theirs)
    assert ours.shape == theirs.shape
    assert ours.dtype == theirs.dtype
    if theirs.size == 0:
        return
    size = max(float(np.max(np.abs(theirs[np.isfinite(theirs)]), initial=0.0)), least)
    off = ~np.isclose(ours, theirs, rtol=0, atol=scale * size, equal_nan=True)
    assert off.sum() <= np.ceil(flips * off.size), (
        f"{off.sum()} of {off.size} off, worst {np.nanmax(np.abs(ours - theirs)) / size:.2g}"
    )


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("framing", range(len(FRAMINGS)))
@pytest.mark.parametrize("signal", SIGNALS)
@pytest.mark.parametrize("feature", SHAPES)
def test_shape_of_spectrum(feature: str, signal: str, framing: int, dtype: Any) -> None:
    y, options = SIGNALS[signal].astype(dtype), dict(FRAMINGS[framing])
    if feature != "flatness":
        options["sr"] = 44100
    ours, theirs = both(f"feature.spectral_{feature}", y=y, **options)
    scale = 3e-5 if dtype == np.float32 else 1e-7
    flips = ROLLOFF_FLIPS if feature == "rolloff" else 0.0
    # The contrast of the flat spectrum of a click is rounding noise: dB, not dB of that.
    agree(ours, theirs, scale, flips, least=1.0 if feature == "contrast" else 1e-30)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("order", [0, 1, 2, 4])
@pytest.mark.parametrize("signal", ["one sample", "noise", "silence", "clicks", "nested"])
def test_polynomials(signal: str, order: int, dtype: Any) -> None:
    y = SIGNALS[signal].astype(dtype)
    ours, theirs = both("feature.poly_features", y=y, sr=16000, n_fft=512, order=order)
    # What each term contributes at the Nyquist frequency.
    terms = 8000.0 ** np.arange(order, -1, -1)[:, np.newaxis]
    agree(ours * terms, theirs * terms, 2e-6 if dtype == np.float32 else 1e-12)


@pytest.mark.parametrize(
    ("feature", "options"),
    [
        ("feature.spectral_bandwidth", {"p": 3.0}),
        ("feature.spectral_bandwidth", {"p": 1, "norm": False}),
        ("feature.spectral_bandwidth", {"centroid": np.full((1, 7), 900.0)}),
        ("feature.spectral_rolloff", {"roll_percent": 0.01}),
        ("feature.spectral_rolloff", {"roll_percent": 1.0}),
        ("feature.spectral_flatness", {"power": 1.5, "amin": 1e-4}),
        ("feature.spectral_flatness", {"amin": 0.0}),
        ("feature.spectral_contrast", {"linear": True, "quantile": 0.5}),
        ("feature.spectral_contrast", {"quantile": 0.99, "n_bands": 2, "fmin": 31.0}),
        ("feature.spectral_contrast", {"n_bands": 8}),
        ("feature.spectral_contrast", {"fmin": 30.0, "n_bands": 3}),
        ("feature.spectral_centroid", {"freq": np.linspace(9e3, 0.0, 129)}),
        ("feature.spectral_rolloff", {"freq": np.linspace(9e3, 0.0, 129)}),
        ("feature.spectral_contrast", {"freq": np.geomspace(40.0, 11e3, 129)}),
        ("feature.chroma_stft", {"norm": 1, "n_chroma": 24, "octwidth": None}),
        ("feature.chroma_stft", {"tuning": 0.2, "norm": None, "base_c": False}),
        ("feature.chroma_stft", {"tuning": 0.2, "norm": 0, "ctroct": 3.0}),
        ("feature.chroma_stft", {"norm": -2.0}),
    ],
)
def test_parameters_on_a_spectrogram(feature: str, options: dict[str, Any]) -> None:
    S = np.abs(np.random.default_rng(3).normal(size=(2, 129, 7)).astype(np.float32))
    if "freq" in options and options["freq"].ndim == 1 and "centroid" in feature:
        per_frame = options["freq"][:, None] * np.linspace(1, 2, 7)
        agree(*both(feature, S=S, freq=per_frame), 1e-6)
    agree(*both(feature, S=S, **options), 3e-6)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"fmin": 0.0, "fmax": 1e6, "threshold": 0.0},
        {"fmin": 400.0, "fmax": 500.0, "n_fft": 801},
        {"ref": np.mean, "threshold": 1.0},
        {"ref": 0.5},
    ],
)
@pytest.mark.parametrize("signal", ["short", "noise", "silence", "tones", "nested"])
def test_pitches(signal: str, options: dict[str, Any], dtype: Any) -> None:
    y = SIGNALS[signal].astype(dtype)
    ours, theirs = both("piptrack", y=y, **options)
    flips = 1e-3 if dtype == np.float32 else 0.0
    for a, b in zip(ours, theirs, strict=True):
        agree(a, b, 1e-5, flips)


@pytest.mark.parametrize("bins_per_octave", [12, 36])
@pytest.mark.parametrize("signal", ["noise", "silence", "tones", "stereo", "nested"])
def test_tuning(signal: str, bins_per_octave: int) -> None:
    # The tuning is not continuous in S: one spectrogram for both.
    S = np.abs(librosa.stft(SIGNALS[signal], n_fft=1024))
    for power in (S, S**2):
        ours, theirs = both("estimate_tuning", S=power, bins_per_octave=bins_per_octave)
        assert ours == theirs


def test_tuning_of_frequencies() -> None:
    rng = np.random.default_rng(5)
    for resolution in (0.01, 0.003, 0.07, 1.0):
        for count in (1, 30, 3000):
            for dtype in (np.float32, np.float64):
                f = rng.uniform(20.0, 8000.0, count).astype(dtype)
                ours, theirs = both("pitch_tuning", f, resolution=resolution)
                assert ours == theirs, (resolution, count, dtype)
    assert corsmal_feat.pitch_tuning([440, 880]) == librosa.pitch_tuning([440, 880])


@pytest.mark.parametrize("signal", ["short", "noise", "silence", "tones", "stereo", "nested"])
@pytest.mark.parametrize("tuning", [None, 0.0])
def test_chroma(signal: str, tuning: float | None) -> None:
    S = np.abs(librosa.stft(SIGNALS[signal], n_fft=512)) ** 2
    agree(*both("feature.chroma_stft", S=S, tuning=tuning), 1e-5)
    agree(*both("feature.chroma_stft", S=S.astype(np.float64), tuning=tuning), 1e-9)


@pytest.mark.parametrize("n_fft", [2, 3, 64, 1001, 2048])
@pytest.mark.parametrize("n_chroma", [1, 7, 12, 36])
def test_chroma_bank(n_fft: int, n_chroma: int) -> None:
    for options in ({}, {"octwidth": None, "norm": 1.0}, {"base_c": False, "norm": None}):
        options = {"n_fft": n_fft, "n_chroma": n_chroma, "tuning": -0.3, **options}
        for dtype in (np.float32, np.float64):
            agree(*both("filters.chroma", sr=22050, dtype=dtype, **options), 1e-7)


ONSET_OPTIONS: tuple[dict[str, Any], ...] = (
    {},
    {"lag": 3, "max_size": 4},
    {"max_size": 500, "center": False},
    {"lag": 40, "center": False},
    {"detrend": True, "n_fft": 1024, "hop_length": 256},
    {"aggregate": np.median, "lag": 2},
    {"n_mels": 40, "fmax": 8000},
    {"lag": 0},
)


@pytest.mark.parametrize("options", ONSET_OPTIONS, ids=str)
@pytest.mark.parametrize("signal", SIGNALS)
def test_onset_strength(signal: str, options: dict[str, Any]) -> None:
    agree(*both("onset.onset_strength", y=SIGNALS[signal], **options), 5e-5)
    if "n_mels" not in options:
        S = np.random.default_rng(2).normal(size=(2, 20, 9))
        agree(*both("onset.onset_strength", S=S, **options), 1e-9)
        agree(*both("onset.onset_strength", S=S, ref=S / 2, **options), 1e-9)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"units": "samples", "hop_length": 256, "sr": 44100},
        {"units": "time", "delta": 0.0},
        {"normalize": False, "wait": 4.5, "pre_avg": 3, "post_avg": 2.2},
        {"pre_max": 0, "post_max": 3, "delta": 0.3},
        {"backtrack": True},
        {"post_max": 0},
        {"wait": -1},
    ],
    ids=str,
)
def test_onset_detection(options: dict[str, Any], dtype: Any) -> None:
    rng = np.random.default_rng(11)
    for n in (1, 2, 30, 400):
        envelope = (rng.gamma(1.0, size=n) ** 2).astype(dtype)
        if n < 30 and options.keys() & {"backtrack", "wait"}:
            continue  # librosa checks neither where there is no onset
        ours, theirs = both("onset.onset_detect", onset_envelope=envelope, **options)
        assert np.array_equal(ours, theirs), n
        assert ours.dtype == theirs.dtype
    if not options.get("backtrack"):
        envelopes = rng.gamma(1.0, size=(2, 3, 50)).astype(dtype)
        ours, theirs = both("onset.onset_detect", onset_envelope=envelopes, sparse=False, **options)
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(0,), (2, 0), (1,), (50,), (1, 50), (7, 50), (2, 3, 50)])
def test_mono(shape: tuple[int, ...], dtype: Any) -> None:
    y = np.random.default_rng(1).normal(size=shape).astype(dtype)
    ours, theirs = both("to_mono", y)
    assert ours.dtype == theirs.dtype
    agree(ours, theirs, 2e-7)


def test_onsets_of_a_recording() -> None:
    shared = Path(os.environ.get("CORSMAL_SHARED", "../shared"))
    reference = shared / "data/ccm/method_input_reference.npz"
    if not reference.is_file():
        pytest.skip(f"skipped: {reference} absent")
    with np.load(reference) as data:
        y, want = data["m6_wav_22k_kaiser_fast"], data["m6_onsets"]
    ours, theirs = both("onset.onset_detect", y=y, sr=22050, units="samples")
    assert np.array_equal(ours, theirs)
    assert np.array_equal(ours, want)


def test_whole_numbers_are_spectra_too():
    counts = np.random.default_rng(0).integers(0, 9, (1025, 3))
    for function in (
        corsmal_feat.feature.spectral_flatness,
        corsmal_feat.feature.spectral_centroid,
        corsmal_feat.feature.melspectrogram,
    ):
        np.testing.assert_array_equal(function(S=counts), function(S=counts.astype(np.float64)))
