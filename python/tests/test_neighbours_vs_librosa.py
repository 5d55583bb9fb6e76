"""Features that look at neighbouring frames against librosa on inputs made here."""

from __future__ import annotations

from typing import Any

import corsmal_feat
import numpy as np
import pytest

librosa = pytest.importorskip("librosa", reason="librosa is absent", exc_type=ImportError)

RNG = np.random.default_rng(3)
SPECTROGRAM = (RNG.random((12, 40)) ** 8 * 1000).astype(np.float32)
CASES: tuple[dict[str, Any], ...] = (
    {},
    {"gain": 0.5, "bias": 10, "power": 0.25, "time_constant": 0.06},
    {"power": 0},
    {"bias": 0},
    {"b": 0.3, "eps": 1e-3},
    {"max_size": 3},
    {"max_size": 4, "hop_length": 128, "sr": 44100},
)


def close(ours: Any, theirs: Any) -> None:
    assert ours.shape == theirs.shape
    assert ours.dtype == theirs.dtype
    np.testing.assert_allclose(ours, theirs, rtol=2e-6, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize("keys", CASES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_pcen(keys: dict[str, Any], dtype: Any) -> None:
    S = SPECTROGRAM.astype(dtype)
    close(corsmal_feat.pcen(S, **keys), librosa.pcen(S, **keys))
    transposed = np.ascontiguousarray(S.T)
    close(corsmal_feat.pcen(transposed, axis=0, **keys), librosa.pcen(transposed, axis=0, **keys))


def test_pcen_of_many_channels_levels_and_states() -> None:
    S = np.stack([SPECTROGRAM, SPECTROGRAM[::-1], SPECTROGRAM * 3])
    close(corsmal_feat.pcen(S), librosa.pcen(S))
    keys = {"max_size": 5, "max_axis": 1}
    close(corsmal_feat.pcen(S, **keys), librosa.pcen(S, **keys))
    close(corsmal_feat.pcen(S, ref=S + 1), librosa.pcen(S, ref=S + 1))
    close(corsmal_feat.pcen(S[0, 0]), librosa.pcen(S[0, 0]))
    ours, theirs = (m.pcen(S[..., :17], return_zf=True) for m in (corsmal_feat, librosa))
    for a, b in zip(ours, theirs, strict=True):
        close(a, b)
    rest = corsmal_feat.pcen(S[..., 17:], zi=ours[1])
    close(rest, librosa.pcen(S[..., 17:], zi=theirs[1]))
    close(np.concatenate([ours[0], rest], axis=-1), corsmal_feat.pcen(S))


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"gain": -1}, "gain"),
        ({"eps": 0}, "eps"),
        ({"b": 2}, r"b must be .*, not 2"),
        ({"max_size": 0}, "max_size"),
        ({"axis": 2}, r"axis must be .*, not 2"),
        ({"ref": SPECTROGRAM[:3]}, "ref has shape"),
        ({"zi": SPECTROGRAM}, "zi has shape"),
    ],
)
def test_pcen_refuses(keys: dict[str, Any], says: str) -> None:
    with pytest.raises(corsmal_feat.ParameterError, match=says):
        corsmal_feat.pcen(SPECTROGRAM, **keys)


@pytest.mark.parametrize("keys", [{}, {"lag": 3, "max_size": 3}, {"center": False}])
def test_rises_without_aggregation(keys: dict[str, Any]) -> None:
    y = (RNG.normal(size=9000) * np.repeat([0.01, 1, 0.1], 3000)).astype(np.float32)
    ours, theirs = (
        m.onset.onset_strength_multi(y=y, sr=22050, aggregate=False, **keys)
        for m in (corsmal_feat, librosa)
    )
    assert ours.shape == theirs.shape
    np.testing.assert_allclose(ours, theirs, atol=2e-6 * theirs.max())
    parts = [0, 10, 64, 128]
    ours, theirs = (
        m.onset.onset_strength_multi(y=y, sr=22050, channels=parts, **keys)
        for m in (corsmal_feat, librosa)
    )
    assert ours.shape == theirs.shape
    np.testing.assert_allclose(ours, theirs, atol=2e-6 * theirs.max())
