"""resample against librosa with soxr: other rates, lengths and signals than the golden cases."""

import corsmal_feat
import numpy as np
import pytest

librosa = pytest.importorskip("librosa", reason="skipped: librosa absent")
pytest.importorskip("soxr", reason="skipped: soxr absent")

RATES = [8000, 12345, 16000, 16600, 22050, 44100, 44100.5, 48000, 96000, 192000]
PAIRS = [(a, b) for a in RATES for b in RATES if a != b]


def signal(rng: np.random.Generator) -> np.ndarray:
    n = int(rng.integers(1, 9000))
    kind = rng.integers(3)
    if kind == 0:
        return 0.2 * rng.standard_normal(n)
    if kind == 1:
        t = np.arange(n)
        return 0.9 * np.sin(np.pi * t * t / (2 * n))
    clicks = np.zeros(n)
    clicks[rng.integers(0, n, 5)] = 1.0
    return clicks


@pytest.mark.parametrize(("orig_sr", "target_sr"), PAIRS)
def test_any_pair_of_rates(orig_sr: float, target_sr: float) -> None:
    rng = np.random.default_rng(int(orig_sr * 7 + target_sr))
    y = signal(rng).astype(np.float32)
    expected = librosa.resample(y, orig_sr=orig_sr, target_sr=target_sr)
    result = corsmal_feat.resample(y, orig_sr=orig_sr, target_sr=target_sr)
    assert result.dtype == expected.dtype
    assert result.shape == expected.shape
    np.testing.assert_allclose(result, expected, rtol=0, atol=3e-6)


@pytest.mark.parametrize("n", [1, 2, 3, 10, 100, 441, 1000])
@pytest.mark.parametrize("target_sr", [16000, 22050, 32000, 96000])
@pytest.mark.parametrize("fix", [True, False])
def test_short_signals_and_lengths(n: int, target_sr: int, fix: bool) -> None:
    y = np.random.default_rng(n).uniform(-1, 1, (2, n))
    kwargs = {"orig_sr": 44100, "target_sr": target_sr, "fix": fix, "scale": True}
    expected = librosa.resample(y, **kwargs)
    result = corsmal_feat.resample(y, **kwargs)
    assert result.dtype == np.float64
    assert result.shape == expected.shape
    np.testing.assert_allclose(result, expected, rtol=0, atol=3e-6)


def test_axis_and_refusals() -> None:
    y = np.random.default_rng(0).uniform(-1, 1, (500, 2)).astype(np.float32)
    expected = librosa.resample(y, orig_sr=3, target_sr=2, axis=0)
    result = corsmal_feat.resample(y, orig_sr=3, target_sr=2, axis=0)
    np.testing.assert_allclose(result, expected, rtol=0, atol=3e-6)
    assert corsmal_feat.resample(y, orig_sr=2, target_sr=2) is y
    for rates in [(0, 1), (1, -1), (1, float("nan")), (1, 1e9)]:
        with pytest.raises(corsmal_feat.ParameterError):
            corsmal_feat.resample(y, orig_sr=rates[0], target_sr=rates[1])
