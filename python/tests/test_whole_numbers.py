"""Arguments that count something are whole numbers: a fraction is refused, not cut."""

from __future__ import annotations

from collections.abc import Callable

import corsmal_feat
import numpy as np
import pytest
from corsmal_feat import nets

NOISE = np.random.default_rng(0).standard_normal(8000)
SEQUENCES = np.zeros((6, 3, 128), np.float32)


def fitted(watched: list[float]) -> object:
    network = nets.NetworkClassifier("attention_gru", recipe={"epochs": 1})
    return network.fit(SEQUENCES, ["a", "b"] * 3, watched=watched)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "call"),
    [
        ("Nx", lambda: corsmal_feat.filters.get_window("hann", 10.5)),  # type: ignore[arg-type]
        ("frame_length", lambda: corsmal_feat.util.frame(NOISE, frame_length=9.5, hop_length=5)),  # type: ignore[arg-type]
        ("hop_length", lambda: corsmal_feat.util.frame(NOISE, frame_length=9, hop_length=5.5)),  # type: ignore[arg-type]
        ("hop_length", lambda: corsmal_feat.yin(NOISE, fmin=100, fmax=800, hop_length=512.5)),  # type: ignore[arg-type]
        ("containers", lambda: corsmal_feat.evaluate("a.csv", "b.csv", containers=[1.5])),  # type: ignore[list-item]
        ("lengths", lambda: nets.build("attention_gru").forward(SEQUENCES, lengths=[1.5] * 6)),  # type: ignore[list-item]
        ("watched", lambda: fitted([0.5])),
    ],
)  # fmt: skip
def test_a_fraction_is_refused(name: str, call: Callable[[], object]) -> None:
    with pytest.raises(corsmal_feat.ParameterError, match=f"{name} must be a whole number"):
        call()
