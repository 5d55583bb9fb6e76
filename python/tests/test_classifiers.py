"""The classifiers on their own: no scikit-learn needed."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from corsmal_feat import ModelError, NotFittedError, ParameterError, classifiers

ALL = [
    classifiers.KNN(),
    classifiers.SVC(probability=True),
    classifiers.DecisionTree(),
    classifiers.RandomForest(20),
    classifiers.ExtraTrees(20),
    classifiers.LogisticRegression(),
]


def clouds(rows: int = 150, classes: tuple[object, ...] = ("full", "half", "empty")):
    rng = np.random.default_rng(0)
    which = np.arange(rows) % len(classes)
    x = rng.normal(size=(len(classes), 6))[which] * 2 + rng.normal(size=(rows, 6))
    return x, np.array(classes)[which]


def fresh(estimator):
    return type(estimator)(**estimator.get_params())


@pytest.mark.parametrize("estimator", ALL, ids=lambda e: type(e).__name__)
@pytest.mark.parametrize("classes", [("full", "half", "empty"), (3, -1, 7), (True, False)])
def test_fit_predict_save_load_pickle(estimator, classes, tmp_path: Path):
    x, y = clouds(classes=classes)
    model = fresh(estimator).fit(x[:100], y[:100])
    assert model.score(x[100:], y[100:]) > 0.8
    np.testing.assert_array_equal(model.classes_, np.unique(y))
    proba = model.predict_proba(x)
    assert proba.shape == (len(x), len(classes))
    np.testing.assert_allclose(proba.sum(axis=1), 1)
    path = tmp_path / "model"
    model.save(path)
    model.save(path)  # replaces the file, as numpy.save does
    with pytest.raises(ParameterError, match=r"model' already exists: overwrite=True replaces it"):
        model.save(path, overwrite=False)
    model.save(tmp_path / "new", overwrite=False)
    assert (tmp_path / "new").read_bytes() == path.read_bytes()
    for back in (
        type(model).load(path),
        classifiers.load_model(path),
        pickle.loads(pickle.dumps(model)),
    ):
        np.testing.assert_array_equal(back.predict(x), model.predict(x))
        np.testing.assert_array_equal(back.predict_proba(x), proba)
        assert back.classes_.dtype.kind == model.classes_.dtype.kind
    assert type(model).load(path).get_params().keys() == model.get_params().keys()


def test_files_of_another_classifier_and_damaged_files_are_refused(tmp_path: Path):
    x, y = clouds()
    path = tmp_path / "model"
    classifiers.KNN().fit(x, y).save(path)
    with pytest.raises(ModelError, match="holds knn, not rf"):
        classifiers.RandomForest.load(path)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    with pytest.raises(ModelError, match="damaged"):
        classifiers.load_model(path)


@pytest.mark.parametrize("estimator", ALL, ids=lambda e: type(e).__name__)
def test_bad_input_is_refused(estimator):
    x, y = clouds()
    model = fresh(estimator)
    with pytest.raises(NotFittedError, match="not fitted"):
        model.predict(x)
    model.fit(x, y)
    with pytest.raises(ParameterError, match="X has 5 features, but"):
        model.predict(x[:, :5])
    for value, word in ((np.nan, "NaN"), (np.inf, "infinity")):
        bad = x.copy()
        bad[3, 2] = value
        with pytest.raises(ParameterError, match=word):
            model.fit(bad, y)
        with pytest.raises(ParameterError, match=word):
            model.predict(bad)
    with pytest.raises(ParameterError, match="1D array"):
        model.fit(x[0], y)
    with pytest.raises(ParameterError, match="149 labels"):
        model.fit(x, y[1:])
    with pytest.raises(ParameterError, match="continuous"):
        model.fit(x, x[:, 0])


def test_parameters_are_refused_by_name():
    x, y = clouds()
    with pytest.raises(ParameterError, match=r"C must be .*, not -1"):
        classifiers.SVC(C=-1).fit(x, y)
    with pytest.raises(ParameterError, match="metric"):
        classifiers.KNN(metric="canberra").fit(x, y)
    with pytest.raises(ValueError, match="Invalid parameter 'k'"):
        classifiers.KNN().set_params(k=3)


def test_seeds_decide_and_class_weights_count():
    x, y = clouds()
    forest = classifiers.RandomForest(10, random_state=3)
    first = forest.fit(x, y).predict_proba(x)
    np.testing.assert_array_equal(first, fresh(forest).fit(x, y).predict_proba(x))
    assert (first != forest.set_params(random_state=4).fit(x, y).predict_proba(x)).any()
    weighted = classifiers.LogisticRegression(class_weight={"full": 50.0}).fit(x, y)
    plain = classifiers.LogisticRegression().fit(x, y)
    assert (weighted.predict(x) == "full").sum() > (plain.predict(x) == "full").sum()


def test_no_scikit_learn_is_imported():
    code = "import sys, corsmal_feat; sys.exit('sklearn' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_bytes_are_no_labels() -> None:
    x, _ = clouds(4)
    for y in (np.array([b"a", b"b"] * 2), np.array([b"a", b"b"] * 2, dtype=object)):
        with pytest.raises(ParameterError, match="y holds bytes, expected strings"):
            classifiers.KNN(1).fit(x, y)


def test_saved_labels_come_back_in_their_type(tmp_path: Path) -> None:
    x, y = clouds(12, (3, 1, 2))
    model = classifiers.KNN(1)
    for labels in (y, y.astype(object), y > 1, (y > 1).astype(object), y.astype(str)):
        model.fit(x, labels).save(tmp_path / "a.model")
        found = classifiers.KNN.load(tmp_path / "a.model").predict(x)
        np.testing.assert_array_equal(found, labels)
        (tmp_path / "a.model").unlink()
    pairs = np.empty(len(y), dtype=object)
    pairs[:] = [(int(v), "of 3") for v in y]
    for other in (y.astype("datetime64[D]"), pairs):
        model.fit(x, other)
        with pytest.raises(ParameterError, match="a model file keeps classes that are texts"):
            model.save(tmp_path / "a.model")
    model.fit(x, y.astype("u8") + np.uint64(2**63))
    with pytest.raises(ParameterError, match=r"whole numbers up to 2\*\*63 - 1"):
        model.save(tmp_path / "a.model")


def test_parameters_must_be_finite() -> None:
    x, y = clouds()
    with pytest.raises(ParameterError, match="SVC: C must be a finite number, not nan"):
        classifiers.SVC(C=float("nan")).fit(x, y)
    weights = {"full": float("inf")}
    with pytest.raises(ParameterError, match="class_weight must be a finite number, not inf"):
        classifiers.SVC(class_weight=weights).fit(x, y)


@pytest.mark.parametrize(
    "estimator",
    [
        classifiers.KNN(algorithm="linfa"),
        classifiers.SVC(solver="linfa"),
        classifiers.DecisionTree(solver="linfa"),
    ],
    ids=lambda e: type(e).__name__,
)
def test_linfas_solvers_learn_and_survive_the_disk(estimator, tmp_path: Path):
    x, y = clouds()
    model = fresh(estimator).fit(x[:100], y[:100])
    assert model.score(x[100:], y[100:]) > 0.75
    model.save(tmp_path / "model")
    back = type(model).load(tmp_path / "model")
    np.testing.assert_array_equal(back.predict(x), model.predict(x))
    name = "algorithm" if isinstance(estimator, classifiers.KNN) else "solver"
    assert getattr(back, name) == "linfa"
    with pytest.raises(ParameterError, match=r"(own|brute) or linfa"):
        type(estimator)(**{name: "fast"}).fit(x, y)


@pytest.mark.parametrize("kind", ["SVC", "LogisticRegression", "RandomForest", "DecisionTree"])
def test_weights_of_classes_that_do_not_exist_are_refused(kind: str) -> None:
    x, y = np.arange(8.0).reshape(-1, 1), ["Dog", "Rain"] * 4
    for weights in ({"rain": 5}, {0: 5}, {"Rain": 5, "x": 3}):
        with pytest.raises(ParameterError, match=r"class_weight has .* no label in y"):
            getattr(classifiers, kind)(class_weight=weights).fit(x, y)
    # One of all classes may be missing in a fold.
    for weights in ({"Rain": 5}, {"Rain": 5, "Dog": 1, "x": 3}, {}):
        getattr(classifiers, kind)(class_weight=weights).fit(x, y)


def test_weights_of_classes_keep_their_names(tmp_path: Path) -> None:
    """After loading, they stood for the labels of any other training."""
    x = np.random.default_rng(0).standard_normal((60, 2))
    classes = np.digitize(x[:, 0], [-0.4, 0.4])
    weights = {"a": 5.0, "b": 1.0, "c": 0.1}
    classifiers.SVC(class_weight=weights).fit(x, np.array(list("abc"))[classes]).save(
        tmp_path / "c.model"
    )
    loaded = classifiers.SVC.load(tmp_path / "c.model")
    assert loaded.class_weight == weights
    with pytest.raises(ParameterError, match=r"class_weight has .* no label in y"):
        loaded.fit(x, np.array(list("xyz"))[classes])
