"""Our configuration on ESC-10, chosen inside the training folds, from the .ogg files.

    python experiments/esc10_nested.py [--shared ../shared] [--check]

Protocol, written down before any score of these candidates on a published fold was seen (the scores
of the baselines, `esc10_baselines.py`, were known):

* Inputs: statistics over frames (CONFIG) of the whole clip, and of windows of 1 s and 2.5 s with a
  hop of half a window. Windows that are quieter than 1 % of the loudest window of the clip
  (padding) are left out.
* Candidates: each of the three lengths with each of LEARNERS. The probabilities of a clip are the
  means over its windows.
* For each published fold: every candidate gives out-of-fold probabilities on the four other folds,
  each held out once; `stacking.weights` weights the nine candidates; the nine are fitted on all
  four folds, weighted, and scored on the fold. The score is the mean accuracy over the five folds.
  Nothing else is chosen. One run, fixed seeds.

--check runs everything with shuffled labels: the accuracy must be near 10 %.
"""

from __future__ import annotations

import argparse
import csv
import pathlib
import tempfile
import time
from collections.abc import Callable, Iterator

import corsmal_feat
import numpy as np
from corsmal_feat.classifiers import SVC, ExtraTrees, LogisticRegression
from stacking import Labels, Matrix, Model, Standardized, held_out, mixture, shown, weights

CONFIG = {
    "signal": {"channels": "mean"},
    "features": {
        "melspectrogram": {"n_mels": 64, "scale": "power_to_db"},
        "mfcc": {"n_mfcc": 40},
        "delta": {"of": "mfcc"},
        "spectral_contrast": {},
        "chroma_stft": {},
        "spectral_centroid": {},
        "spectral_bandwidth": {},
        "spectral_rolloff": {},
        "spectral_flatness": {},
        "zero_crossing_rate": {},
        "rms": {},
        "onset_strength": {},
    },
    "summary": {"stats": ["mean", "std", "skew", "max", "p10", "median", "p90"]},
}
#: seconds of a window; 0 is the whole clip
WINDOWS = (0.0, 1.0, 2.5)
LEARNERS: dict[str, Callable[[], Model]] = {
    "extra trees": lambda: ExtraTrees(300, max_features=0.1, random_state=0),
    "svm": lambda: Standardized(SVC(C=10, probability=True, random_state=0)),
    "logistic": lambda: Standardized(LogisticRegression(C=0.01, tol=1e-4)),
}
QUIET = 0.01


class Windows:
    """Features of windows, `[windows, features]`, and the clip of each window."""

    def __init__(self, data: pathlib.Path, clips: list[dict[str, str]], length: float) -> None:
        with tempfile.TemporaryDirectory() as folder:
            manifest = pathlib.Path(folder, "windows.csv")
            with open(manifest, "w", newline="") as file:
                rows = csv.writer(file)
                rows.writerow(["path", "id", "start", "end", "clip"])
                for number, clip in enumerate(clips):
                    path = (data / "audio" / clip["file"]).resolve()
                    duration = int(clip["frames"]) / int(clip["sample_rate"])
                    starts = np.arange(0, duration - length + 1e-6, length / 2) if length else [0]
                    for start in starts:
                        end = round(start + length, 3) if length else ""
                        rows.writerow([path, f"{number}-{start:.3f}", start, end, number])
            found = corsmal_feat.extract(str(manifest), config=CONFIG)
        failed = [row for row in found.outcomes if row["status"] != "ok"]
        if failed:
            raise SystemExit(f"no features: {failed}")
        x, clip = found.summary.astype(np.float64), found.labels["clip"].astype(np.int64)
        loudness = x[:, [i for i, n in enumerate(found.names) if "rms" in n and "mean" in n]].mean(
            1
        )
        loudest = np.zeros(len(clips))
        np.maximum.at(loudest, clip, loudness)
        keep = loudness >= QUIET * loudest[clip]
        self.x, self.clip = x[keep], clip[keep]

    def predict(self, make: Callable[[], Model], y: Labels, train: Labels, test: Labels) -> Matrix:
        """Probabilities of the clips `test`, from a model of the clips `train`."""
        inside = np.isin(self.clip, train)
        model = make()
        model.fit(self.x[inside], y[self.clip[inside]])
        rows = np.isin(self.clip, test)
        proba, owner = model.predict_proba(self.x[rows]), self.clip[rows]
        return np.stack([proba[owner == clip].mean(axis=0) for clip in test])


class Clips:
    """Folder, rows of `meta.csv`, and the class and fold of each clip."""

    def __init__(self, shared: pathlib.Path) -> None:
        self.data = shared / "data" / "esc10"
        with open(self.data / "meta.csv", newline="") as file:
            self.rows = list(csv.DictReader(file))
        self.y = np.array([int(clip["class_id"]) for clip in self.rows])
        self.folds = np.array([int(clip["fold"]) for clip in self.rows])


def mixtures(clips: Clips) -> Iterator[tuple[int, Matrix]]:
    """Every published fold, and the weighted mean of the candidates for its clips."""
    data, y, folds = clips.data, clips.y, clips.folds
    start = time.perf_counter()
    windows = {length: Windows(data, clips.rows, length) for length in WINDOWS}
    for length, own in windows.items():
        print(f"windows of {length or 'all'} s: {own.x.shape}", flush=True)
    print(f"features {time.perf_counter() - start:.0f} s", flush=True)
    names = [f"{length or 'clip'} {learner}" for length in WINDOWS for learner in LEARNERS]
    candidates = [(windows[length], make) for length in WINDOWS for make in LEARNERS.values()]
    for fold in np.unique(folds):
        train, test = np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)
        inner = [
            held_out(lambda a, b, w=w, m=m, t=train: w.predict(m, y, t[a], t[b]), folds[train])
            for w, m in candidates
        ]
        w = weights(inner, y[train])
        print(f"fold {fold}: {shown(names, w)}", flush=True)
        yield fold, mixture([own.predict(make, y, train, test) for own, make in candidates], w)


def clips_by_arguments(description: str) -> Clips:
    """The clips in --shared; --check shuffles their labels."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--shared", default="../shared", type=pathlib.Path)
    parser.add_argument("--check", action="store_true", help="shuffle the labels")
    arguments = parser.parse_args()
    clips = Clips(arguments.shared)
    if arguments.check:
        clips.y = np.random.default_rng(0).permutation(clips.y)
    return clips


def main() -> None:
    clips = clips_by_arguments(__doc__.splitlines()[0])
    start = time.perf_counter()
    scores = []
    for fold, proba in mixtures(clips):
        right = proba.argmax(axis=1) == clips.y[clips.folds == fold]
        scores.append(100 * float(np.mean(right)))
        print(f"fold {fold}: {scores[-1]:.2f} %", flush=True)
    print(
        f"mean accuracy {np.mean(scores):.2f} % ± {np.std(scores, ddof=1):.2f} over folds, "
        f"{time.perf_counter() - start:.0f} s"
    )


if __name__ == "__main__":
    main()
