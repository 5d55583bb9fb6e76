"""`specshow` and `waveshow` beside librosa's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import corsmal_feat
import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot

display = pytest.importorskip("librosa.display", reason="librosa is absent")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


@pytest.fixture(autouse=True)
def figure() -> Iterator[None]:
    matplotlib.use("Agg")
    yield
    pyplot.close("all")


def drawn(module: Any, data: Any, **kwargs: Any) -> tuple[Any, Any]:
    _, axes = pyplot.subplots()
    return axes, module.specshow(data, ax=axes, **kwargs)


AXES: tuple[dict[str, Any], ...] = (
    {"y_axis": "linear", "x_axis": "time"},
    {"y_axis": "log", "x_axis": "s", "sr": 44100},
    {"y_axis": "mel", "x_axis": "ms", "fmax": 8000},
    {"y_axis": "cqt_hz", "x_axis": "frames", "tuning": 0.3, "bins_per_octave": 24},
    {"y_axis": "cqt_note", "x_axis": "time", "fmin": 55, "bins_per_octave": 36},
    {"y_axis": "chroma", "x_axis": "time"},
    {"y_axis": "chroma", "x_axis": "chroma", "bins_per_octave": 24},
    {"y_axis": None, "x_axis": None},
)


@pytest.mark.parametrize("axes", AXES, ids=lambda axes: str(axes["y_axis"]))
def test_places_are_librosas(axes: dict[str, Any]) -> None:
    data = np.random.default_rng(0).random((129, 20))
    (here, ours), (there, theirs) = (
        drawn(corsmal_feat.display, data, **axes),
        drawn(display, data, **axes),
    )
    np.testing.assert_allclose(ours.get_coordinates(), theirs.get_coordinates(), rtol=1e-9)
    assert np.array_equal(ours.get_array(), theirs.get_array())
    assert here.get_xlim() == pytest.approx(there.get_xlim())
    assert here.get_ylim() == pytest.approx(there.get_ylim())
    assert ours.get_cmap().name == theirs.get_cmap().name


@pytest.mark.parametrize("low", [-np.inf, -1.0, 0.0, 0.5])
def test_colours_are_librosas(low: float) -> None:
    data = np.linspace(0.1, 1.0, 600).reshape(20, 30)
    data[0, :2] = low
    signed = data - 0.5
    signed[0, 0] = low
    for values in (data, signed, data > 0.5):
        (_, ours), (_, theirs) = (
            drawn(corsmal_feat.display, values),
            drawn(display, values),
        )
        assert ours.get_cmap().name == theirs.get_cmap().name


@pytest.mark.parametrize("auto", [True, False])
@pytest.mark.parametrize(
    "pair", [("time", "time"), ("time", "s"), ("frames", "time"), ("chroma", "chroma")]
)
def test_squares(auto: bool, pair: tuple[str, str]) -> None:
    data = np.eye(12)
    options: dict[str, Any] = {"x_axis": pair[0], "y_axis": pair[1], "auto_aspect": auto}
    (here, _), (there, _) = (
        drawn(corsmal_feat.display, data, **options),
        drawn(display, data, **options),
    )
    assert here.get_aspect() == there.get_aspect()


def test_frequencies_beyond_the_rate_are_told() -> None:
    with pytest.warns(UserWarning, match="beyond sr / 2"):
        drawn(corsmal_feat.display, np.zeros((84, 3)), y_axis="cqt_hz", sr=4000)


def test_another_n_fft_is_refused() -> None:
    with pytest.raises(
        corsmal_feat.ParameterError, match="n_fft = 4000 gives 2001 bins, but data has 129"
    ):
        drawn(corsmal_feat.display, np.zeros((129, 3)), y_axis="linear", n_fft=4000)
    with pytest.raises(corsmal_feat.ParameterError, match="key is not available here"):
        drawn(corsmal_feat.display, np.zeros((12, 3)), y_axis="chroma", key="D:min")


@pytest.mark.parametrize("transpose", [False, True])
@pytest.mark.parametrize("samples", [100, 50000])
def test_waveforms(samples: int, transpose: bool) -> None:
    y = np.sin(np.arange(samples) / 9).astype(np.float32)
    _, axes = pyplot.subplots()
    corsmal_feat.display.waveshow(
        y, ax=axes, transpose=transpose, where="mid", label="a", marker=".", offset=2.0
    )
    across, along = (axes.xaxis, axes.yaxis) if transpose else (axes.yaxis, axes.xaxis)
    assert along.get_label_text() == "Time" and across.get_label_text() == ""
    assert axes.get_legend_handles_labels()[1] == ["a"]
    low, high = axes.get_ylim() if transpose else axes.get_xlim()
    assert low < 2.0 < 2.0 + samples / 22050 < high + samples / 22050 / 10
