"""What scikit-learn's tools ask of classifiers beside labels and probabilities."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn")

import corsmal_feat as cf
from corsmal_feat.classifiers import (
    KNN,
    SVC,
    DecisionTree,
    ExtraTrees,
    LogisticRegression,
    RandomForest,
)
from sklearn import ensemble, linear_model, neighbors, svm, tree
from sklearn.base import clone
from sklearn.calibration import CalibratedClassifierCV
from sklearn.ensemble import BaggingClassifier
from sklearn.inspection import permutation_importance
from sklearn.model_selection import cross_val_score
from sklearn.multiclass import OneVsRestClassifier

FORESTS = [
    (RandomForest, ensemble.RandomForestClassifier, {"bootstrap": True}),
    (ExtraTrees, ensemble.ExtraTreesClassifier, {"bootstrap": True}),
]


@pytest.mark.parametrize("columns", [[0, 1, 2], [10, 7, 8]])
def test_columns_of_a_data_frame_whose_names_are_numbers_keep_their_order(
    columns: list[int],
) -> None:
    pandas = pytest.importorskip("pandas")
    x = np.random.default_rng(0).standard_normal((60, 3))
    y = np.where(x[:, 0] > 0, "p", "n")
    table = pandas.DataFrame(x, columns=columns)
    tree = DecisionTree().fit(table, y)
    assert tree.score(table, y) == tree.score(x, y) == 1
    for other in (table[columns[::-1]], table.set_axis(["a", "b", "c"], axis=1)):
        with pytest.raises(cf.ParameterError, match="feature names"):
            tree.predict(other)
    named = DecisionTree().fit(table.set_axis(["a", "b", "c"], axis=1), y)
    with pytest.raises(cf.ParameterError, match="feature names"):
        named.predict(table)
    with pytest.raises(TypeError, match="column names of X are strings and others"):
        named.predict(table.set_axis(["a", 1, "c"], axis=1))


def test_tables_of_pyarrow_have_no_names() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    x = np.random.default_rng(0).standard_normal((20, 2))
    y = np.where(x[:, 0] > 0, "p", "n")
    table = pyarrow.table({"a": x[:, 0], "b": x[:, 1]})
    tree = DecisionTree().fit(table, y)
    assert tree.predict(table.slice(0, 5)).tolist() == y[:5].tolist()
    assert not hasattr(tree, "feature_names_in_")


def clouds(rows: int, features: int, classes: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    which = np.arange(rows) % classes
    x = 1.5 * rng.standard_normal((classes, features))[which] + rng.standard_normal(
        (rows, features)
    )
    return x, np.array([f"class {c}" for c in which])


@pytest.mark.parametrize("classes", [2, 3, 5])
@pytest.mark.parametrize("kernel", ["rbf", "linear"])
def test_decision_functions_are_scikit_learns(classes: int, kernel: str) -> None:
    x, y = clouds(120, 4, classes)
    ours = SVC(kernel=kernel, tol=1e-6).fit(x, y)
    theirs = svm.SVC(kernel=kernel, tol=1e-6).fit(x, y)
    values, wanted = ours.decision_function(x), theirs.decision_function(x)
    assert values.shape == wanted.shape
    np.testing.assert_allclose(values, wanted, atol=1e-3)
    # Of several classes with equal votes `predict` takes the first one, the values another.
    if classes == 2:
        assert np.array_equal(ours.classes_[(values > 0).astype(int)], ours.predict(x))
    else:
        assert np.array_equal(values.argmax(axis=1), wanted.argmax(axis=1))
    assert np.array_equal(ours.predict(x), theirs.predict(x))
    logistic = LogisticRegression().fit(x, y)
    reference = linear_model.LogisticRegression(tol=1e-10, max_iter=10_000).fit(x, y)
    wanted = reference.decision_function(x)
    np.testing.assert_allclose(logistic.decision_function(x), wanted, atol=1e-4)


def test_scores_by_decision_values() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal((90, 6))
    y = x[:, 0] + 0.3 * rng.standard_normal(90) > 0
    scores = cross_val_score(SVC(), x, y, cv=3, scoring="roc_auc")
    wanted = cross_val_score(svm.SVC(), x, y, cv=3, scoring="roc_auc")
    np.testing.assert_allclose(scores, wanted, atol=1e-3)
    calibrated = CalibratedClassifierCV(SVC(), cv=3).fit(x, y)
    reference = CalibratedClassifierCV(svm.SVC(), cv=3).fit(x, y)
    np.testing.assert_allclose(calibrated.predict_proba(x), reference.predict_proba(x), atol=1e-2)
    several = np.digitize(x[:, 0], [-0.5, 0.5])
    each = OneVsRestClassifier(SVC()).fit(x, several)
    reference = OneVsRestClassifier(svm.SVC()).fit(x, several)
    assert np.array_equal(each.predict(x), reference.predict(x))
    for estimator in (
        KNN(),
        DecisionTree(),
        RandomForest(20),
        ExtraTrees(20),
        LogisticRegression(),
    ):
        assert cross_val_score(estimator, x, y, cv=3, scoring="roc_auc").min() > 0.6
        assert CalibratedClassifierCV(clone(estimator), cv=3).fit(x, y).score(x, y) > 0.8
        assert OneVsRestClassifier(clone(estimator)).fit(x, several).score(x, several) > 0.7
        found = permutation_importance(
            clone(estimator).fit(x, y), x, y, n_repeats=3, random_state=0
        )
        assert found.importances_mean.argmax() == 0
    assert BaggingClassifier(SVC(), 5, random_state=0).fit(x, several).score(x, several) > 0.7


@pytest.mark.parametrize("classes", [2, 4])
def test_sample_weights_are_scikit_learns(classes: int) -> None:
    x, y = clouds(100, 4, classes)
    weights = np.random.default_rng(1).uniform(0.2, 3.0, 100)
    ours = SVC(tol=1e-6).fit(x, y, sample_weight=weights)
    theirs = svm.SVC(tol=1e-6).fit(x, y, sample_weight=weights)
    values, wanted = ours.decision_function(x), theirs.decision_function(x)
    np.testing.assert_allclose(values, wanted, atol=1e-3)
    for class_weight in ({"class 1": 2.0}, "balanced"):
        ours = LogisticRegression(class_weight=class_weight).fit(x, y, weights)
        theirs = linear_model.LogisticRegression(
            class_weight=class_weight, tol=1e-10, max_iter=10_000
        ).fit(x, y, weights)
        np.testing.assert_allclose(ours.predict_proba(x), theirs.predict_proba(x), atol=1e-5)
    # Few equally good splits: the trees are the same.
    settings = {"max_depth": 3, "criterion": "entropy", "random_state": 0}
    ours = DecisionTree(**settings).fit(x, y, weights)
    theirs = tree.DecisionTreeClassifier(**settings).fit(x, y, weights)
    np.testing.assert_allclose(ours.predict_proba(x), theirs.predict_proba(x), atol=1e-6)
    importances = theirs.feature_importances_
    np.testing.assert_allclose(ours.feature_importances_, importances, atol=1e-9)


@pytest.mark.parametrize(("ours", "theirs", "settings"), FORESTS)
def test_forests_with_weights_are_near(ours, theirs, settings) -> None:
    x, y = clouds(150, 6, 3)
    x[:, 4] = 0.0
    weights = np.where(y == "class 0", 0.05, 1.0)
    settings = settings | {"n_estimators": 300, "oob_score": True}
    for weight in (None, weights):
        fits = [
            [
                kind(**settings, random_state=seed).fit(x, y, sample_weight=weight)
                for seed in range(3)
            ]
            for kind in (ours, theirs)
        ]
        # Beyond what seeds do: their importances spread by 0.02.
        (mine, *_), (reference, *_) = fits
        assert mine.feature_importances_[4] == 0
        means = [np.mean([f.feature_importances_ for f in side], axis=0) for side in fits]
        np.testing.assert_allclose(*means, atol=0.03)
        scores = [np.mean([f.oob_score_ for f in side]) for side in fits]
        assert abs(scores[0] - scores[1]) < 0.03
        difference = np.abs(mine.oob_decision_function_ - reference.oob_decision_function_)
        assert difference.mean() < 0.04
    back = pickle.loads(pickle.dumps(mine))
    assert np.array_equal(back.feature_importances_, mine.feature_importances_)
    assert back.oob_score_ == mine.oob_score_


def test_neighbours_are_scikit_learns() -> None:
    x, y = clouds(80, 5, 3)
    for metric in ("euclidean", "manhattan", "cosine", "chebyshev"):
        ours = KNN(4, metric=metric).fit(x, y)
        theirs = neighbors.KNeighborsClassifier(4, metric=metric, algorithm="brute").fit(x, y)
        for query, count in ((x[:9] + 0.1, None), (x[:40] + 0.1, 7), (None, 3), (None, None)):
            distances, rows = ours.kneighbors(query, count)
            wanted, positions = theirs.kneighbors(query, count)
            assert np.array_equal(rows, positions)
            np.testing.assert_allclose(distances, wanted, atol=1e-7)
            assert np.array_equal(ours.kneighbors(query, count, return_distance=False), rows)
    with pytest.raises(cf.ParameterError, match="1 to 80"):
        ours.kneighbors(x, 81)
    for count in (0, 2.5, True, "3"):
        with pytest.raises(cf.ParameterError, match="n_neighbors"):
            ours.kneighbors(x, count)
    with pytest.raises(cf.NotFittedError):
        KNN().kneighbors(x)


def test_what_is_known_after_fit_only(tmp_path: Path) -> None:
    x, y = clouds(40, 3, 2)
    forest = RandomForest(30, oob_score=True)
    assert not hasattr(forest, "feature_importances_") and not hasattr(forest, "oob_score_")
    forest.fit(x, y)
    assert 0.5 < forest.oob_score_ <= 1 and forest.oob_decision_function_.shape == (40, 2)
    forest.set_params(oob_score=False).fit(x, y)
    assert not hasattr(forest, "oob_score_") and not hasattr(forest, "oob_decision_function_")
    forest.set_params(oob_score=True).fit(x, y).save(tmp_path / "model")
    back = RandomForest.load(tmp_path / "model")
    assert back.oob_score is True and not hasattr(back, "oob_score_")
    with pytest.raises(AttributeError, match="model files do not hold it"):
        _ = back.feature_importances_
    with pytest.warns(UserWarning, match="do not have OOB scores"):
        one = RandomForest(1, oob_score=True).fit(x, y)
    assert np.isnan(one.oob_decision_function_).any()
    with pytest.raises(cf.ParameterError, match="bootstrap"):
        ExtraTrees(oob_score=True).fit(x, y)
    assert not hasattr(DecisionTree(solver="linfa").fit(x, y), "feature_importances_")


def test_weights_that_are_none_are_refused() -> None:
    x, y = clouds(20, 3, 2)
    for weights, word in (
        (np.ones(19), "expected"),
        (np.ones((20, 2)), "1D array"),
        (-np.ones(20), "at least 0"),
        (np.full(20, np.nan), "finite"),
        (np.zeros(20), "zero for every row"),
        (["a"] * 20, "must be numbers"),
    ):
        for estimator in (SVC(), RandomForest(5)):
            with pytest.raises(cf.ParameterError, match=word):
                estimator.fit(x, y, sample_weight=weights)
    with pytest.raises(cf.ParameterError, match="at least 2 classes"):
        SVC().fit(x, y, sample_weight=(y == "class 0").astype(float))
    with pytest.raises(cf.ParameterError, match="solver=own"):
        SVC(solver="linfa").fit(x, y, sample_weight=np.ones(20))
    # A class without weight is never the label.
    x, y = clouds(60, 3, 3)
    weights = (y != "class 1").astype(float)
    for estimator in (SVC(), LogisticRegression(), DecisionTree(), RandomForest(5)):
        fitted = estimator.fit(x, y, sample_weight=weights)
        assert "class 1" not in fitted.predict(x) and len(fitted.classes_) == 3
    assert SVC().fit(x, y, weights).decision_function(x).argmax(axis=1).max() == 2


def test_labels_and_rows_that_are_missing_are_refused() -> None:
    pandas = pytest.importorskip("pandas")
    x, y = clouds(9, 3, 3)
    for nothing in (np.nan, None, pandas.NA, pandas.NaT):
        labels = y.astype(object)
        labels[2] = nothing
        for given in (labels, pandas.Series(labels)):
            with pytest.raises(cf.ParameterError, match=r"missing values \(row 2\)"):
                KNN(1).fit(x, given)
    with pytest.raises(cf.ParameterError, match="different types"):
        KNN(1).fit(x, np.array([1, "a", 2] * 3, dtype=object))
    with pytest.raises(cf.ParameterError, match="differ in length"):
        KNN(1).fit([[1.0], [1.0, 2.0]], ["a", "b"])
    with pytest.raises(cf.ParameterError, match="1d array"):
        KNN(1).fit(x, np.stack([y, y]))
    table = pandas.DataFrame({"a": [1.0, 2.0], "b": [1.0, pandas.NA]})
    with pytest.raises(cf.ParameterError, match="must be numbers"):
        KNN(1).fit(table, ["a", "b"])


def test_scikit_learns_own_class_weight_of_weighted_rows() -> None:
    x, y = clouds(90, 3, 3)
    weights = np.random.default_rng(2).uniform(0.5, 2.0, 90)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ours = SVC(class_weight="balanced", tol=1e-6).fit(x, y, weights)
        theirs = svm.SVC(class_weight="balanced", tol=1e-6).fit(x, y, weights)
    values, wanted = ours.decision_function(x), theirs.decision_function(x)
    np.testing.assert_allclose(values, wanted, atol=1e-3)
