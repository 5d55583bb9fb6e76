"""Models that know their features: trained on recordings, asked about recordings."""

from __future__ import annotations

import os
import pickle
import subprocess
import warnings
from pathlib import Path

import corsmal_feat as cf
import numpy as np
import pandas
import pytest
import soundfile

RATE = 16000


def record(
    path: Path, hz: float, seed: int, rate: int = RATE, channels: int = 1, seconds: float = 0.5
) -> Path:
    samples = int(rate * seconds)
    noise = 0.02 * np.random.default_rng(seed).standard_normal((samples, channels))
    tone = 0.2 * np.sin(2 * np.pi * hz * np.arange(samples) / rate)
    soundfile.write(path, tone[:, None] + noise, rate)
    return path


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Path], list[str]]:
    folder = tmp_path_factory.mktemp("recordings")
    kinds = ["low", "high"] * 5
    hz = {"low": 300, "high": 3000}
    return [record(folder / f"{i}.wav", hz[k], i) for i, k in enumerate(kinds)], kinds


def test_a_model_with_its_features_takes_recordings(
    recordings: tuple[list[Path], list[str]], tmp_path: Path
) -> None:
    paths, kinds = recordings
    features = cf.extract(paths, preset="mfcc-zcr")
    extractor = cf.FeatureExtractor("mfcc-zcr")
    of_run = cf.RandomForest(20, random_state=1).fit(features.summary, kinds)
    of_rows = cf.RandomForest(20, random_state=1).fit(extractor.fit_transform(paths), kinds)
    of_run.save(tmp_path / "run", features=features)
    of_rows.save(tmp_path / "rows", features=extractor)
    for name in ("run", "rows"):
        model = cf.load_model(tmp_path / name)
        assert f"rf of {len(features.names)} features of recordings, 2 classes (high, low)" in repr(
            model
        )
        assert model.predict(paths).tolist() == kinds
        assert model.predict([*paths[:2], paths[0]]).tolist() == ["low", "high", "low"]
        assert model.predict(str(paths[1])).tolist() == ["high"]
        texts = [str(path) for path in paths]
        for others in (np.array(texts), np.array(paths, dtype=object), pandas.Series(texts)):
            assert model.predict(others).tolist() == kinds
        again = pickle.loads(pickle.dumps(model))
        assert again.predict(paths[:2]).tolist() == kinds[:2]
        assert np.array_equal(model.predict_proba(paths), of_run.predict_proba(features.summary))
        trained = model.header["trained_on"]
        assert (trained["sample_rates"], trained["channels"]) == ([RATE], [1])
        assert model.header["feature_names"] == features.names
        # Features of another kind or order would be taken for those of the training.
        frame = pandas.DataFrame(features.summary, columns=features.names)
        assert model.predict(frame).tolist() == model.predict(features).tolist() == kinds
        with pytest.raises(cf.ParameterError, match=r"column 0 of X must be mfcc\[0\]\.mean"):
            model.predict(frame[frame.columns[::-1]])
        elsewhere = cf.extract(paths, preset="mfcc-zcr", set={"mfcc.n_mels": 40})
        with pytest.raises(cf.ParameterError, match="another configuration"):
            model.predict(elsewhere)
        with pytest.raises(cf.ParameterError, match="holds frames"):
            model.predict(cf.extract(paths[:1], preset="logmel"))
    of_run.save(tmp_path / "bare")
    with pytest.raises(cf.ParameterError, match="holds no feature configuration"):
        cf.load_model(tmp_path / "bare").predict(features)
    other = record(tmp_path / "other.wav", 300, 5, rate=44100)
    with pytest.raises(cf.ParameterError, match=r"44100 Hz, but .* was trained on 16000"):
        model.predict([paths[0], other])
    assert len(model.predict([paths[0], other], any_rate=True)) == 2
    with pytest.raises(cf.ParameterError, match=r"44100 Hz, but .* was trained on 16000"):
        model.predict(cf.extract([other], preset="mfcc-zcr"))
    with pytest.raises(FileNotFoundError, match="gone"):
        cf.extract([tmp_path / "gone.wav"])
    stereo = record(tmp_path / "stereo.wav", 300, 5, channels=2)
    with pytest.raises(cf.ParameterError, match="channels"):
        model.predict([stereo])
    (tmp_path / "bad.wav").write_bytes(b"no audio at all")
    with pytest.raises(cf.DecodeError, match=r"bad\.wav"):
        model.predict([tmp_path / "bad.wav"])
    with pytest.raises(cf.ParameterError, match="mixes paths"):
        model.predict([paths[0], 3])
    with pytest.raises(cf.ParameterError, match="5 features"):
        model.predict(np.zeros((2, 5)))


def test_a_model_of_rows_says_so(recordings: tuple[list[Path], list[str]], tmp_path: Path) -> None:
    paths, kinds = recordings
    forest = cf.KNN(1).fit(np.arange(10.0).reshape(-1, 1), kinds)
    forest.save(tmp_path / "model")
    model = cf.load_model(tmp_path / "model")
    assert "features of rows" in repr(model)
    with pytest.raises(cf.ModelError, match="features="):
        model.predict(paths)
    assert model.predict([[0.0], [1.0]]).tolist() == kinds[:2]
    features = cf.extract(paths, preset="mfcc-zcr")
    with pytest.raises(cf.ParameterError, match="feature names"):
        forest.save(tmp_path / "wrong", features=features)
    with pytest.raises(cf.ParameterError, match="rows of a summary"):
        forest.save(tmp_path / "wrong", features=cf.extract(paths[:1], preset="logmel"))
    with pytest.raises(cf.ParameterError, match="FeatureExtractor"):
        forest.save(tmp_path / "wrong", features="mfcc-zcr")
    assert not (tmp_path / "wrong").exists()


@pytest.mark.parametrize("described_by", ["features", "extractor"])
def test_a_model_of_other_rows_is_not_saved_with_these_features(
    recordings: tuple[list[Path], list[str]], tmp_path: Path, described_by: str
) -> None:
    paths, kinds = recordings
    features = cf.extract(paths, preset="mfcc-zcr")
    extractor = cf.FeatureExtractor("mfcc-zcr")
    assert np.array_equal(extractor.fit(paths).transform(paths), features.summary)
    extractor.transform(paths[:1])
    described = features if described_by == "features" else extractor
    rows = features.summary
    resampled = cf.extract(paths, preset="mfcc-zcr", set={"signal.sample_rate": 8000}).summary
    for other in ((rows - rows.mean(axis=0)) / rows.std(axis=0), rows[:, ::-1], resampled):
        model = cf.KNN(1).fit(other, kinds)
        with pytest.raises(cf.ParameterError, match="none of these 10: fit on"):
            model.save(tmp_path / "model", features=described)
        assert not (tmp_path / "model").exists()
    frame = pandas.DataFrame(rows.astype(np.float64), columns=features.names)
    for same in (rows, frame, rows[3:7]):
        cf.KNN(1).fit(same, kinds[: len(same)]).save(tmp_path / "model", features=described)
    mixed = cf.KNN(1).fit(np.concatenate([rows, rows + 1]), kinds * 2)
    with pytest.warns(UserWarning, match="only 10 of the 20 rows"):
        mixed.save(tmp_path / "model", features=described)
    again = pickle.loads(pickle.dumps(cf.KNN(1).fit(rows + 1, kinds)))
    with pytest.raises(cf.ParameterError, match="none of these"):
        again.save(tmp_path / "wrong", features=described)
    cf.KNN.load(tmp_path / "model").save(tmp_path / "model", features=described)
    # Pickles of 0.1.0 do not say what they gave.
    old = cf.FeatureExtractor("mfcc-zcr").fit(paths)
    del old._given
    cf.KNN(1).fit(rows, kinds).save(tmp_path / "model", features=pickle.loads(pickle.dumps(old)))


def test_recordings_of_another_length_are_warned_of(
    recordings: tuple[list[Path], list[str]], tmp_path: Path
) -> None:
    paths, kinds = recordings
    features = cf.extract(paths, preset="mfcc-zcr")
    model = cf.KNN(1).fit(features.summary, kinds)
    model.save(tmp_path / "model", features=features)
    model = cf.load_model(tmp_path / "model")
    assert model.header["trained_on"]["seconds"] == {"shortest": 0.5, "longest": 0.5}
    long = record(tmp_path / "long.wav", 300, 5, seconds=1.5)
    expected = r"long\.wav is 1\.5 s long, but the model was trained on recordings of 0\.5 s:"
    with pytest.warns(UserWarning, match=expected):
        model.predict([paths[0], long])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.predict(paths)


def test_a_pipeline_refuses_other_rates_as_a_model_does(
    recordings: tuple[list[Path], list[str]], tmp_path: Path
) -> None:
    paths, _ = recordings
    other = record(tmp_path / "other.wav", 300, 5, rate=44100)
    for fitted in (cf.FeatureExtractor("mfcc-zcr").fit(paths), cf.FeatureExtractor("mfcc-zcr")):
        if fitted._names is None:
            fitted.fit_transform(paths)
        with pytest.raises(cf.ParameterError, match=r"44100 Hz, but .* on 16000; any_rate=True"):
            fitted.transform([other])
    assert len(fitted.set_params(any_rate=True).transform([other])) == 1
    both = cf.FeatureExtractor("mfcc-zcr").fit([*paths, other])
    assert len(both.transform([other])) == 1
    converted = cf.FeatureExtractor("mfcc-zcr", set={"signal.sample_rate": RATE}).fit(paths)
    assert len(converted.transform([other])) == 1
    first = cf.FeatureExtractor("mfcc-zcr", set={"signal.channels": [0]}).fit(paths)
    stereo = record(tmp_path / "stereo.wav", 300, 5, channels=2)
    with pytest.raises(cf.ParameterError, match="2 channels"):
        first.transform([stereo])
    signals = cf.FeatureExtractor("mfcc-zcr", sr=RATE)
    signals.fit(np.ones((2, RATE)))
    with pytest.raises(cf.ParameterError, match="8000 Hz"):
        signals.set_params(sr=8000).transform(np.ones((2, RATE)))


def test_the_command_and_python_share_models(
    recordings: tuple[list[Path], list[str]], tmp_path: Path
) -> None:
    command = os.environ.get("CORSMAL_FEAT")
    if command is None:
        pytest.skip("CORSMAL_FEAT is not set: the path of the command")
    paths, kinds = recordings
    (tmp_path / "list.csv").write_text(
        "path,kind\n" + "".join(f"{p},{k}\n" for p, k in zip(paths, kinds, strict=True))
    )

    def run(*arguments: str | Path) -> None:
        subprocess.run([command, *arguments], check=True, capture_output=True, cwd=tmp_path)

    run("extract", "list.csv", "-o", "f.npz", "--preset", "mfcc-zcr")
    run("train", "f.npz", "--target", "kind", "-o", "theirs.model")
    model = cf.load_model(tmp_path / "theirs.model")
    assert model.predict(paths).tolist() == kinds
    features = cf.load_features(tmp_path / "f.npz")
    ours = cf.KNN(1).fit(features.summary, features.labels["kind"])
    ours.save(tmp_path / "ours.model", features=features)
    run("classify", "-m", "ours.model", *paths, "-o", "p.csv")
    rows = (tmp_path / "p.csv").read_text().splitlines()[1:]
    assert [("low" if "low" in row.split(",") else "high") for row in rows] == kinds
