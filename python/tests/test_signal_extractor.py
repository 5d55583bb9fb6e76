"""What `SignalExtractor` refuses, and what it keeps then."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable
from typing import Any

import corsmal_feat as cf
import numpy as np
import pytest

RATE = 22050


def test_signals_that_have_no_features() -> None:
    with pytest.raises(cf.ParameterError, match="no samples"):
        cf.SignalExtractor(RATE).finish()
    with pytest.raises(cf.ParameterError, match="NaN"):
        cf.SignalExtractor(RATE).push(np.full(10, np.nan, np.float32))
    with pytest.raises(cf.ParameterError, match="expected 2"):
        cf.SignalExtractor(RATE, 2).push(np.zeros(10, np.float32))
    with pytest.raises(cf.ParameterError, match=r"2\*\*15"):
        cf.SignalExtractor(RATE).push(np.ones(10, np.int16))
    for sr in (0, 22050.5, None):
        with pytest.raises(cf.ParameterError, match="sr"):
            cf.SignalExtractor(sr)


@pytest.mark.parametrize("crop", [{}, {"signal": {"start": 0.5, "end": 2.5}}], ids=str)
def test_a_refused_block_leaves_the_signal_as_it_was(crop: dict[str, object]) -> None:
    """The samples before the bad one were kept, or the block used up the crop."""
    config = {"features": {"rms": {"hop_length": 1000}}, **crop}
    good = np.sin(np.arange(45000, dtype=np.float32))
    bad = good.copy()
    bad[39000] = 1e13
    refused = cf.SignalExtractor(16000, config=config)
    with pytest.raises(cf.ParameterError, match="frame 39000"):
        refused.push(bad)
    refused.push(good)
    alone = cf.SignalExtractor(16000, config=config)
    alone.push(good)
    np.testing.assert_array_equal(refused.finish()["rms"], alone.finish()["rms"])


@pytest.mark.parametrize("value", [1e300, -1e39])
def test_what_single_precision_cannot_hold_is_loud_and_not_nan(value: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(cf.ParameterError, match="beyond ±1e12"):
            cf.SignalExtractor(RATE).push(np.full(10, value))
        with pytest.raises(cf.CorsmalFeatError, match="beyond ±1e12"):
            cf.FeatureExtractor("esc26", sr=RATE).fit_transform([np.full(5000, value)])
    with pytest.raises(cf.ParameterError, match="NaN or infinite"):
        cf.SignalExtractor(RATE).push(np.full(10, np.inf))


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_stream_has_no_copies(copied: Callable[[Any], object]) -> None:
    """A shallow one took its samples to the other, too."""
    with pytest.raises(cf.DataTypeError, match="cannot be copied or pickled: make another one"):
        copied(cf.SignalExtractor(RATE))
