"""Separation, constant-Q features and AF193 against librosa, on inputs beyond the golden ones."""

import corsmal_feat as cf
import numpy as np
import pytest

librosa = pytest.importorskip("librosa")
pytestmark = pytest.mark.filterwarnings("ignore")


def pour(n, seed, sr=22050):
    """Noise with a rising resonance: every feature has something to find."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / sr
    tone = np.sin(2 * np.pi * np.cumsum(400 + 300 * t) / sr)
    return (0.3 * tone + 0.1 * rng.standard_normal(n)).astype(np.float32)


def close(got, want, relative=2e-6):
    """Equal shape and type, and values within `relative` of the largest."""
    got, want = np.asarray(got), np.asarray(want)
    assert got.shape == want.shape
    assert got.dtype == want.dtype
    error = np.abs(got.astype(complex) - want).max(initial=0)
    assert error <= relative * max(np.abs(want).max(initial=0), 1e-30)


def agree(ours, theirs, y, relative=2e-6):
    """`close` for an array and its double-precision copy. Where librosa's own single-precision
    result deviates (a division by hardly any window, say), four times that is granted."""
    double = theirs(y.astype(np.result_type(y, np.float64)))
    close(ours(y.astype(np.result_type(y, np.float64))), double, relative)
    want = theirs(y)
    scale = max(np.abs(want).max(initial=0), 1e-30)
    close(ours(y), want, relative + 4 * np.abs(want - double).max(initial=0) / scale)


SPECTROGRAMS = [
    ((1, 1), {}),
    ((3, 7), {}),
    ((65, 40), {"kernel_size": 31, "power": 1.0}),
    ((2, 40, 33), {"kernel_size": (5, 8), "margin": (2.0, 1.5)}),
    ((2, 2, 17, 50), {"kernel_size": [40, 3], "margin": 3.0, "power": 0.7}),
    ((30, 30), {"power": np.inf, "mask": True}),
    ((33, 64), {"mask": True}),
]


def median_filter(s, size, mode):
    """scipy.ndimage.median_filter by its definition, `mode` reflect.

    Scipy's own once gave a NaN for a filter longer than the array (1.17, (3, 7) by 31)."""
    assert mode == "reflect"
    padded = np.pad(s, [(k // 2, k - 1 - k // 2) for k in size], mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(padded, size).reshape(*s.shape, -1)
    return np.sort(windows, axis=-1)[..., windows.shape[-1] // 2]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("shape", "params"), SPECTROGRAMS)
def test_hpss_of_spectrograms(shape, params, dtype, monkeypatch):
    monkeypatch.setattr(librosa.decompose, "median_filter", median_filter)
    s = np.abs(np.random.default_rng(1).standard_normal(shape)).astype(dtype)
    s[..., : shape[-1] // 3] = np.round(s[..., : shape[-1] // 3])
    for got, want in zip(
        cf.decompose.hpss(s, **params), librosa.decompose.hpss(s, **params), strict=True
    ):
        close(got, want)


def test_hpss_of_complex_spectrograms():
    d = librosa.stft(pour(20000, 2), n_fft=512)
    for got, want in zip(cf.decompose.hpss(d), librosa.decompose.hpss(d), strict=True):
        close(got, want)


def test_hpss_of_two_frames_follows_the_definition():
    s = np.array([[1.0, 5.0], [2.0, 3.0]])
    harmonic, _ = cf.decompose.hpss(s, mask=True, kernel_size=(3, 1))
    # Windows a a b and a b b of the row (a, b); the other filter keeps the value itself.
    np.testing.assert_allclose(harmonic, 0.5)


@pytest.mark.parametrize(
    "params",
    [{"margin": 0.5}, {"power": 0.0}, {"kernel_size": 0}],
)
def test_hpss_refuses(params):
    with pytest.raises(cf.ParameterError):
        cf.decompose.hpss(np.ones((4, 4)), **params)
    with pytest.raises(cf.ParameterError):
        cf.effects.harmonic(np.ones(4000), **params)


def test_hpss_refuses_negative_values():
    with pytest.raises(cf.ParameterError):
        cf.decompose.hpss(-np.ones((4, 4)))


SIGNALS = [
    ((1,), {}),
    # scipy reads beyond rows of very few frames now and then, so none of those are here.
    ((1500,), {"hop_length": 256}),
    ((5000,), {"n_fft": 512}),
    ((2, 9001), {"n_fft": 1000, "win_length": 800, "kernel_size": (9, 31), "margin": 2.0}),
    ((2, 1, 3000), {"n_fft": 401, "power": 1.0, "center": False}),
    ((20000,), {"mask": True}),
    ((6000,), {"n_fft": 512, "pad_mode": "reflect", "window": "boxcar"}),
]


@pytest.mark.parametrize(("shape", "params"), SIGNALS)
def test_separation_of_signals(shape, params):
    y = pour(int(np.prod(shape)), 3).reshape(shape)
    for name in ("harmonic", "percussive"):
        ours, theirs = getattr(cf.effects, name), getattr(librosa.effects, name)
        agree(lambda y, f=ours: f(y, **params), lambda y, f=theirs: f(y, **params), y)
    both = cf.effects.hpss(y, **params)
    np.testing.assert_array_equal(both[0], cf.effects.harmonic(y, **params))
    np.testing.assert_array_equal(both[1], cf.effects.percussive(y, **params))


@pytest.mark.parametrize(
    ("n", "analysis", "synthesis"),
    [
        (5000, {"n_fft": 512}, {}),
        (5000, {"n_fft": 512}, {"length": 4700}),
        (5000, {"n_fft": 512}, {"length": 6000}),
        (3000, {"n_fft": 401, "hop_length": 100}, {"n_fft": 401, "hop_length": 100}),
        (3000, {"n_fft": 512, "center": False}, {"center": False}),
        (40, {"n_fft": 512}, {"length": 40}),
        (3000, {"n_fft": 600, "win_length": 400}, {"win_length": 400, "window": "hamming"}),
    ],
)
def test_istft(n, analysis, synthesis):
    d = librosa.stft(np.stack([pour(n, 4), pour(n, 5)]), **analysis)
    agree(lambda d: cf.istft(d, **synthesis), lambda d: librosa.istft(d, **synthesis), d)
    want = cf.istft(d, **synthesis)
    out = np.empty_like(want)
    assert cf.istft(d, out=out, **synthesis) is out
    np.testing.assert_array_equal(out, want)


TRANSFORMS = [
    (22050, (12000,), {}),
    (22050, (1,), {}),
    (22050, (2, 700), {"n_bins": 40}),
    (44100, (30000,), {"n_bins": 252, "bins_per_octave": 36, "tuning": -0.31}),
    (16000, (2, 2, 5000), {"hop_length": 192, "n_bins": 60, "fmin": 55.0}),
    (22050, (9000,), {"hop_length": 100, "n_bins": 24, "fmin": 400.0}),
    (22050, (9000,), {"hop_length": 333, "n_bins": 30, "fmin": 200.0}),
    (22050, (9000,), {"n_bins": 7, "bins_per_octave": 24, "fmin": 1000.0}),
    (22050, (9000,), {"n_bins": 1, "fmin": 300.0, "bins_per_octave": 3}),
    (22050, (9000,), {"filter_scale": 0.5, "norm": 2, "sparsity": 0.0, "n_bins": 48}),
    (22050, (9000,), {"window": "hamming", "norm": None, "sparsity": 0.2, "n_bins": 48}),
    (22050, (9000,), {"norm": np.inf, "pad_mode": "reflect", "n_bins": 60}),
    (48000, (21000,), {"n_bins": 30, "scale": False, "hop_length": 1024}),
    (22050, (9001,), {"n_bins": 20, "hop_length": 512, "tuning": None}),
]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(("sr", "shape", "params"), TRANSFORMS)
def test_cqt(sr, shape, params, dtype):
    y = pour(int(np.prod(shape)), 6, sr).reshape(shape).astype(dtype)
    if y.size == 1 and params == {}:
        y[:] = 1.0
    close(cf.cqt(y, sr=sr, **params), librosa.cqt(y, sr=sr, **params), 5e-6)


@pytest.mark.parametrize(
    "params",
    [
        {"n_bins": 120},
        {"n_bins": 0},
        {"fmin": -1.0},
        {"filter_scale": 0.0},
        {"sparsity": 1.0},
        {"hop_length": 0},
        {"fmin": 1e-6, "n_bins": 1},
    ],
)
def test_cqt_refuses(params):
    with pytest.raises(cf.ParameterError):
        cf.cqt(np.ones(4000), **params)


@pytest.mark.parametrize(
    "params",
    [
        {},
        {"tuning": 0.2, "n_chroma": 24, "bins_per_octave": 48, "n_octaves": 5},
        {"tuning": 0.0, "bins_per_octave": None, "norm": 2, "threshold": 0.02},
        {"tuning": 0.0, "fmin": 55.0, "n_octaves": 4, "norm": None, "threshold": None},
        {"tuning": 0.0, "window": np.array([0.25, 0.5, 0.25]), "hop_length": 256},
    ],
)
def test_chroma_cqt_and_tonnetz(params):
    y = np.stack([pour(30000, 7), pour(30000, 8)])
    want = librosa.feature.chroma_cqt(y=y, **params)
    close(cf.feature.chroma_cqt(y=y, **params), want, 5e-6)
    close(cf.feature.tonnetz(y=y, **params), librosa.feature.tonnetz(y=y, **params), 5e-6)
    close(cf.feature.tonnetz(chroma=want), librosa.feature.tonnetz(chroma=want))


def test_chroma_of_given_magnitudes():
    c = np.abs(np.random.default_rng(9).standard_normal((2, 84, 11))).astype(np.float32)
    params = {"bins_per_octave": 12, "fmin": 61.7}
    close(cf.feature.chroma_cqt(C=c, **params), librosa.feature.chroma_cqt(C=c, **params))


def reference_vector(y, sr):
    s = np.abs(librosa.stft(y))
    parts = [
        librosa.feature.mfcc(y=y, sr=sr, n_mfcc=40),
        librosa.feature.chroma_stft(S=s, sr=sr),
        librosa.feature.melspectrogram(y=y, sr=sr),
        librosa.feature.spectral_contrast(S=s, sr=sr),
        librosa.feature.tonnetz(y=librosa.effects.harmonic(y), sr=sr),
    ]
    return np.concatenate([np.mean(p.T, axis=0) for p in parts])


@pytest.mark.parametrize(("sr", "n"), [(44100, 60000), (22050, 25001), (16000, 3000)])
def test_af193(sr, n):
    y = pour(n, 10, sr)
    want = reference_vector(y, sr)
    limit = 1e-5 * np.abs(want) + 5e-6 * np.abs(want).max()
    single = cf.corsmal.af193(y, sr)
    assert single.dtype == np.float32
    assert (np.abs(single - want) <= limit).all()
    double = cf.corsmal.af193(y.astype(np.float64), sr)
    assert double.dtype == np.float64
    assert (np.abs(double - want) <= limit).all()


def test_af193_keeps_leading_axes_and_channels_apart():
    y = np.stack([pour(9000, 11), np.zeros(9000, np.float32)])[:, None]
    both = cf.corsmal.af193(y, 22050)
    assert both.shape == (2, 1, 193)
    np.testing.assert_array_equal(both[0, 0], cf.corsmal.af193(y[0, 0], 22050))
    assert np.isfinite(both).all()


def test_short_signals_warn():
    with pytest.warns(UserWarning, match="n_fft"):
        cf.effects.harmonic(np.ones(100, np.float32))
