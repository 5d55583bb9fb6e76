"""Floats without a fraction stand for whole numbers, in any function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import corsmal_feat as cf
import numpy as np
import pytest
from corsmal_feat._refusals import refuses

Y = 0.1 * np.random.default_rng(0).standard_normal(8192).astype(np.float32)
ROWS = np.arange(120.0).reshape(3, 40)
CALLS: list[tuple[Callable[..., Any], dict[str, Any]]] = [
    (lambda **k: cf.stft(Y, **k), {"n_fft": 1024, "hop_length": 256}),
    (lambda **k: cf.cqt(Y, **k), {"hop_length": 512, "n_bins": 24}),
    (lambda **k: cf.feature.mfcc(y=Y, **k), {"n_mfcc": 13, "n_fft": 1024}),
    (lambda **k: cf.feature.spectral_centroid(y=Y, **k), {"n_fft": 1024}),
    (lambda **k: cf.feature.spectral_bandwidth(y=Y, **k), {"n_fft": 1024}),
    (lambda **k: cf.feature.spectral_rolloff(y=Y, **k), {"n_fft": 1024}),
    (lambda **k: cf.feature.spectral_contrast(y=Y, **k), {"n_fft": 1024, "n_bands": 5}),
    (lambda **k: cf.feature.poly_features(y=Y, **k), {"n_fft": 1024, "order": 2}),
    (lambda **k: cf.feature.stack_memory(ROWS, **k), {"n_steps": 3, "delay": 2}),
    (lambda **k: cf.feature.delta(ROWS, **k), {"width": 5, "axis": 1}),
    (lambda **k: cf.effects.trim(Y, **k)[1], {"frame_length": 1024, "hop_length": 256}),
    (lambda **k: cf.times_like(ROWS, **k), {"hop_length": 256, "axis": 1}),
    (lambda **k: cf.util.normalize(ROWS, **k), {"axis": 1}),
    (cf.fft_frequencies, {"n_fft": 512}),
    (cf.mel_frequencies, {"n_mels": 20}),
    (lambda **k: cf.cqt_frequencies(fmin=32.7, **k), {"n_bins": 20}),
    (cf.tempo_frequencies, {"n_bins": 20, "hop_length": 256}),
    (lambda **k: cf.get_duration(S=ROWS, **k), {"n_fft": 512, "hop_length": 256}),
    (lambda **k: cf.frames_to_time(np.arange(4), **k), {"n_fft": 512, "hop_length": 256}),
    (lambda **k: cf.corsmal.pca_fit(ROWS.T, **k)[0], {"n_components": 2}),
]


@pytest.mark.parametrize(("call", "numbers"), CALLS)
def test_whole_floats_are_whole_numbers(call: Callable[..., Any], numbers: dict[str, int]) -> None:
    expected = call(**numbers)
    for kind in (float, np.float64, np.float32):
        got = call(**{name: kind(value) for name, value in numbers.items()})
        np.testing.assert_array_equal(got, expected)
    for name, value in numbers.items():
        with pytest.raises(cf.ParameterError, match=name):
            call(**{**numbers, name: value + 0.5})


def test_a_signal_of_whole_channels() -> None:
    signal = cf.SignalExtractor(44100, channels=2.0, preset="esc26")  # type: ignore[arg-type]
    signal.push(np.zeros((2, 100), np.float32))
    for channels in (0, 65, 1.5):
        with pytest.raises(cf.ParameterError, match="channels"):
            cf.SignalExtractor(44100, channels=channels, preset="esc26")  # type: ignore[arg-type]


def test_a_function_that_fails_late_runs_once() -> None:
    calls = []

    @refuses
    def late(jobs: int) -> None:
        calls.append(jobs)
        raise cf.ParameterError("found at the end of a long run")

    with pytest.raises(cf.ParameterError, match="long run"):
        late(2.0)  # type: ignore[arg-type]
    assert calls == [2]
