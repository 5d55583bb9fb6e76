"""Runs over files, their outputs, and features of signals in memory."""

from __future__ import annotations

import pickle
import subprocess
import sys
import warnings
import wave
from pathlib import Path

import corsmal_feat as cf
import numpy as np
import pytest

RATE = 22050


def pour(seed: int, seconds: float = 0.5, channels: int = 2) -> np.ndarray:
    """Noise through a resonance that depends on the seed, in 16-bit steps."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * RATE)) / RATE
    tone = np.sin(2 * np.pi * (300 + 400 * (seed % 2)) * t)
    y = 0.3 * tone + 0.05 * rng.normal(size=(channels, len(t)))
    return (np.clip(y, -0.99, 0.99) * 32768).astype(np.int16)


def floats(y: np.ndarray) -> np.ndarray:
    return (y / 32768).astype(np.float32)


def write(path: Path, y: np.ndarray) -> Path:
    with wave.open(str(path), "wb") as file:
        file.setnchannels(len(y))
        file.setsampwidth(2)
        file.setframerate(RATE)
        file.writeframes(y.T.astype("<i2").tobytes())
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    audio = tmp_path / "audio"
    audio.mkdir()
    for seed in range(3):
        write(audio / f"r{seed}.wav", pour(seed))
    return audio


def test_frames_equal_the_functions(folder: Path):
    found = cf.extract(folder, preset="logmel")
    assert found.ids == ["r0", "r1", "r2"]
    assert [o["status"] for o in found.outcomes] == ["ok"] * 3
    assert found.summary is None and found.names == []
    assert repr(found) == "<Features: 3 recordings, 0 failed, frames of melspectrogram>"
    for seed, name in enumerate(found.ids):
        for channel, y in enumerate(floats(pour(seed))):
            want = cf.power_to_db(cf.feature.melspectrogram(y=y, sr=RATE))
            np.testing.assert_allclose(found.arrays[name][channel], want, atol=1e-3)
    np.testing.assert_allclose(found.times["r0"][:3], np.arange(3) * 512 / RATE)


def test_summaries_equal_the_function(folder: Path):
    found = cf.extract(str(folder), preset="esc26")
    assert found.summary.shape == (3, 26) == (len(found), len(found.names))
    want = [cf.corsmal.esc26(floats(pour(seed)), RATE) for seed in range(3)]
    np.testing.assert_allclose(found.summary, want, rtol=1e-4, atol=1e-4)


def test_several_features_and_overrides(folder: Path):
    config = {"features": {"mfcc": {"n_mfcc": 5}, "rms": {}, "stft": {"n_fft": 256}}}
    found = cf.extract([folder / "r1.wav"], config=config, set={"mfcc.n_mfcc": np.int64(7)})
    assert {k: v.shape[:2] for k, v in found.arrays["r1"].items()} == {
        "mfcc": (2, 7),
        "rms": (2, 1),
        "stft": (2, 129),
    }
    assert found.config["features"]["mfcc"]["n_mfcc"] == 7
    assert set(found.times["r1"]) == {"mfcc", "rms", "stft"}


def test_configurations_by_file_text_and_dict_are_the_same(folder: Path, tmp_path: Path):
    text = "[features.rms]\nframe_length = 1024\n"
    (tmp_path / "c.toml").write_text(text)
    configs = (text, tmp_path / "c.toml", {"features": {"rms": {"frame_length": 1024}}})
    hashes = {cf.extract(folder, config=config).config_hash for config in configs}
    assert len(hashes) == 1


@pytest.mark.parametrize("out", ["feats.npz", "feats.parquet"])
def test_round_trip(folder: Path, tmp_path: Path, out: str):
    if out.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="reading Parquet needs pyarrow")
    listed = tmp_path / "list.csv"
    listed.write_text("path,id,container\naudio/r0.wav,a,cup\naudio/r2.wav,b,glass\n")
    path = tmp_path / out
    run = cf.extract(listed, preset="mfcc-zcr", jobs=1, out=path, set={"summary.stats": ["mean"]})
    again = cf.load_features(path)
    assert again.ids == run.ids == ["a", "b"]
    assert again.labels["container"].tolist() == ["cup", "glass"]
    np.testing.assert_array_equal(again.summary, run.summary)
    assert again.names == run.names and again.config_hash == run.config_hash
    # Everything is there: nothing is done again. Another configuration is refused.
    assert cf.extract(listed, preset="mfcc-zcr", out=path, set={"summary.stats": ["mean"]}).ids
    with pytest.raises(cf.RunError, match="another configuration"):
        cf.extract(listed, preset="esc26", out=path)
    assert len(cf.extract(listed, preset="esc26", out=path, overwrite=True).names) == 26


def test_windows_are_rows_of_their_own(folder: Path):
    found = cf.extract(folder, preset="esc26", window=0.2)
    assert found.ids[:4] == ["r0@0", "r0@0.1", "r0@0.2", "r0@0.3"]
    assert found.labels["recording"].tolist() == ["r0"] * 4 + ["r1"] * 4 + ["r2"] * 4
    apart = cf.extract(folder, preset="esc26", window=0.2, hop=0.2)
    assert apart.ids[:2] == ["r0@0", "r0@0.2"]
    np.testing.assert_array_equal(apart.summary[1], found.summary[2])
    for wrong in ({"hop": 1}, {"window": 0}, {"window": 1, "hop": -1}, {"window": float("nan")}):
        with pytest.raises(cf.ParameterError, match=r"window|hop"):
            cf.extract(folder, **wrong)
    with pytest.raises(cf.ParameterError):
        cf.extract(folder, window="long")


def test_a_bad_file_is_an_outcome(folder: Path):
    (folder / "bad.wav").write_bytes(b"RIFF and nothing else")
    found = cf.extract(folder, preset="esc26")
    assert found.ids == ["r0", "r1", "r2"] and len(found.summary) == 3
    bad = found.outcomes[0]
    assert bad["id"] == "bad" and bad["status"] != "ok" and bad["reason"]


def test_what_cannot_be_is_refused(folder: Path, tmp_path: Path):
    with pytest.raises(cf.ConfigError, match="hop_length"):
        cf.extract(folder, set={"melspectrogram.hop_length": 0})
    with pytest.raises(cf.ParameterError, match="unknown"):
        cf.extract(folder, preset="logmell")
    with pytest.raises(cf.ParameterError, match="either preset or config"):
        cf.extract(folder, preset="esc26", config={})
    with pytest.raises(cf.ParameterError, match=r"jobs must be .*, not 0"):
        cf.extract(folder, jobs=0)
    with pytest.raises(cf.ParameterError, match="need out"):
        cf.extract(folder, resume=True)
    with pytest.raises(cf.ParameterError, match="at least one"):
        cf.extract([])
    with pytest.raises(cf.RunError, match="nowhere"):
        cf.extract(tmp_path / "nowhere")
    with pytest.raises(cf.RunError):
        cf.extract(folder, out=tmp_path / "no" / "such" / "folder.npz")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    with pytest.raises(cf.ParameterError, match="not an output"):
        cf.load_features(tmp_path / "other.npz")


def test_a_fitted_projection_is_applied(folder: Path, tmp_path: Path):
    train = cf.extract([folder], preset="mfcc-zcr", out=tmp_path / "train.npz")
    fitted = tmp_path / "pca.npz"
    cf.corsmal.fit_projection(tmp_path / "train.npz", fitted, n_components=2)
    chosen = {"projection.file": str(fitted)}
    projected = cf.extract([folder], preset="mfcc-zcr", set=chosen)
    assert projected.names == ["pca[0]", "pca[1]"]
    pca = np.load(fitted)
    expected = cf.corsmal.pca_project(train.summary, pca["components"], pca["mean"])
    np.testing.assert_allclose(projected.summary, expected, rtol=1e-5, atol=1e-5)
    with pytest.raises(cf.ParameterError, match=r"projection\.file"):
        cf.extract([folder], preset="esc26", set=chosen)
    with pytest.raises(cf.ParameterError, match="exists"):
        cf.corsmal.fit_projection(tmp_path / "train.npz", fitted)


def test_a_short_recording_warns(tmp_path: Path):
    write(tmp_path / "short.wav", pour(0, seconds=0.05))
    with pytest.warns(UserWarning, match="fewer than n_fft"):
        cf.extract(tmp_path, preset="logmel")


def test_an_interrupt_stops_and_resume_continues(folder: Path, tmp_path: Path):
    long = write(folder / "long.wav", pour(0, seconds=60.0, channels=1))
    # Much more than is done before the interrupt.
    for copy in range(200):
        (folder / f"long{copy}.wav").hardlink_to(long)
    out = tmp_path / "feats.npz"
    script = f"""
import signal
import corsmal_feat as cf
signal.signal(signal.SIGALRM, signal.default_int_handler)
signal.setitimer(signal.ITIMER_REAL, 0.1)
try:
    cf.extract({str(folder)!r}, preset="esc26", jobs=1, out={str(out)!r})
except KeyboardInterrupt:
    print("interrupted")
else:
    print("finished")
"""
    run = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.strip() == "interrupted"
    # The interrupt may come when all is written, and is raised then as well.
    if not out.exists():
        assert Path(f"{out}.ledger").exists()
        with pytest.raises(cf.RunError, match="resume"):
            cf.extract(folder, preset="esc26", out=out)
    assert len(cf.extract(folder, preset="esc26", out=out, resume=True)) == 204
    assert not Path(f"{out}.ledger").exists()


@pytest.mark.parametrize("preset", ["esc26", "logmel"])
def test_blocks_do_not_matter_and_files_give_the_same(folder: Path, preset: str):
    y = floats(pour(0))
    whole = cf.SignalExtractor(RATE, 2, preset=preset)
    whole.push(y)
    blocks = cf.SignalExtractor(RATE, 2, preset=preset)
    for start in range(0, y.shape[1], 777):
        blocks.push(y[:, start : start + 777])
    file = cf.extract(folder / "r0.wav", preset=preset)
    if preset == "esc26":
        assert whole.names == file.names
        summary = whole.finish()
        np.testing.assert_array_equal(summary, blocks.finish())
        np.testing.assert_array_equal(summary, file.summary[0])
    else:
        frames = whole.finish()["melspectrogram"]
        np.testing.assert_array_equal(frames, blocks.finish()["melspectrogram"])
        np.testing.assert_array_equal(frames, file.arrays["r0"])
    with pytest.raises(cf.ParameterError, match="finished"):
        whole.push(y)


def test_infinity_is_a_value_of_a_configuration(folder: Path):
    config = {"features": {"hpss": {"power": np.inf}}}
    hard = cf.extract(folder / "r0.wav", config=config)
    assert hard.config["features"]["hpss"]["power"] == "inf"
    word = cf.extract(folder / "r0.wav", config=config, set={"hpss.power": "inf"})
    by_key = {"features": {"hpss": {}}}
    key = cf.extract(folder / "r0.wav", config=by_key, set={"hpss.power": float("inf")})
    assert hard.config_hash == word.config_hash == key.config_hash


def test_transformer_over_paths_and_arrays(folder: Path):
    paths = [folder / f"r{i}.wav" for i in (2, 0, 2, 1)]
    of_paths = cf.FeatureExtractor("esc26").fit_transform(paths)
    signals = [floats(pour(i)) for i in (2, 0, 2, 1)]
    extractor = cf.FeatureExtractor("esc26", sr=RATE, jobs=2)
    np.testing.assert_array_equal(extractor.fit_transform(signals), of_paths)
    np.testing.assert_array_equal(extractor.transform(np.stack(signals)), of_paths)
    assert extractor.get_feature_names_out()[-1] == "zero_crossing_rate.std"
    back = pickle.loads(pickle.dumps(extractor))
    np.testing.assert_array_equal(back.transform(signals), of_paths)
    assert f"sr={RATE}" in repr(extractor) and "config" not in repr(extractor)


def test_transformer_refuses(folder: Path):
    signal = floats(pour(0))
    with pytest.raises(cf.ParameterError, match="summary"):
        cf.FeatureExtractor("logmel").fit([signal])
    with pytest.raises(cf.ParameterError, match="sr"):
        cf.FeatureExtractor().transform([signal])
    with pytest.raises(cf.ParameterError, match="jobs must be 1 to"):
        cf.FeatureExtractor(sr=RATE, jobs=0).transform([signal])
    with pytest.raises(cf.ParameterError, match="mixes"):
        cf.FeatureExtractor(sr=RATE).transform([signal, "x.wav"])
    with pytest.raises(cf.ParameterError, match="the number of channels differs"):
        cf.FeatureExtractor("mfcc-zcr", set={"summary.stats": ["mean"]}, sr=RATE).transform(
            [signal, signal[0]]
        )
    with pytest.raises(cf.ParameterError, match="but fit saw"):
        cf.FeatureExtractor("mfcc-zcr", set={"summary.stats": ["mean"]}, sr=RATE).fit(
            [signal]
        ).transform([signal[0]])
    for frames in (60, 1000, 88200):
        with pytest.raises(cf.ParameterError, match="transpose it"):
            cf.FeatureExtractor("mfcc-zcr", sr=RATE).fit_transform([np.zeros((frames, 2))])
    with pytest.raises(cf.ParameterError, match="transpose it"):
        cf.SignalExtractor(RATE, channels=2, preset="mfcc-zcr").push(np.zeros((900, 2)))
    with pytest.raises(cf.NotFittedError, match="not fitted"):
        cf.FeatureExtractor().get_feature_names_out()
    (folder / "bad.wav").write_bytes(b"RIFF")
    with pytest.raises(cf.DecodeError, match=r"bad\.wav"):
        cf.FeatureExtractor().transform([folder / "r0.wav", folder / "bad.wav"])


def test_transformer_in_scikit_learn(folder: Path):
    base = pytest.importorskip("sklearn.base")
    pipeline = pytest.importorskip("sklearn.pipeline")
    selection = pytest.importorskip("sklearn.model_selection")
    preprocessing = pytest.importorskip("sklearn.preprocessing")
    signals = [floats(pour(seed)) for seed in range(12)]
    labels = np.array(["low", "high"])[np.arange(12) % 2]
    model = pipeline.make_pipeline(
        cf.FeatureExtractor("esc26", sr=RATE), preprocessing.StandardScaler(), cf.KNN(1)
    )
    scores = selection.cross_val_score(model, signals, labels, cv=3, error_score="raise")
    np.testing.assert_array_equal(scores, 1)
    search = selection.GridSearchCV(
        model, {"featureextractor__preset": ["esc26", "esc28"]}, cv=2, error_score="raise"
    )
    assert search.fit(signals, labels).best_score_ == 1
    model.fit([folder / "r0.wav", folder / "r1.wav"], ["low", "high"])
    assert model.predict([folder / "r1.wav"]).tolist() == ["high"]
    assert len(model[:-1].get_feature_names_out()) == 26
    assert base.clone(model[0]).get_params() == model[0].get_params()
    assert isinstance(model[0], base.TransformerMixin)


def test_transformer_takes_a_table_with_one_column_of_paths(folder: Path):
    pandas = pytest.importorskip("pandas", reason="pandas is absent")
    paths = [str(folder / f"r{i}.wav") for i in (0, 1)]
    wanted = cf.FeatureExtractor("esc26").fit_transform(paths)
    table = pandas.DataFrame({"path": paths, "class": ["a", "b"]})
    for one in (table[["path"]], np.array(paths)[:, None], np.array(paths, object)[:, None]):
        np.testing.assert_array_equal(cf.FeatureExtractor("esc26").fit_transform(one), wanted)
    with pytest.raises(cf.ParameterError, match=r"2 columns \(path, class\)"):
        cf.FeatureExtractor("esc26").fit(table)
    signals = np.stack([floats(pour(i)).ravel()[:RATE] for i in (0, 1)])
    rows = cf.FeatureExtractor("esc26", sr=RATE).fit_transform(signals)
    of_table = cf.FeatureExtractor("esc26", sr=RATE).fit_transform(pandas.DataFrame(signals))
    np.testing.assert_array_equal(of_table, rows)


def test_transformer_gives_data_frames(folder: Path):
    pytest.importorskip("sklearn", reason="set_output is scikit-learn's")
    pandas = pytest.importorskip("pandas", reason="pandas is absent")
    extractor = cf.FeatureExtractor("esc26").set_output(transform="pandas")
    table = extractor.fit_transform([folder / "r0.wav", folder / "r1.wav"])
    assert isinstance(table, pandas.DataFrame)
    assert table.columns[-1] == "zero_crossing_rate.std"


#: scikit-learn's checks of what a transformer of recordings does not claim
NOT_OURS = {
    "check_n_features_in": "recordings differ in length",
    "check_n_features_in_after_fitting": "recordings differ in length",
    "check_estimators_dtypes": "integer samples are refused with a hint",
}


def test_scikit_learns_own_checks():
    checks = pytest.importorskip("sklearn.utils.estimator_checks")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        results = checks.check_estimator(
            cf.FeatureExtractor("esc26", sr=RATE), on_fail=None, expected_failed_checks=NOT_OURS
        )
    failed = [f"{r['check_name']}: {r['exception']}" for r in results if r["status"] == "failed"]
    assert not failed, "\n".join(failed)
    assert sum(r["status"] == "passed" for r in results) >= 35


def test_import_is_light():
    script = "import sys, corsmal_feat; print({'sklearn', 'pyarrow'} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"


def test_everything_works_without_scikit_learn(tmp_path: Path):
    script = f"""
import sys
sys.modules["sklearn"] = None
import numpy as np
import corsmal_feat as cf
y = np.random.default_rng(0).normal(size=(6, {RATE})).astype(np.float32)
extractor = cf.FeatureExtractor("esc26").set_params(sr={RATE})
model = cf.KNN(n_neighbors=1).fit(extractor.fit_transform(y), list("ababab"))
assert model.score(extractor.transform(y), list("ababab")) == 1
assert repr(model) == "KNN(n_neighbors=1)"
try:
    cf.SVC(C=2.0).predict(y)
except cf.NotFittedError:
    print("fine")
"""
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "fine"
