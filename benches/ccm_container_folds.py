"""Filling type and level on the CCM training features, containers held out three at a time.

    python benches/ccm_container_folds.py [--shared ../shared] [--only m5,a34f,fusion]

m5      random forest of 500 trees on A34F, the settings of M5
a34f    pipeline on A34F chosen by nested cross-validation
fusion  pipeline on A34F and pooled VGGish chosen by nested cross-validation

In the nested runs every outer fold ranks all candidates by their weighted F1 on inner folds of its
own six training containers (two held out at a time) and averages the probabilities of the best
three, fitted on all six; the held-out containers are used once, for the score. Every pipeline
learns the seven joint classes; the probabilities of type and level are sums over them. Fixed seeds.
"""

from __future__ import annotations

import argparse
import itertools
import json
import pathlib
import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from corsmal_feat.classifiers import SVC, ExtraTrees, LogisticRegression, RandomForest

Matrix = npt.NDArray[np.float64]
Labels = npt.NDArray[np.int64]
OUTER = ((1, 4, 7), (2, 5, 8), (3, 6, 9))
TYPE_OF_JOINT = np.array([0, 1, 1, 2, 2, 3, 3])
LEVEL_OF_JOINT = np.array([0, 1, 2, 1, 2, 1, 2])
#: pipelines whose probabilities are averaged
FUSED = 3


def weighted_f1(truth: Labels, predicted: Labels) -> float:
    """F1 of each class weighted by its rows."""
    total = 0.0
    for label in np.unique(truth):
        hits = np.sum((truth == label) & (predicted == label))
        total += (
            2
            * hits
            / (np.sum(truth == label) + np.sum(predicted == label))
            * np.sum(truth == label)
        )
    return float(total / len(truth))


def pooled(v: Matrix, offsets: Labels, segments: int) -> Matrix:
    """Means over `segments` equal parts of each recording, the maximum, and the log length."""
    rows = []
    for start, end in itertools.pairwise(offsets):
        own = v[start:end]
        edges = np.linspace(0, len(own), segments + 1)
        parts = []
        for low, high in itertools.pairwise(edges):
            first = int(low)
            parts.append(own[first : max(int(np.ceil(high)), first + 1)].mean(axis=0))
        rows.append(np.concatenate([*parts, own.max(axis=0), [np.log(len(own))]]))
    return np.array(rows)


class Standardized:
    """A classifier behind standardisation with the training rows' mean and deviation."""

    def __init__(self, classifier: SVC | LogisticRegression) -> None:
        self.classifier = classifier

    def fit(self, x: Matrix, y: Labels) -> Standardized:
        self.mean, self.scale = x.mean(axis=0), x.std(axis=0)
        self.scale[self.scale == 0] = 1
        self.classifier.fit((x - self.mean) / self.scale, y)
        return self

    def predict_proba(self, x: Matrix) -> Matrix:
        return self.classifier.predict_proba((x - self.mean) / self.scale)


def pipelines() -> dict[str, Callable[[], object]]:
    """What the inner folds choose among."""
    return {
        "et 300 0.1": lambda: ExtraTrees(300, max_features=0.1, random_state=0),
        "et 300 0.2": lambda: ExtraTrees(300, max_features=0.2, random_state=0),
        "rf 300 sqrt": lambda: RandomForest(300, random_state=0),
        "svm 10": lambda: Standardized(SVC(C=10, probability=True, random_state=0)),
        "logistic 0.01": lambda: Standardized(LogisticRegression(C=0.01, tol=1e-5)),
    }


def held_out(
    make: Callable[[], object], x: Matrix, joint: Labels, container: Labels, folds: list[list[int]]
) -> Matrix:
    """Joint probabilities of every row from a model that has not seen its containers."""
    proba = np.zeros((len(x), 7))
    for fold in folds:
        test = np.isin(container, fold)
        model = make().fit(x[~test], joint[~test])
        proba[test] = model.predict_proba(x[test])
    return proba


def inner_folds(containers: tuple[int, ...]) -> list[list[int]]:
    """Six training containers, two at a time: each fold holds out containers of different kinds."""
    ordered = sorted(containers)
    return [[ordered[i], ordered[i + 3]] for i in range(3)]


def merged(proba: Matrix, classes: Labels) -> Matrix:
    """Joint probabilities added up over the classes of type or level."""
    return np.stack([proba[:, classes == c].sum(axis=1) for c in range(classes.max() + 1)], axis=1)


def nested(sets: dict[str, Matrix], data: dict[str, Labels]) -> dict[str, object]:
    """Scores of the fused pipelines and which were chosen, for type and level."""
    joint, container = data["joint"], data["container"]
    targets = {"type": TYPE_OF_JOINT, "level": LEVEL_OF_JOINT}
    chosen: dict[str, list[list[str]]] = {t: [] for t in targets}
    scores: dict[str, list[float]] = {t: [] for t in targets}
    hits: dict[str, list[float]] = {t: [] for t in targets}
    for fold in OUTER:
        test = np.isin(container, fold)
        inner = inner_folds(tuple(int(c) for c in np.unique(container[~test])))
        candidates = {(s, p): make for s in sets for p, make in pipelines().items()}
        inner_f1: dict[str, dict[tuple[str, str], float]] = {t: {} for t in targets}
        for (set_name, name), make in candidates.items():
            proba = held_out(make, sets[set_name][~test], joint[~test], container[~test], inner)
            for target, classes in targets.items():
                truth = data[target][~test]
                predicted = np.argmax(merged(proba, classes), axis=1)
                inner_f1[target][set_name, name] = weighted_f1(truth, predicted)
        for target, classes in targets.items():
            best = sorted(candidates, key=inner_f1[target].__getitem__, reverse=True)[:FUSED]
            chosen[target].append([" / ".join(b) for b in best])
            total = np.zeros((test.sum(), classes.max() + 1))
            for key in best:
                model = candidates[key]().fit(sets[key[0]][~test], joint[~test])
                total += merged(model.predict_proba(sets[key[0]][test]), classes)
            predicted = np.argmax(total, axis=1)
            scores[target].append(weighted_f1(data[target][test], predicted))
            hits[target].append(float(np.mean(predicted == data[target][test])))
    return {
        target: {
            "weighted F1": round(100 * float(np.mean(scores[target])), 2),
            "accuracy": round(100 * float(np.mean(hits[target])), 2),
            "F1 per fold": [round(100 * s, 2) for s in scores[target]],
            "chosen": chosen[target],
        }
        for target in targets
    }


def m5(x: Matrix, data: dict[str, Labels]) -> dict[str, object]:
    """M5's forest: 500 trees, one forest for type and one for level; five seeds."""
    report: dict[str, object] = {}
    for target in ("type", "level"):
        runs = []
        for seed in range(5):
            hits = []
            for fold in OUTER:
                test = np.isin(data["container"], fold)
                forest = RandomForest(500, random_state=seed).fit(x[~test], data[target][~test])
                hits.append(forest.score(x[test], data[target][test]))
            runs.append(100 * float(np.mean(hits)))
        report[target] = {
            "accuracy, mean of 5 seeds": round(float(np.mean(runs)), 2),
            "lowest": round(min(runs), 2),
            "highest": round(max(runs), 2),
        }
    return report


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shared", default="../shared", type=pathlib.Path)
    parser.add_argument("--only", default="m5,a34f,fusion")
    arguments = parser.parse_args()
    folder = arguments.shared / "data" / "ccm"
    a = np.load(folder / "a34f_train.npz")
    v = np.load(folder / "vggish_train.npz")
    if not (a["sequence"] == v["sequence"]).all() or not (a["container"] == v["container"]).all():
        raise SystemExit("the rows of the two tables are not the same recordings")
    data = {k: a[k].astype(np.int64) for k in ("type", "level", "joint", "container")}
    x = a["X"]
    for name in arguments.only.split(","):
        start = time.perf_counter()
        if name == "m5":
            report = m5(x, data)
        elif name == "a34f":
            report = nested({"A34F": x}, data)
        else:
            vggish = v["X"].astype(np.float64)
            sets = {
                f"A34F + VGGish {n}": np.hstack([x, pooled(vggish, v["offsets"], n)])
                for n in (3, 4, 5)
            }
            report = nested(sets, data)
        print(
            name, json.dumps(report, indent=1), f"{time.perf_counter() - start:.0f} s", flush=True
        )


if __name__ == "__main__":
    main()
