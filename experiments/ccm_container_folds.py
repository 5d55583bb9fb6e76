"""Filling type and level from the CCM training features; containers are held out three at a time.

    python experiments/ccm_container_folds.py [--shared ../shared] [--only m5,a34f,fusion,networks]
        [--inner] [--check]

m5      random forest of 500 trees on A34F, with the settings of M5; five seeds
a34f    classifiers on A34F, weighted inside the training containers
fusion  classifiers on A34F and VGGish (inputs from `ccm_vggish.py`), averaged
networks  level alone: fusion, averaged with our own network on VGGish sequences

Outer folds hold out {1,4,7}, {2,5,8} and {3,6,9}. Scores are means over them, as for M5. Seeds are
fixed. --check runs everything with the labels of recordings shuffled: weighted F1 must be near 28 %
for type and near 36 % for level, or below.

Protocol of a34f, written down before its scores on held-out containers were seen:

* Candidates: LEARNERS on A34F, trained on the seven joint classes (with probabilities summed over
  the classes of type or level), and DIRECT learners, trained on the target itself.
* Each of the six training containers is held out once; `stacking.weights` uses these out-of-fold
  probabilities, for type and for level separately.
* All candidates are fitted on the six containers; their probabilities are weighted, and the largest
  is chosen.

Protocol of fusion, the second one, written down before its only run on the outer folds (the scores
of the first one on them were known: docs/results.md):

* The FUSED classifiers are fitted on the six training containers, their probabilities are averaged
  with equal weights, and the largest is chosen. The patch models inside the inputs are fitted on
  the same containers.
* FUSED was chosen by inner scores alone (--inner): in each outer fold, each of the six training
  containers is held out once, and everything is fitted on the other five. The training containers
  of one fold are the test containers of the others, so the choice, which is the same for all folds,
  is not independent of them.

Protocol of networks, written down before its only run on the outer folds (the scores of fusion on
them were known):

* Three networks `attention_gru` (SEEDS) with their default recipe learn the joint classes of the
  recordings of the six training containers; their probabilities are averaged, and the mean is
  averaged with the probabilities of fusion, half and half.
* Chosen by inner scores alone, as above; docs/results.md has what was tried.
"""

from __future__ import annotations

import argparse
import pathlib
import time
from collections.abc import Callable

import numpy as np
from ccm_vggish import Recordings, inputs
from corsmal_feat.classifiers import SVC, ExtraTrees, LogisticRegression, RandomForest
from corsmal_feat.nets import NetworkClassifier
from stacking import (
    Labels,
    Matrix,
    Model,
    Ranked,
    Standardized,
    held_out,
    mixture,
    shown,
    weighted_f1,
    weights,
)

OUTER = ((1, 4, 7), (2, 5, 8), (3, 6, 9))
#: class of each target for each of the joint classes
CLASSES = {"type": np.array([0, 1, 1, 2, 2, 3, 3]), "level": np.array([0, 1, 2, 1, 2, 1, 2])}
LEARNERS: dict[str, Callable[[], Model]] = {
    "extra trees": lambda: ExtraTrees(300, max_features=0.1, random_state=0),
    "forest": lambda: RandomForest(300, random_state=0),
    "svm": lambda: Standardized(SVC(C=10, probability=True, random_state=0)),
    "logistic": lambda: Standardized(LogisticRegression(C=0.01, tol=1e-5)),
}
DIRECT = ("extra trees", "svm")


def trees() -> Model:
    return ExtraTrees(1000, max_features=0.3, random_state=0)


def ranked_svm() -> Model:
    return Ranked(SVC(C=10, probability=True, random_state=0))


#: input, classifier, and whether it learns the joint classes (else the target itself)
FUSED: tuple[tuple[str, Callable[[], Model], bool], ...] = (
    ("progress", trees, True),
    ("activity", trees, True),
    ("progress", ranked_svm, False),
    ("thirds", ranked_svm, False),
)


#: seeds of the networks
SEEDS = (1, 2, 3)


def merged(proba: Matrix, classes: Labels) -> Matrix:
    """Joint probabilities summed over the classes of type or level."""
    return np.stack([proba[:, classes == c].sum(axis=1) for c in range(classes.max() + 1)], axis=1)


def candidates(
    x: Matrix, targets: dict[str, Labels], train: Labels, test: Labels, folds: Labels
) -> dict[str, dict[str, tuple[Matrix, Matrix]]]:
    """By target and candidate: out-of-fold probabilities of `train`, probabilities of `test`."""

    def both(y: Labels, make: Callable[[], Model]) -> tuple[Matrix, Matrix]:
        def fit_predict(a: Labels, b: Labels) -> Matrix:
            return fitted(x, y, make, a, b)

        inner = held_out(lambda a, b: fit_predict(train[a], train[b]), folds[train])
        return inner, fit_predict(train, test)

    found: dict[str, dict[str, tuple[Matrix, Matrix]]] = {target: {} for target in CLASSES}
    for name, make in LEARNERS.items():
        joint = both(targets["joint"], make)
        for target, classes in CLASSES.items():
            found[target][name] = (merged(joint[0], classes), merged(joint[1], classes))
            if name in DIRECT:
                found[target][f"{name} direct"] = both(targets[target], make)
    return found


def fitted(x: Matrix, y: Labels, make: Callable[[], Model], train: Labels, test: Labels) -> Matrix:
    """Probabilities of the rows `test`, from a classifier trained on the rows `train`."""
    model = make()
    model.fit(x[train], y[train])
    return model.predict_proba(x[test])


def weighed(recordings: Recordings, train: Labels, test: Labels) -> dict[str, Matrix]:
    """Probabilities of `test` by target, from A34F."""
    found = candidates(recordings.a34f, recordings.targets, train, test, recordings.container)
    result = {}
    for target, pairs in found.items():
        w = weights([inner for inner, _ in pairs.values()], recordings.targets[target][train])
        print(f"    {target}: {shown(pairs, w)}", flush=True)
        result[target] = mixture([outer for _, outer in pairs.values()], w)
    return result


def fused(recordings: Recordings, train: Labels, test: Labels) -> dict[str, Matrix]:
    """Probabilities of `test` by target, from A34F and VGGish."""
    sets = inputs(recordings, train, test)
    result = {target: np.zeros((len(test), c.max() + 1)) for target, c in CLASSES.items()}
    for name, make, joint in FUSED:
        if joint:
            proba = fitted(sets[name], recordings.targets["joint"], make, train, test)
            for target, classes in CLASSES.items():
                result[target] += merged(proba, classes) / len(FUSED)
        else:
            for target in CLASSES:
                y = recordings.targets[target]
                result[target] += fitted(sets[name], y, make, train, test) / len(FUSED)
    return result


Predict = Callable[[Recordings, Labels, Labels], dict[str, Matrix]]


def networks(recordings: Recordings, train: Labels, test: Labels) -> dict[str, Matrix]:
    """Probabilities of the level of `test`: the mean of `fused` and of the networks."""
    sequences = [s.astype(np.float32) for s in recordings.sequences()]
    joint = recordings.targets["joint"]
    found = []
    for seed in SEEDS:
        network = NetworkClassifier("attention_gru", random_state=seed)
        network.fit([sequences[i] for i in train], joint[train])
        found.append(merged(network.predict_proba([sequences[i] for i in test]), CLASSES["level"]))
    return {"level": (fused(recordings, train, test)["level"] + np.mean(found, axis=0)) / 2}


def inside(predict: Predict, recordings: Recordings, train: Labels) -> dict[str, Matrix]:
    """Probabilities of `train` by target, with each of its containers held out once."""
    container = recordings.container
    result: dict[str, Matrix] = {}
    for held in np.unique(container[train]):
        rows = container[train] == held
        for target, proba in predict(recordings, train[~rows], train[rows]).items():
            result.setdefault(target, np.zeros((len(train), proba.shape[1])))[rows] = proba
    return result


def over_folds(predict: Predict, recordings: Recordings, inner: bool) -> None:
    """Prints scores and means on the outer folds, or inside the training containers of each."""
    container = recordings.container
    scores: dict[str, list[tuple[float, float]]] = {}
    for fold in OUTER:
        train = np.flatnonzero(~np.isin(container, fold))
        test = np.flatnonzero(np.isin(container, fold))
        if inner:
            found, rows = inside(predict, recordings, train), train
        else:
            found, rows = predict(recordings, train, test), test
        for target, proba in found.items():
            truth, predicted = recordings.targets[target][rows], proba.argmax(axis=1)
            f1 = 100 * weighted_f1(truth, predicted)
            accuracy = 100 * float(np.mean(predicted == truth))
            scores.setdefault(target, []).append((f1, accuracy))
            where = "inside the others of" if inner else "on"
            print(
                f"  {where} {fold}, {target}: weighted F1 {f1:.2f}, accuracy {accuracy:.2f}",
                flush=True,
            )
    for target, pairs in scores.items():
        f1, accuracy = np.mean(pairs, axis=0)
        print(f"  {target}: weighted F1 {f1:.2f}, accuracy {accuracy:.2f}", flush=True)


def m5(recordings: Recordings) -> None:
    """M5's forests: 500 trees, one forest for type and one for level; five seeds."""
    for target in CLASSES:
        y = recordings.targets[target]
        runs = []
        for seed in range(5):
            hits = []
            for fold in OUTER:
                test = np.isin(recordings.container, fold)
                forest = RandomForest(500, random_state=seed).fit(recordings.a34f[~test], y[~test])
                hits.append(forest.score(recordings.a34f[test], y[test]))
            runs.append(100 * float(np.mean(hits)))
        print(
            f"  {target}: accuracy {np.mean(runs):.2f}, mean of 5 seeds "
            f"({min(runs):.2f} to {max(runs):.2f})",
            flush=True,
        )


PARTS: dict[str, Predict] = {"a34f": weighed, "fusion": fused, "networks": networks}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shared", default="../shared", type=pathlib.Path)
    parser.add_argument("--only", default="m5,a34f,fusion,networks")
    parser.add_argument("--inner", action="store_true", help="score inside training containers")
    parser.add_argument("--check", action="store_true", help="shuffle the labels")
    arguments = parser.parse_args()
    recordings = Recordings.load(arguments.shared / "data" / "ccm")
    if arguments.check:
        recordings.shuffle_labels()
    names = arguments.only.split(",")
    if unknown := set(names) - {"m5", *PARTS}:
        parser.error(f"--only knows m5, {', '.join(PARTS)}, not {', '.join(sorted(unknown))}")
    for name in names:
        start = time.perf_counter()
        print(name, flush=True)
        if name == "m5":
            m5(recordings)
        else:
            over_folds(PARTS[name], recordings, arguments.inner)
        print(f"  {time.perf_counter() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
