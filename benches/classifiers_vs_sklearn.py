"""Times to fit and to predict: corsmal-feat and scikit-learn, as a Markdown table.

    python benches/classifiers_vs_sklearn.py [--tables 0,1,2] [--only knn,rf,et,svm] [--repeats 5]

Both sides get the same numpy array (float64, or float32 with `--dtype float32`), the same
parameters and two threads. They take turns, and medians are printed. The tables are seeded Gaussian
classes on low-dimensional subspaces. All rows are used for training, and all are predicted.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("CORSMAL_FEAT_JOBS", "2")
os.environ.setdefault("OMP_NUM_THREADS", "2")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "2")

import numpy as np
import sklearn
from corsmal_feat import classifiers as ours
from sklearn.datasets import make_classification
from sklearn.ensemble import ExtraTreesClassifier, RandomForestClassifier
from sklearn.neighbors import KNeighborsClassifier
from sklearn.svm import SVC

SHAPES = ((684, 136), (684, 9216), (10_000, 193))
STEPS = ("fit", "predict", "both")
#: name, scikit-learn's, ours
PAIRS: dict[str, tuple[Callable[[], Any], Callable[[], Any]]] = {
    "knn": (lambda: KNeighborsClassifier(5, n_jobs=2), lambda: ours.KNN(5)),
    "rf": (
        lambda: RandomForestClassifier(100, n_jobs=2, random_state=0),
        lambda: ours.RandomForest(100, random_state=0),
    ),
    "et": (
        lambda: ExtraTreesClassifier(100, n_jobs=2, random_state=0),
        lambda: ours.ExtraTrees(100, random_state=0),
    ),
    "svm": (lambda: SVC(C=10), lambda: ours.SVC(C=10)),
}


def table(rows: int, columns: int, dtype: str) -> tuple[np.ndarray, np.ndarray]:
    """Seven overlapping classes."""
    informative = min(40, columns)
    x, y = make_classification(
        rows,
        columns,
        n_informative=informative,
        n_redundant=columns // 2,
        n_classes=7,
        class_sep=1.0,
        random_state=0,
    )
    return x.astype(dtype), y


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", default="0,1,2", help="positions in the list of shapes")
    parser.add_argument("--only", default="knn,rf,et,svm")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--dtype", choices=("float64", "float32"), default="float64")
    arguments = parser.parse_args()
    print(f"scikit-learn {sklearn.__version__}, {arguments.dtype}, 2 threads")
    print("| table | classifier | | scikit-learn, s | ours, s | ratio |\n|---|---|---|---|---|---|")
    for shape in (SHAPES[int(i)] for i in arguments.tables.split(",")):
        x, y = table(*shape, arguments.dtype)
        for name in arguments.only.split(","):
            taken: dict[tuple[str, int], list[float]] = {}
            for _ in range(arguments.repeats):
                for side, make in enumerate(PAIRS[name]):
                    model = make()
                    fit = seconds(lambda m=model, x=x, y=y: m.fit(x, y))
                    predict = seconds(lambda m=model, x=x: m.predict(x))
                    for step, value in zip(STEPS, (fit, predict, fit + predict), strict=True):
                        taken.setdefault((step, side), []).append(value)
            for step in STEPS:
                theirs, own = (statistics.median(taken[step, side]) for side in (0, 1))
                print(
                    f"| {shape[0]:,} x {shape[1]:,} | {name} | {step} | {theirs:.4f} | {own:.4f} |"
                    f" {theirs / own:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
