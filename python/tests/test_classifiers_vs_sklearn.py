"""The classifiers beside scikit-learn's, on the CCM training features where they are there."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn")

from corsmal_feat.classifiers import (
    KNN,
    SVC,
    DecisionTree,
    ExtraTrees,
    LogisticRegression,
    RandomForest,
)
from sklearn import ensemble, linear_model, neighbors, svm, tree
from sklearn.base import clone, is_classifier
from sklearn.ensemble import VotingClassifier
from sklearn.model_selection import GridSearchCV, GroupKFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import estimator_checks_generator

SHARED = Path(os.environ.get("CORSMAL_SHARED", Path(__file__).parents[3] / "shared"))
TABLE = SHARED / "data" / "ccm" / "a34f_train.npz"


@pytest.fixture(scope="module")
def table():
    if not TABLE.exists():
        pytest.skip(f"{TABLE} absent")
    with np.load(TABLE) as data:
        return {key: data[key] for key in ("X", "type", "level", "joint", "container")}


def container_folds(table):
    for fold in ((1, 4, 7), (2, 5, 8), (3, 6, 9)):
        test = np.isin(table["container"], fold)
        yield ~test, test


@pytest.mark.parametrize("weights", ["uniform", "distance"])
@pytest.mark.parametrize("metric", ["euclidean", "manhattan", "cosine", "chebyshev", "minkowski"])
def test_neighbours_are_identical(table, weights, metric):
    y = table["joint"]
    for k, (train, test) in zip((1, 5, 8), container_folds(table), strict=True):
        settings = {"weights": weights, "metric": metric, "p": 3 if metric == "minkowski" else 2}
        ours = KNN(k, **settings).fit(table["X"][train], y[train])
        theirs = neighbors.KNeighborsClassifier(k, **settings).fit(table["X"][train], y[train])
        query = table["X"][test]
        np.testing.assert_array_equal(ours.predict(query), theirs.predict(query))
        np.testing.assert_allclose(
            ours.predict_proba(query), theirs.predict_proba(query), rtol=0, atol=1e-9
        )


@pytest.mark.parametrize(("target", "scaled"), [("type", True), ("joint", False)])
@pytest.mark.parametrize(
    "settings",
    [
        {"C": 1.0},
        {"C": 20.0, "gamma": 1e-5},
        {"C": 100.0, "gamma": "auto"},
        {"C": 5.0, "class_weight": "balanced"},
    ],
    ids=str,
)
def test_support_vector_labels_are_those_of_libsvm(table, target, scaled, settings):
    same = []
    for train, test in container_folds(table):
        x = StandardScaler().fit(table["X"][train]).transform(table["X"]) if scaled else table["X"]
        ours = SVC(**settings).fit(x[train], table[target][train])
        theirs = svm.SVC(**settings).fit(x[train], table[target][train])
        same.extend(ours.predict(x[test]) == theirs.predict(x[test]))
    assert np.mean(same) >= 0.995


def test_linear_support_vector_labels(table):
    train, test = next(container_folds(table))
    x = StandardScaler().fit(table["X"][train]).transform(table["X"])
    y = table["type"]
    ours = SVC(kernel="linear").fit(x[train], y[train]).predict(x[test])
    theirs = svm.SVC(kernel="linear").fit(x[train], y[train]).predict(x[test])
    assert np.mean(ours == theirs) >= 0.995


def test_support_vector_probabilities_differ_no_more_than_seeds_do(table):
    train, test = next(container_folds(table))
    x = StandardScaler().fit(table["X"][train]).transform(table["X"])
    y = table["type"]
    ours = SVC(C=10, probability=True).fit(x[train], y[train]).predict_proba(x[test])
    with warnings.catch_warnings():
        # scikit-learn 1.8 and later deprecate probability=True.
        warnings.simplefilter("ignore", FutureWarning)
        theirs = svm.SVC(C=10, probability=True, random_state=0).fit(x[train], y[train])
        theirs = theirs.predict_proba(x[test])
    assert np.abs(ours - theirs).mean() < 0.01


@pytest.mark.parametrize(
    ("strength", "target"), [(0.01, "type"), (1.0, "level"), (10.0, "type"), (1.0, "two")]
)
def test_logistic_probabilities(table, strength, target):
    y = table["type"] > 1 if target == "two" else table[target]
    train, test = next(container_folds(table))
    x = StandardScaler().fit(table["X"][train]).transform(table["X"])
    ours = LogisticRegression(C=strength).fit(x[train], y[train]).predict_proba(x[test])
    theirs = linear_model.LogisticRegression(C=strength, tol=1e-9, max_iter=100_000)
    theirs = theirs.fit(x[train], y[train]).predict_proba(x[test])
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-3)


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        (RandomForest(100), ensemble.RandomForestClassifier(100)),
        (ExtraTrees(100), ensemble.ExtraTreesClassifier(100)),
    ],
    ids=["rf", "et"],
)
def test_forests_reach_the_same_accuracy(table, ours, theirs):
    def accuracy(estimator):
        runs = []
        for seed in range(4):
            estimator.set_params(random_state=seed)
            for train, test in container_folds(table):
                estimator.fit(table["X"][train], table["type"][train])
                runs.append(estimator.score(table["X"][test], table["type"][test]))
        return np.mean(runs)

    # One point, and the standard error of a mean over four seeds (0.2 to 0.4 points) on each side.
    assert abs(accuracy(ours) - accuracy(theirs)) < 0.015


def test_a_single_tree_splits_as_theirs():
    x = np.array([[0.0, 5.0], [1.0, 5.0], [2.0, 1.0], [3.0, 1.0], [4.0, 3.0], [5.0, 3.0]])
    y = np.array([0, 0, 1, 1, 2, 2])
    grid = np.stack(np.meshgrid(np.linspace(-1, 6, 29), np.linspace(0, 6, 25)), -1).reshape(-1, 2)
    x = x[:, :1]
    ours = DecisionTree().fit(x, y).predict(grid[:, :1])
    theirs = tree.DecisionTreeClassifier().fit(x, y).predict(grid[:, :1])
    np.testing.assert_array_equal(ours, theirs)


def test_inside_pipelines_and_searches(table):
    x, y, groups = table["X"], table["type"], table["container"]
    pipeline = make_pipeline(StandardScaler(), SVC(C=10))
    scores = cross_val_score(pipeline, x, y, groups=groups, cv=GroupKFold(3))
    theirs = make_pipeline(StandardScaler(), svm.SVC(C=10))
    np.testing.assert_allclose(
        scores, cross_val_score(theirs, x, y, groups=groups, cv=GroupKFold(3))
    )
    search = GridSearchCV(KNN(), {"n_neighbors": [1, 5]}, cv=3).fit(x, y)
    assert search.best_params_["n_neighbors"] in (1, 5)
    assert clone(SVC(C=3)).get_params()["C"] == 3


@pytest.mark.parametrize("labels", [("water", "rice", "pasta"), (2, 0, 5)])
def test_they_are_classifiers_to_scikit_learn(labels):
    rng = np.random.default_rng(0)
    which = np.arange(90) % 3
    x, y = rng.normal(size=(90, 4)) + 3 * which[:, None], np.array(labels)[which]
    for estimator in ESTIMATORS:
        assert is_classifier(estimator)
        assert cross_val_score(estimator, x, y, cv=3, error_score="raise").mean() > 0.9
        assert clone(estimator).fit(x, y).classes_.tolist() == sorted(labels)
    soft = VotingClassifier([("knn", KNN()), ("svm", SVC(probability=True))], voting="soft")
    assert soft.fit(x, y).score(x, y) > 0.9
    assert not hasattr(SVC(), "predict_proba") and hasattr(SVC(probability=True), "predict_proba")


ESTIMATORS = [
    KNN(),
    SVC(),
    DecisionTree(),
    RandomForest(10),
    ExtraTrees(10),
    LogisticRegression(),
]
#: checks of what these estimators do not claim
NOT_OURS = {
    "LogisticRegression-check_non_transformer_estimators_n_iter": "the steps taken are not kept",
    # Nor do scikit-learn's own: gamma="scale" looks at rows, a bootstrap draws them.
    "SVC-check_sample_weight_equivalence_on_dense_data": "a row twice has another gamma",
    "RandomForest-check_sample_weight_equivalence_on_dense_data": "a row twice has other draws",
} | {
    f"{name}-check_class_weight_classifiers": "written for trees with min_weight_fraction_leaf"
    for name in ("DecisionTree", "RandomForest", "ExtraTrees")
}


def checks():
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for estimator in ESTIMATORS:
            for instance, check in estimator_checks_generator(estimator):
                name = getattr(check, "func", check).__name__
                found.append(pytest.param(instance, check, id=f"{type(estimator).__name__}-{name}"))
    return found


@pytest.mark.parametrize(("estimator", "check"), checks())
@pytest.mark.filterwarnings("ignore")
def test_scikit_learns_own_checks(estimator, check):
    name = f"{type(estimator).__name__}-{getattr(check, 'func', check).__name__}"
    if name in NOT_OURS:
        pytest.skip(NOT_OURS[name])
    check(estimator)


@pytest.mark.parametrize("name", ["RandomForest", "ExtraTrees"])
def test_class_weights_of_forests_are_chances(name):
    """With a bootstrap, weights of classes lowered the probability of the class that they raise."""
    rng = np.random.default_rng(0)
    y = (rng.random(2000) < 0.1).astype(int)
    x = rng.standard_normal((2000, 6))
    x[:, 0] += 1.2 * y
    x[:, 1] -= 0.8 * y
    rows = np.where(y[:1000] == 1, 9.0, 1.0)
    theirs, ours = getattr(ensemble, f"{name}Classifier"), globals()[name]

    def rare(kind, weights=None, **parameters):
        forest = kind(200, bootstrap=True, random_state=0, **parameters)
        forest.fit(x[:1000], y[:1000], sample_weight=weights)
        return forest.predict_proba(x[1000:])[:, 1].mean()

    for parameters in ({}, {"class_weight": {0: 1.0, 1: 9.0}}, {"class_weight": "balanced"}):
        assert rare(ours, **parameters) == pytest.approx(rare(theirs, **parameters), abs=0.015)
        weighted = rare(ours, rows, **parameters)
        assert weighted == pytest.approx(rare(theirs, rows, **parameters), abs=0.015)
    # The same chances, the same forest.
    assert rare(ours, class_weight={0: 1.0, 1: 9.0}) == rare(ours, rows)


def test_probabilities_of_a_machine_in_double_precision() -> None:
    """They were fitted to decisions in single precision: noise where `C` is large."""
    rng = np.random.default_rng(0)
    x = rng.standard_normal((400, 2))
    y = (x[:, 0] + 0.8 * rng.standard_normal(400) > 0).astype(int)
    found = []
    for c in (1e4, 1e8):
        machine = SVC(kernel="rbf", gamma=1 / c, C=c, probability=True, random_state=0).fit(
            x[:100], y[:100]
        )
        found.append(machine.predict_proba(x[100:])[:, 1])
        assert ((found[-1] > 0.5) == y[100:]).mean() > 0.7
    # The nearly linear machines are the same, but for the second order of the kernel.
    assert np.abs(found[0] - found[1]).max() < 0.1


def test_huge_weights_of_rows_are_weights() -> None:
    rng = np.random.default_rng(0)
    x, y = rng.standard_normal((300, 3)), np.arange(300) % 3 // 2
    forest = RandomForest(30, class_weight={0: 1.0, 1: 1.9}, random_state=0)
    plain = forest.fit(x, y).predict_proba(x)
    huge = forest.fit(x, y, sample_weight=np.full(300, 1.7e308)).predict_proba(x)
    np.testing.assert_array_equal(huge, plain)
