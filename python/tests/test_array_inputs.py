"""Arrays in methods and estimators: masks are refused, and the advice for other types is right."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import corsmal_feat as cf
import numpy as np
import pytest

X = np.random.default_rng(0).standard_normal((8, 3))
Y = np.array([0, 1] * 4)
MASKED = np.ma.array(X, mask=X > 1)
SIGNAL = np.ma.array(X.ravel(), mask=X.ravel() > 1)


@pytest.mark.parametrize(
    "call",
    [
        lambda: cf.KNN(1).fit(MASKED, Y),
        lambda: cf.KNN(1).fit(list(MASKED), Y),
        lambda: cf.KNN(1).fit(X, np.ma.array(Y, mask=Y)),
        lambda: cf.KNN(1).fit(X, Y).predict(MASKED),
        lambda: cf.RandomForest(3).fit(X, Y, np.ma.array(np.ones(8), mask=Y)),
        lambda: cf.SignalExtractor(8000, preset="mfcc-zcr").push(SIGNAL),
        lambda: cf.FeatureExtractor("mfcc-zcr", sr=8000).fit_transform([SIGNAL]),
        lambda: cf.FeatureExtractor("mfcc-zcr", sr=8000).fit_transform(MASKED),
        lambda: cf.nets.build("m3_mlp").forward(np.ma.array(np.ones((1, 136)), mask=True)),
    ],
)  # fmt: skip
def test_masks_are_refused(call: Callable[[], object]) -> None:
    with pytest.raises(cf.ParameterError, match=r"mask.*filled\(0\)"):
        call()


def test_a_mask_that_hides_nothing_has_no_effect() -> None:
    y = X.ravel()
    assert np.array_equal(cf.stft(np.ma.array(y), n_fft=16), cf.stft(y, n_fft=16))


def test_signals_need_no_alignment() -> None:
    y = np.random.default_rng(1).standard_normal(8000).astype(np.float32)
    shifted = np.frombuffer(b"\0" + y.tobytes(), np.float32, offset=1)
    sums: list[Any] = []
    for signal in (y, shifted):
        extractor = cf.SignalExtractor(8000, preset="mfcc-zcr")
        extractor.push(signal)
        sums.append(extractor.finish())
    assert np.array_equal(*sums)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.int8, np.int16])
def test_the_advice_for_whole_numbers_gives_silence_as_zero(kind: type[np.integer[Any]]) -> None:
    info = np.iinfo(kind)
    middle = (info.max + info.min + 1) // 2
    samples = np.array([info.min, middle, info.max], kind)
    with pytest.raises(cf.ParameterError) as error:
        cf.stft(samples)
    full = 2 ** (info.bits - 1)
    advised = f"subtract 2**{info.bits - 1} and divide by 2**{info.bits - 1}"
    if info.min < 0:
        advised = f"divide {samples.dtype} samples by 2**{info.bits - 1}"
    assert advised in str(error.value)
    signal = (samples.astype(np.float32) - (0 if info.min < 0 else full)) / full
    assert signal[:2].tolist() == [-1, 0] and 0.99 < signal[2] < 1


def test_rms_prefers_the_signal_as_librosa_does() -> None:
    y = np.random.default_rng(2).standard_normal(4096)
    both = cf.feature.rms(y=y, S=np.ones((1025, 9)))
    assert np.array_equal(both, cf.feature.rms(y=y))


def test_frequencies_are_real_numbers() -> None:
    """None was a tuning of 0, and imaginary parts were dropped."""
    for frequencies in (None, [440 + 3j], ["440"]):
        with pytest.raises(cf.CorsmalFeatError, match="frequencies must be real numbers, not"):
            cf.pitch_tuning(frequencies)  # type: ignore[arg-type]
