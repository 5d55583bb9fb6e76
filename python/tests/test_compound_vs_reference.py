"""Compound inputs against pyAudioAnalysis, scikit-image, scikit-learn, published features."""

import os
from pathlib import Path

import numpy as np
import pytest
from corsmal_feat import ParameterError, corsmal, resample, to_mono

REPOSITORY = Path(__file__).resolve().parents[2]
CCM = Path(os.environ.get("CORSMAL_SHARED", REPOSITORY.parent / "shared")) / "data" / "ccm"
needs_ccm = pytest.mark.skipif(not CCM.is_dir(), reason=f"skipped: {CCM} absent")


def noisy_tone(n: int, seed: int) -> np.ndarray:
    t = np.arange(n) / 16000
    noise = np.random.default_rng(seed).standard_normal(n)
    return 0.4 * np.sin(2 * np.pi * 500 * (1 + t) * t) + 0.05 * noise


@pytest.fixture(scope="module")
def recording() -> tuple[np.ndarray, int]:
    soundfile = pytest.importorskip("soundfile", reason="skipped: soundfile absent")
    y, sr = soundfile.read(CCM / "audio" / "s1_fi0_fu0_b1_l0_audio.wav", dtype="float32")
    return y.T, sr


@pytest.mark.filterwarnings("ignore")  # of pyAudioAnalysis and what it imports
@pytest.mark.parametrize(
    ("sr", "window", "step"), [(16000, 800, 800), (8000, 401, 200), (22050, 1102, 551)]
)
def test_pyaudioanalysis(sr: int, window: int, step: int) -> None:
    features = pytest.importorskip(
        "pyAudioAnalysis.ShortTermFeatures", reason="skipped: pyAudioAnalysis absent"
    )
    from pyAudioAnalysis.MidTermFeatures import mid_feature_extraction

    y = noisy_tone(3 * sr + 17, sr)
    expected, _ = features.feature_extraction(y, sr, window, step)
    result = corsmal.a34_short(y, sr, window, step)
    np.testing.assert_allclose(result, expected, rtol=1e-7, atol=1e-9)
    mid = (sr, sr // 3)
    expected = mid_feature_extraction(y, sr, *mid, window, step)[0]
    result = corsmal.a34f136(y, sr, *mid, window, step)
    np.testing.assert_allclose(result, expected, rtol=1e-7, atol=1e-9)
    bank = features.mfcc_filter_banks(sr, window // 2)[0]
    np.testing.assert_allclose(corsmal.paa_fbank(sr, window // 2), bank, rtol=1e-7, atol=1e-12)


def test_pyaudioanalysis_refuses_what_the_original_cannot_do() -> None:
    for sr, window in [(44100, 200), (6000, 600), (16000, 1)]:
        with pytest.raises(ParameterError):
            corsmal.a34_short(np.zeros(9000), sr, window, 100)


@pytest.mark.parametrize("mode", ["reflect", "symmetric", "edge", "constant"])
@pytest.mark.parametrize("shape", [(96, 96), (7, 200), (150, 11), (1, 1)])
def test_resize(mode: str, shape: tuple[int, int]) -> None:
    transform = pytest.importorskip("skimage.transform", reason="skipped: scikit-image absent")
    s = np.random.default_rng(1).uniform(-80, -5, (130, 60)).astype(np.float32)
    for anti_aliasing in (None, False):
        expected = transform.resize(s, shape, mode=mode, anti_aliasing=anti_aliasing)
        result = corsmal.sk_resize(s, shape, mode=mode, anti_aliasing=anti_aliasing)
        assert result.dtype == np.float32
        np.testing.assert_allclose(result, expected, rtol=0, atol=3e-5)


@pytest.mark.parametrize("shape", [(40, 300), (200, 30)])
def test_pca(shape: tuple[int, int]) -> None:
    decomposition = pytest.importorskip(
        "sklearn.decomposition", reason="skipped: scikit-learn absent"
    )
    x = np.random.default_rng(2).standard_normal(shape) * np.linspace(3, 0.1, shape[1])
    fitted = decomposition.PCA(10, svd_solver="full").fit(x)
    result = corsmal.pca_fit(x, 10)
    np.testing.assert_allclose(result[:10], fitted.components_, rtol=0, atol=1e-8)
    np.testing.assert_allclose(result[11, :10], fitted.explained_variance_, rtol=1e-9)
    other = x[:5] + 1
    white = corsmal.pca_project(other, result[:10], result[10], result[11, :10], whiten=True)
    fitted.whiten = True
    np.testing.assert_allclose(white, fitted.transform(other), rtol=0, atol=1e-7)


@needs_ccm
def test_front_ends_on_the_real_recording(recording: tuple[np.ndarray, int]) -> None:
    y, sr = recording
    expected = np.load(CCM / "method_input_reference.npz")
    np.testing.assert_array_equal(corsmal.m4_logmel(y, sr), expected["m4_logmel"])
    mfcc = corsmal.m2_mfcc(y, sr, padded=False)
    np.testing.assert_allclose(mfcc, expected["m2_mfcc_norm"], rtol=0, atol=1e-4)
    image = corsmal.m6_spectrogram(y, sr)
    np.testing.assert_allclose(image, expected["m6_spectrogram96"], rtol=0, atol=1e-4)
    fast = resample(to_mono(y), orig_sr=sr, target_sr=22050, res_type="kaiser_fast")
    np.testing.assert_array_equal(fast, expected["m6_wav_22k_kaiser_fast"])


@needs_ccm
def test_baseline_spectrogram_of_librosa_08(recording: tuple[np.ndarray, int]) -> None:
    y, sr = recording
    expected = np.load(CCM / "baseline_feature_reference.npz")
    mono = resample(to_mono(y), orig_sr=sr, target_sr=22050, res_type="kaiser_best")
    np.testing.assert_array_equal(mono, expected["ccm_wav_mono_22k"])
    image = corsmal.spec9216(mono, 22050, 220500, librosa="0.8").reshape(96, 96)
    np.testing.assert_allclose(image, expected["spectrogram96"][0], rtol=0, atol=1e-4)


@needs_ccm
def test_baseline_vector_of_librosa_08(recording: tuple[np.ndarray, int]) -> None:
    y, sr = recording
    expected = np.load(CCM / "baseline_feature_reference.npz")["af193"][0]
    vector = corsmal.af193(y[0], sr, librosa="0.8")
    parts = np.split(np.arange(193), [40, 52, 180, 187])
    for part in parts:
        atol = 1e-5 * np.abs(expected[part]).max()
        np.testing.assert_allclose(vector[part], expected[part], rtol=0, atol=atol)


@needs_ccm
def test_published_row_of_the_real_recording(recording: tuple[np.ndarray, int]) -> None:
    published = np.load(CCM / "a34f_train.npz")
    same = (published["container"] == 3) & (published["sequence"] == "s1_fi0_fu0_b1_l0")
    (row,) = published["X"][same]
    result = corsmal.m5_a34f136(*recording)
    deviation = np.abs(result - row) / np.maximum(1, np.abs(row))
    assert deviation.max() < 3e-4


def test_m4_windows_overlap() -> None:
    features = np.random.default_rng(3).standard_normal((123, 64, 8)).astype(np.float32)
    windows = corsmal.m4_windows(features)
    assert windows.shape == (4, 8, 64, 64)
    np.testing.assert_array_equal(windows[1], features[16:80].transpose(2, 0, 1))
