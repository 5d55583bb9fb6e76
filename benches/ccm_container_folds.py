"""Filling type and level on the CCM training features, containers held out three at a time.

    python benches/ccm_container_folds.py [--shared ../shared] [--only m5,a34f,fusion] [--check]

m5      random forest of 500 trees on A34F, the settings of M5; five seeds
a34f    classifiers on A34F, weighed inside the training containers
fusion  classifiers on A34F and VGGish (`ccm_vggish.py` has the inputs), weighed inside the training
        containers

Protocol of a34f and fusion, written down before their scores on held-out containers were seen. (An
earlier script of this repository and its held-out scores were known: docs/classifiers.md.) In
every outer fold, {1,4,7}, {2,5,8}, {3,6,9} held out:

* Candidates: LEARNERS on every input, trained on the seven joint classes (probabilities added up
  over the classes of type or level), and DIRECT learners trained on the target itself.
* Each of the six training containers is held out once; `stacking.weights` of these out-of-fold
  probabilities, for type and for level apart.
* All candidates are fitted on the six containers, their probabilities weighted, the largest taken.

Scores: mean over the outer folds, as M5's. Nothing else is chosen. Fixed seeds, one run. --check
runs it all with the recordings' labels shuffled: type must end near 28 %, level near 36 % weighted
F1 or below.
"""

from __future__ import annotations

import argparse
import pathlib
import time
from collections.abc import Callable

import numpy as np
from ccm_vggish import Recordings, inputs
from corsmal_feat.classifiers import SVC, ExtraTrees, LogisticRegression, RandomForest
from stacking import (
    Labels,
    Matrix,
    Model,
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


def merged(proba: Matrix, classes: Labels) -> Matrix:
    """Joint probabilities added up over the classes of type or level."""
    return np.stack([proba[:, classes == c].sum(axis=1) for c in range(classes.max() + 1)], axis=1)


def candidates(
    sets: dict[str, Matrix], targets: dict[str, Labels], train: Labels, test: Labels, folds: Labels
) -> dict[str, dict[str, tuple[Matrix, Matrix]]]:
    """By target and candidate: out-of-fold probabilities of `train`, and those of `test`."""

    def both(x: Matrix, y: Labels, make: Callable[[], Model]) -> tuple[Matrix, Matrix]:
        def fit_predict(a: Labels, b: Labels) -> Matrix:
            model = make()
            model.fit(x[a], y[a])
            return model.predict_proba(x[b])

        inner = held_out(lambda a, b: fit_predict(train[a], train[b]), folds[train])
        return inner, fit_predict(train, test)

    found: dict[str, dict[str, tuple[Matrix, Matrix]]] = {target: {} for target in CLASSES}
    for set_name, x in sets.items():
        for name, make in LEARNERS.items():
            joint = both(x, targets["joint"], make)
            for target, classes in CLASSES.items():
                pair = (merged(joint[0], classes), merged(joint[1], classes))
                found[target][f"{set_name}, {name}"] = pair
                if name in DIRECT:
                    own = both(x, targets[target], make)
                    found[target][f"{set_name}, {name} direct"] = own
    return found


def nested(recordings: Recordings, with_vggish: bool) -> None:
    """Prints the scores of every outer fold and their means."""
    container = recordings.container
    scores: dict[str, list[tuple[float, float]]] = {target: [] for target in CLASSES}
    for fold in OUTER:
        train = np.flatnonzero(~np.isin(container, fold))
        test = np.flatnonzero(np.isin(container, fold))
        sets = inputs(recordings, train, test) if with_vggish else {"A34F": recordings.a34f}
        found = candidates(sets, recordings.targets, train, test, container)
        for target, pairs in found.items():
            truth = recordings.targets[target]
            w = weights([inner for inner, _ in pairs.values()], truth[train])
            predicted = mixture([outer for _, outer in pairs.values()], w).argmax(axis=1)
            f1 = 100 * weighted_f1(truth[test], predicted)
            accuracy = 100 * float(np.mean(predicted == truth[test]))
            scores[target].append((f1, accuracy))
            print(f"  {fold} {target}: weighted F1 {f1:.2f}, accuracy {accuracy:.2f}", flush=True)
            print(f"    {shown(pairs, w)}", flush=True)
    for target, pairs_of in scores.items():
        f1, accuracy = np.mean(pairs_of, axis=0)
        print(f"  {target}: weighted F1 {f1:.2f}, accuracy {accuracy:.2f}", flush=True)


def m5(recordings: Recordings) -> None:
    """M5's forest: 500 trees, one forest for type and one for level; five seeds."""
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shared", default="../shared", type=pathlib.Path)
    parser.add_argument("--only", default="m5,a34f,fusion")
    parser.add_argument("--check", action="store_true", help="shuffle the labels")
    arguments = parser.parse_args()
    recordings = Recordings.load(arguments.shared / "data" / "ccm")
    if arguments.check:
        recordings.shuffle_labels()
    for name in arguments.only.split(","):
        start = time.perf_counter()
        print(name, flush=True)
        m5(recordings) if name == "m5" else nested(recordings, name == "fusion")
        print(f"  {time.perf_counter() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
