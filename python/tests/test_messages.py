"""Messages name arguments, not options of the command."""

from __future__ import annotations

import pathlib
from collections.abc import Callable

import corsmal_feat
import numpy as np
import pytest
import soundfile
from corsmal_feat import KNN, _core, cross_validate, extract, feature
from corsmal_feat.errors import CorsmalFeatError


@pytest.mark.parametrize(
    ("told", "wanted"),
    [
        ("x.npz exists; --overwrite replaces it", "x.npz exists; overwrite=True replaces it"),
        ('no column "f" (--id-column): a', 'no column "f" (id_column): a'),
        (
            "16 kHz: --set signal.sample_rate=8000 resamples it, --any-rate, as it is",
            '16 kHz: set={"signal.sample_rate": 8000} resamples it, any_rate=True, as it is',
        ),
        ("--set signal.channels=mean mixes", 'set={"signal.channels": "mean"} mixes'),
        ("--set rms.center=false", 'set={"rms.center": False}'),
        ("(--set x.y=80, or", '(set={"x.y": 80}, or'),
        ('"--set a=false" --set b=[1, 2]', '"set={"a": False}" --set b=[1, 2]'),
        ("--set x=inf; --set: no", 'set={"x": "inf"}; --set: no'),
        ("\n--resume. --overwrite.", "\nresume=True. overwrite=True."),
        ("a--resume  b/--set --unheard -- --", "a--resume  b/--set --unheard -- --"),
        (" /data/run --resume/x.npz", " /data/run --resume/x.npz"),
        ("", ""),
    ],
)
def test_options_become_arguments_and_other_text_stays(told: str, wanted: str) -> None:
    assert _core.in_python(told) == wanted


def test_what_is_given_instead_of_rows_is_named(tmp_path: pathlib.Path) -> None:
    soundfile.write(tmp_path / "a.wav", np.zeros(8000), 8000)
    features = extract([tmp_path], preset="mfcc-zcr")
    with pytest.raises(CorsmalFeatError, match=r"give its statistics, X\.summary"):
        KNN(1).fit(features, ["x"])
    with pytest.raises(CorsmalFeatError, match="must be the path of a feature file"):
        cross_validate(features, "y")  # type: ignore[arg-type]
    with pytest.raises(CorsmalFeatError, match="put FeatureExtractor before"):
        KNN(1).fit(["a.wav", "b.wav"], ["x", "y"])
    with pytest.raises(AttributeError, match="lists what is available"):
        feature.tempogram  # noqa: B018


def test_warnings_and_refusals_of_a_cross_validation(tmp_path: pathlib.Path) -> None:
    x = np.random.default_rng(0).normal(size=(12, 2))
    y = np.array(["a", "b"] * 6)
    path = tmp_path / "x.npz"
    np.savez(path, X=x, y=y, group=np.array(["p", "p", "q", "q"] * 3))
    with pytest.warns(UserWarning, match="in both training and test: groups group keeps"):
        cross_validate(path, "y", classifier="knn", cv=3)
    with pytest.raises(CorsmalFeatError, match="cv 6 makes 6 folds") as refused:
        cross_validate(path, "y", classifier="knn", cv=9)
    assert "--" not in str(refused.value)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: corsmal_feat.fft_frequencies(sr=np.array(8e3), n_fft="a"), "n_fft must be"),  # type: ignore[arg-type]
        (lambda: corsmal_feat.mel_frequencies(3, fmax="a"), "fmax must be a number"),  # type: ignore[arg-type]
        (lambda: corsmal_feat.stft(np.zeros(9), window=None), "window must be"),  # type: ignore[arg-type]
        (lambda: corsmal_feat.times_like(10**400), "times_like|samples_like"),
        (lambda: corsmal_feat.extract(["a", 3]), "each text or a path|each a path"),  # type: ignore[list-item]
    ],
)  # fmt: skip
def test_the_argument_at_fault_is_named(call: Callable[[], object], message: str) -> None:
    with pytest.raises(corsmal_feat.ParameterError, match=message):
        call()
