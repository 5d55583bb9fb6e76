"""Networks on ESC-10 over its five published folds, from the .ogg files.

    python experiments/esc10_networks.py [--shared ../shared] [--only m2,m6,m4]
        [--checkpoints FOLDER]

Protocol of M2, M4 and M6, written down before any of their scores on ESC-10 was seen. They are
measured, not adapted: front ends, layers and recipes are the published ones, with ten outputs and
seed 0, except as follows.

m2  M2's network for the type: nothing is changed.
m6  M6's network for the action: 20 epochs for 100. An epoch takes 27 seconds of a core.
m4  M4's network for the type: a clip has one channel, so the window has it eight times. The windows
    of a clip do not overlap (published: by three quarters), 6 epochs for 200, and a rate of 1e-4
    for 1e-5. A clip gets the mean of its windows' probabilities.

Every fold is held out once; the score is the mean accuracy over the folds. The last epoch is kept,
and each network is run once.
"""

from __future__ import annotations

import argparse
import csv
import pathlib
import time
from collections.abc import Callable

import corsmal_feat
import numpy as np
from corsmal_feat import nets
from corsmal_feat.corsmal import m4_logmel, m4_windows
from stacking import Labels

Clips = tuple[list[pathlib.Path], Labels, Labels]
#: M4's windows overlap by three quarters: those that do not
STEP = 4
#: decibels to which M4's code scales
QUIETEST, LOUDEST = -313.071_195_49, 194.191_876_53


def clips(data: pathlib.Path) -> Clips:
    """Paths, classes and folds."""
    with open(data / "meta.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    paths = [data / "audio" / row["file"] for row in rows]
    y, folds = (np.array([int(row[key]) for row in rows]) for key in ("class_id", "fold"))
    return paths, y, folds


def published(name: str, **recipe: object) -> Callable[[Clips, pathlib.Path], list[float]]:
    """Accuracy by fold of a network that takes whole recordings."""

    def run(all_clips: Clips, checkpoints: pathlib.Path) -> list[float]:
        paths, y, folds = all_clips
        found = nets.cross_validate(
            name, paths, y, groups=folds, recipe=recipe, checkpoints=checkpoints / name, jobs=1
        )
        guesses = dict(zip(found.predictions.ids, found.predictions.predicted, strict=True))
        return by_fold(np.array([int(guesses[path.stem]) for path in paths]), y, folds)

    return run


def by_fold(guesses: Labels, y: Labels, folds: Labels) -> list[float]:
    right = guesses == y
    return [100 * float(right[folds == fold].mean()) for fold in np.unique(folds)]


def m4(all_clips: Clips, checkpoints: pathlib.Path) -> list[float]:
    paths, y, folds = all_clips
    windows, owners = [], []
    for number, path in enumerate(paths):
        samples, sr = corsmal_feat.load(str(path), sr=None)
        apart = m4_windows(m4_logmel(samples, sr))[::STEP].astype(np.float64)
        scaled = ((apart - QUIETEST) / (LOUDEST - QUIETEST)).astype(np.float32)
        windows.extend(np.repeat(scaled, 8, axis=1))
        owners.extend([number] * len(apart))
    owner = np.array(owners)
    guesses = np.empty_like(y)
    checkpoints.mkdir(parents=True, exist_ok=True)
    for fold in np.unique(folds):
        inside = folds[owner] != fold
        network = nets.NetworkClassifier(
            "m4_type",
            recipe={"lr": 1e-4, "epochs": 6},
            random_state=0,
            checkpoint=checkpoints / f"m4_type-{fold}.safetensors",
        )
        network.fit([windows[i] for i in np.flatnonzero(inside)], y[owner[inside]])
        outside = np.flatnonzero(~inside)
        proba = network.predict_proba([windows[i] for i in outside])
        for clip in np.flatnonzero(folds == fold):
            guesses[clip] = proba[owner[outside] == clip].mean(axis=0).argmax()
    return by_fold(guesses, y, folds)


PARTS: dict[str, Callable[[Clips, pathlib.Path], list[float]]] = {
    "m2": published("m2_type"),
    "m6": published("m6_action", epochs=20),
    "m4": m4,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shared", default="../shared", type=pathlib.Path)
    parser.add_argument("--only", default=",".join(PARTS))
    parser.add_argument("--checkpoints", default="esc10-training", type=pathlib.Path)
    arguments = parser.parse_args()
    data = clips(arguments.shared / "data" / "esc10")
    for part in arguments.only.split(","):
        start = time.perf_counter()
        scores = PARTS[part](data, arguments.checkpoints)
        shown = ", ".join(f"{score:.2f}" for score in scores)
        spent = time.perf_counter() - start
        print(f"{part}: {np.mean(scores):.2f} % ({shown}), {spent:.0f} s", flush=True)


if __name__ == "__main__":
    main()
