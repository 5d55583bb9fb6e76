"""What a run wrote as an object: by id, as a data frame, in a notebook; files of others."""

from __future__ import annotations

import os
import pickle
import subprocess
from pathlib import Path

import corsmal_feat as cf
import numpy as np
import pytest
import soundfile

CASES = Path(os.environ.get("CORSMAL_SHARED", "../shared")) / "cases"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("audio")
    rng = np.random.default_rng(5)
    for name, seconds in (("a", 0.5), ("b", 1.0)):
        samples = 0.1 * rng.standard_normal((int(16000 * seconds), 2))
        soundfile.write(folder / f"{name}.wav", samples, 16000)
    (folder / "bad.wav").write_bytes(b"no audio at all")
    return folder


@pytest.fixture(scope="module")
def summary(folder: Path) -> cf.Features:
    return cf.extract([folder], preset="mfcc-zcr")


@pytest.fixture(scope="module")
def frames(folder: Path) -> cf.Features:
    return cf.extract([folder], preset="logmel")


def test_by_id(summary: cf.Features, frames: cf.Features) -> None:
    assert list(summary) == summary.ids == ["a", "b"] and "a" in summary and "c" not in summary
    assert summary.summary is not None
    assert np.array_equal(summary["b"], summary.summary[1])
    assert np.array_equal(frames["a"], frames.arrays["a"])
    for features in (summary, frames):
        with pytest.raises(KeyError, match="has the id 'c'"):
            features["c"]
        with pytest.raises(cf.CorsmalFeatError):
            features["bad"]


def test_frames_are_read_when_they_are_asked_for(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "frames.npz"
    config = {"features": {"mfcc": {}, "rms": {}}}
    whole = cf.extract([folder], config=config)
    cf.extract([folder], config=config, out=out)
    features = cf.load_features(out)
    assert "2 recordings, 0 read" in repr(features.arrays)
    assert list(features.arrays) == ["a", "b"] and "c" not in features.arrays
    assert features["b"].keys() == whole["b"].keys()
    assert "2 recordings, 1 read" in repr(features.arrays)
    assert features["b"] is features["b"], "it is kept"
    for name, values in whole["b"].items():
        assert np.array_equal(features["b"][name], values)
        assert np.array_equal(features.times["b"][name], whole.times["b"][name])
    with pytest.raises(KeyError):
        features.arrays["c"]
    # As with a dict, an array can be replaced, and another process is sent them all.
    features.arrays["b"] = {"rms": np.zeros(3)}
    del features.arrays["a"]
    sent = pickle.loads(pickle.dumps(features))
    assert type(sent.arrays) is dict and sent["b"]["rms"].sum() == 0 and len(sent.arrays) == 1


def test_many_rows_are_found_at_once() -> None:
    """A search through the list for each of 200,000 ids took a quarter of an hour."""
    ids = [f"r{i}" for i in range(200_000)]
    summary = np.arange(200_000, dtype=np.float32)[:, None]
    features = cf.Features(ids, {}, {}, summary, ["x"], {}, {}, "", [])
    assert sum(float(features[i][0]) for i in ids if i in features) == 199_999 * 100_000


def test_frames_from_parquet(tmp_path: Path, folder: Path) -> None:
    pytest.importorskip("pyarrow", reason="reading Parquet needs pyarrow")
    soundfile.write(tmp_path / "short.wav", np.zeros((10, 1)), 16000)
    paths = [folder, tmp_path / "short.wav"]
    for features in ({"mfcc": {}}, {"mfcc": {"n_mfcc": 4}, "rms": {}}):
        outs = [tmp_path / f"{len(features)}.{kind}" for kind in ("npz", "parquet")]
        for out in outs:
            with pytest.warns(UserWarning, match="10 samples are fewer than n_fft"):
                cf.extract(paths, config={"features": features}, out=out)
        npz, parquet = (cf.load_features(out) for out in outs)
        assert parquet.summary is None and parquet.ids == npz.ids and len(npz) >= 2
        assert (parquet.config, parquet.outcomes) == (npz.config, npz.outcomes)
        np.testing.assert_equal(parquet.arrays, dict(npz.arrays))
        np.testing.assert_equal(parquet.times, dict(npz.times))
        assert parquet.labels == npz.labels == {}
    pyarrow, tables = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    table = tables.read_table(outs[1])
    at = table.column_names.index("rms")
    field = table.schema.field("rms")
    for lists in ([[1.0, 2.0], [3.0]], [[1.0, 2.0, 3.0], [4.0]]):
        ragged = pyarrow.array([[lists]] * len(table), field.type)
        tables.write_table(table.set_column(at, field, ragged), outs[1])
        with pytest.raises(cf.ParameterError, match=r"the lists of rms differ in length"):
            cf.load_features(outs[1])


def test_data_frames(folder: Path, summary: cf.Features, frames: cf.Features) -> None:
    pandas = pytest.importorskip("pandas")
    table = summary.to_frame()
    assert table.index.names == ["file", "start", "end"]
    assert table.index.get_level_values("file")[0] == str(folder / "a.wav")
    ends = table.index.get_level_values("end")
    assert list(ends) == [pandas.Timedelta("0.5s"), pandas.Timedelta("1s")]
    assert list(table.columns) == summary.names
    assert np.array_equal(table.to_numpy(), summary.summary)
    table = frames.to_frame()
    assert len(table) == sum(frames.arrays[i].shape[2] for i in frames.ids)
    first = next(iter(frames.config["features"]))
    column = table[f"{first}[1][5]"].to_numpy()
    assert np.array_equal(column, np.concatenate([frames[i][1, 5] for i in frames.ids]))
    starts = table.index.get_level_values("start").total_seconds().to_numpy()
    times = np.concatenate([frames.times[i] for i in frames.ids])
    np.testing.assert_allclose(starts, times, atol=1e-6)


def test_data_frames_of_windows_say_where_they_are(folder: Path) -> None:
    pandas = pytest.importorskip("pandas")
    windows = cf.extract([folder / "a.wav"], preset="mfcc-zcr", window=0.2, hop=0.1)
    starts = windows.to_frame().index.get_level_values("start")
    assert list(starts[:3]) == [pandas.Timedelta(f"{k}ms") for k in (0, 100, 200)]
    ends = windows.to_frame().index.get_level_values("end")
    assert (ends[:2] - starts[:2] == pandas.Timedelta("200ms")).all()
    frames = cf.extract(
        [folder / "a.wav"], config={"features": {"rms": {}}}, window=0.2, hop=0.2
    ).to_frame()
    index = frames.index
    assert not index.duplicated().any()
    assert index.get_level_values("start").max() >= pandas.Timedelta("200ms")


def test_rows_of_a_signal_that_begins_later_say_so(folder: Path) -> None:
    pandas = pytest.importorskip("pandas")
    table = cf.extract([folder / "a.wav"], preset="mfcc-zcr", set={"signal.start": 0.25}).to_frame()
    assert list(table.index.get_level_values("start")) == [pandas.Timedelta("250ms")]


def test_labels_may_have_any_name_in_both_formats(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    manifest = tmp_path / "list.csv"
    manifest.write_text(f"path,__note,kind\n{folder / 'a.wav'},x,y\n", encoding="utf-8")
    for out in (tmp_path / "f.npz", tmp_path / "f.parquet"):
        cf.extract([manifest], preset="mfcc-zcr", out=out)
        assert list(cf.load_features(out).labels) == ["__note", "kind"]


def test_notebooks(summary: cf.Features) -> None:
    html = summary._repr_html_()
    assert html.count("<tr>") == 4 and "not_audio" in html


def test_progress(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    told: list[tuple[int, int]] = []
    cf.extract([folder], progress=lambda done, total: told.append((done, total)))
    assert told[-1] == (3, 3) and told == sorted(told)
    cf.extract([folder], progress=True)
    assert "3 of 3 recordings" in capfd.readouterr().err

    def stop(done: int, total: int) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        cf.extract([folder], progress=stop)


def test_rows_of_nan(folder: Path) -> None:
    paths = [str(folder / name) for name in ("a.wav", "bad.wav", "b.wav")]
    with pytest.raises(cf.DecodeError, match=r"bad\.wav: not_audio"):
        cf.FeatureExtractor("esc26").fit_transform(paths)
    with pytest.warns(UserWarning, match="the row is NaN"):
        rows = cf.FeatureExtractor("esc26", errors="nan").fit_transform(paths)
    assert np.isnan(rows[1]).all() and np.isfinite(rows[[0, 2]]).all()
    with pytest.warns(UserWarning, match="no such file"):
        around = cf.FeatureExtractor("esc26", errors="nan").fit_transform(
            [str(folder / "gone.wav"), *paths[::2]]
        )
    assert np.isnan(around[0]).all() and np.array_equal(around[1:], rows[[0, 2]])
    with pytest.raises(cf.DecodeError, match="no such file"):
        cf.FeatureExtractor("esc26", errors="nan").fit_transform([str(folder / "gone.wav")])
    # Names of columns come from the first recording that has features.
    for first in ("bad.wav", "gone.wav"):
        extractor = cf.FeatureExtractor("esc26", errors="nan")
        assert len(extractor.fit([str(folder / first), *paths]).get_feature_names_out()) == 26
    with pytest.raises(cf.DecodeError, match=r"bad\.wav: not_audio"):
        cf.FeatureExtractor("esc26", errors="nan").fit([str(folder / "bad.wav")])
    with pytest.raises(cf.ParameterError, match="'raise' or 'nan'"):
        cf.FeatureExtractor("esc26", errors="skip").fit_transform(paths)


def test_files_of_others_are_refused_in_words(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(cf.ParameterError, match=r"corsmal_feat\.load reads"):
        cf.load_features(folder / "a.wav")
    np.save(tmp_path / "one.npy", np.zeros(3))
    with pytest.raises(cf.ParameterError, match="a single array"):
        cf.load_features(tmp_path / "one.npy")
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(cf.ParameterError, match="no __meta__"):
        cf.Features.load(tmp_path / "other.npz")
    np.savez(tmp_path / "named.npz", a=np.zeros(3), b=np.array([None, {}], dtype=object))
    with pytest.raises(cf.ParameterError, match="b holds Python objects"):
        cf.load_features(tmp_path / "named.npz")
    objects = {"__meta__": np.array([None, {}], dtype=object)}
    np.savez(tmp_path / "objects.npz", **objects)
    with pytest.raises(cf.ParameterError, match="holds Python objects"):
        cf.load_features(tmp_path / "objects.npz")


def test_parquet_edited_by_pandas(tmp_path: Path, folder: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    path = tmp_path / "table.parquet"
    kept = cf.extract([folder], preset="mfcc-zcr", out=path)
    table = pandas.read_parquet(path)
    table["rating"] = ["good", "bad"]
    table.to_parquet(path)
    again = cf.load_features(path)
    assert again.ids == kept.ids and again.names == kept.names
    assert np.array_equal(again.summary, kept.summary)
    assert list(again.labels["rating"]) == ["good", "bad"]


def test_edited_tables_that_cannot_be_right_are_refused(tmp_path: Path, folder: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    path = tmp_path / "table.parquet"
    kept = cf.extract([folder], preset="mfcc-zcr", out=path)
    table = pandas.read_parquet(path)
    name = kept.names[3]

    whole = table.assign(**{name: [3, 4]})
    whole.to_parquet(path)
    again = cf.load_features(path)
    assert again.names == kept.names
    assert list(again.summary[:, 3]) == [3.0, 4.0]
    model = cf.DecisionTree().fit(again.summary, ["a", "b"])
    with pytest.raises(cf.ParameterError, match="has no configuration"):
        model.save(tmp_path / "tree.model", features=again)

    pandas.concat([table, table]).to_parquet(path)
    with pytest.raises(cf.ParameterError, match="rows 0 and 2 have the same id, 'a'"):
        cf.load_features(path)
    table.assign(id=["a", None]).to_parquet(path)
    with pytest.raises(cf.ParameterError, match="row 1 has no id"):
        cf.load_features(path)
    table.assign(takes=[[1, 2], [3]]).to_parquet(path)
    with pytest.warns(UserWarning, match="takes is left out: it holds list"):
        assert cf.load_features(path).names == kept.names
    gaps = table.assign(level=pandas.array([90, None], dtype="Int64"), text=["a", None])
    gaps.to_parquet(path)
    again = cf.load_features(path)
    assert again.names == kept.names
    assert list(again.labels["level"]) == ["90", ""] and list(again.labels["text"]) == ["a", ""]


def test_a_model_never_mixes_columns(tmp_path: Path, folder: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "table.parquet"
    kept = cf.extract([folder], preset="mfcc-zcr", out=path)
    table = pq.read_table(path)
    # Such a table keeps what this package wrote into it.
    pq.write_table(table.select(["id", *kept.names[::-1]]), path)
    turned = cf.load_features(path)
    assert turned.names == kept.names[::-1]
    model = cf.DecisionTree().fit(turned.summary, ["a", "b"])
    with pytest.raises(cf.ParameterError, match="in that order"):
        model.save(tmp_path / "tree.model", features=turned)


def test_the_command_and_python_read_edited_tables_alike(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    command = os.environ.get("CORSMAL_FEAT")
    if not command:
        pytest.skip("CORSMAL_FEAT is not set: the path of the command")
    for take in range(8):
        noise = np.random.default_rng(take).standard_normal(4000)
        soundfile.write(tmp_path / f"{take}.wav", 0.1 * noise, 8000)
    path = tmp_path / "table.parquet"
    kept = cf.extract([tmp_path], preset="mfcc-zcr", out=path)
    table = pandas.read_parquet(path)
    table[kept.names[0]] = np.arange(8)
    table["class"] = ["a", "b"] * 4
    table["take"] = np.arange(8)
    table.to_parquet(path)
    assert cf.load_features(path).names == kept.names
    model = tmp_path / "tree.model"
    args = ["train", path, "--target", "class", "--classifier", "tree", "-o", model]
    subprocess.run([command, *args], check=True)
    assert cf.load_model(model).n_features_in_ == len(kept.names)


def test_a_file_is_known_by_its_content(tmp_path: Path, folder: Path) -> None:
    pytest.importorskip("pyarrow")
    for ending in (".npz", ".parquet"):
        kept = cf.extract([folder], preset="mfcc-zcr", out=tmp_path / f"f{ending}")
        (tmp_path / f"f{ending}").rename(tmp_path / "features")
        assert np.array_equal(cf.load_features(tmp_path / "features").summary, kept.summary)


def test_parquet_edited_by_polars(tmp_path: Path, folder: Path) -> None:
    polars = pytest.importorskip("polars")
    pytest.importorskip("pyarrow")
    path = tmp_path / "table.parquet"
    kept = cf.extract([folder], preset="mfcc-zcr", out=path)
    table = polars.read_parquet(path)
    table = table.with_columns(polars.Series("rating", ["good", "bad"])).reverse()
    table.write_parquet(path)
    again = cf.load_features(path)
    assert again.ids == kept.ids[::-1] and again.names == kept.names
    assert np.array_equal(again.summary, kept.summary[::-1])
    assert list(again.labels["rating"]) == ["bad", "good"]
    assert "2 recordings, outcomes unknown, summary" in repr(again)
    assert again.to_frame().shape == (2, len(kept.names) + 1)


def test_a_cache_extracts_once(
    tmp_path: Path, folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pipeline = pytest.importorskip("sklearn.pipeline")
    paths, labels = [str(folder / "a.wav"), str(folder / "b.wav")], ["a", "b"]
    steps = cf.FeatureExtractor("esc26", progress=True), cf.KNN(1)
    told = []
    for _ in range(2):
        model = pipeline.make_pipeline(*steps, memory=str(tmp_path / "cache"))
        model.fit(paths, labels)
        told.append("2 of 2 recordings" in capfd.readouterr().err)
        assert model.predict(paths).tolist() == labels
        capfd.readouterr()
    assert told == [True, False]


def test_labels_that_are_objects_are_said(tmp_path: Path) -> None:
    y = np.array(["a", "b"] * 10, dtype=object)
    np.savez(tmp_path / "table.npz", X=np.arange(40.0).reshape(20, 2), y=y)
    with pytest.raises(cf.ParameterError, match=r'member "y": holds Python objects'):
        cf.cross_validate(tmp_path / "table.npz", "y", cv=2)
    np.savez(tmp_path / "table.npz", X=np.arange(40.0).reshape(20, 2), y=y.astype(str))
    assert cf.cross_validate(tmp_path / "table.npz", "y", cv=2).predictions.labels == ["a", "b"]


def test_ids_with_gaps_are_refused(tmp_path: Path) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    columns = {"id": [1.0, None, 3.0, 4.0], "x": [0.5, 1.5, 0.25, 1.25], "y": ["a", "b"] * 2}
    pq.write_table(pa.table(columns), tmp_path / "table.parquet")
    with pytest.raises(cf.ParameterError, match=r'column "id" has decimal numbers'):
        cf.cross_validate(tmp_path / "table.parquet", "y", cv=2)


def test_parquet_of_the_shared_cases() -> None:
    if not (CASES / "own_ed.parquet").exists():
        pytest.skip("no shared cases here")
    features = cf.load_features(CASES / "own_ed.parquet")
    assert len(features) and features.names


def test_whole_numbers_are_features_where_they_are_named_so(tmp_path: Path) -> None:
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    classes = [0, 1] * 10
    columns = {
        "id": [str(row) for row in range(20)],
        "mfcc[0].mean": np.random.default_rng(0).random(20),
        "rms.max": classes[::-1],
        # These were features, and told the class.
        "class.code": classes,
        "speaker.id": [row // 4 for row in range(20)],
        "y": ["a", "b"] * 10,
    }
    path = tmp_path / "table.parquet"
    pq.write_table(pa.table(columns), path)
    features = cf.load_features(path)
    assert features.names == ["mfcc[0].mean", "rms.max"]
    assert set(features.labels) == {"class.code", "speaker.id", "y"}
    report = cf.cross_validate(path, "y", groups="speaker.id", classifier="tree")
    assert report.report["n_features"] == 2
    for codec in ("gzip", "lz4", "brotli"):
        pq.write_table(pa.table(columns), path, compression=codec)
        with pytest.raises(cf.ParameterError, match=f"snappy or zstd .*a column with {codec}"):
            cf.cross_validate(path, "y", cv=2)


def test_features_are_compared_as_objects_and_found_by_id(folder: Path) -> None:
    features = cf.extract([folder / "a.wav"], preset="mfcc-zcr")
    assert features == features and features != cf.extract([folder / "a.wav"], preset="mfcc-zcr")
    for no_id in (slice(0, 1), [1], {}):
        assert no_id not in features
        with pytest.raises(cf.UnknownIdError):
            features[no_id]  # type: ignore[index]
