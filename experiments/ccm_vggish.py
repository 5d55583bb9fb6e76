"""Inputs for filling type and level from VGGish sequences (one vector per 0.96 s) and A34F.

Two things distinguish half from full: how long the filling flows, and how its sound has changed
when it stops (the resonance of the container rises as it fills). So, in addition to plain pooling
over equal parts of a recording, small patch models learn from the manual annotations of *training*
recordings when something is poured or shaken, and how full the container is then. Recordings are
pooled over the activity that they find. No annotation of a test recording is used.
"""

from __future__ import annotations

import csv
import itertools
import pathlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from corsmal_feat.classifiers import SVC, ExtraTrees
from stacking import Labels, Matrix, Model, Ranked, held_out

PATCH_SECONDS = 0.96
#: part of the container that is filled at each level
FILLED = np.array([0.0, 0.5, 0.9])
#: containers that are shaken, already filled; the others are poured into
SHAKEN = (7, 8, 9)
#: width of a class of filling, in parts of the container
STEP = 0.225
PATCH_MODELS: tuple[Callable[[], Model], ...] = (
    lambda: ExtraTrees(200, max_features=0.1, min_samples_leaf=2, random_state=0),
    lambda: Ranked(SVC(C=3, probability=True, random_state=0)),
)


@dataclass
class Recordings:
    """The 684 training recordings in the order of the A34F file."""

    a34f: Matrix
    #: VGGish vectors of all recordings, one after the other, and where each begins
    patches: Matrix
    offsets: Labels
    container: Labels
    sequence: list[str]
    #: start and end of the action in seconds, -1 for none
    action: Matrix
    targets: dict[str, Labels]

    @classmethod
    def load(cls, folder: pathlib.Path) -> Recordings:
        a, v = np.load(folder / "a34f_train.npz"), np.load(folder / "vggish_train.npz")
        same = (a["sequence"] == v["sequence"]).all() and (a["container"] == v["container"]).all()
        if not same:
            raise SystemExit("the two tables hold different recordings")
        with open(folder / "man_annotations.csv", newline="") as file:
            action = {
                (int(row["folder_num"]), row["file_name"].removesuffix("_c2")): (
                    float(row["start"]),
                    float(row["end"]),
                )
                for row in csv.DictReader(file)
            }
        names = zip(a["container"].tolist(), a["sequence"].tolist(), strict=True)
        return cls(
            a34f=a["X"],
            patches=v["X"].astype(np.float64),
            offsets=v["offsets"].astype(np.int64),
            container=a["container"].astype(np.int64),
            sequence=a["sequence"].tolist(),
            action=np.array([action[name] for name in names]),
            targets={k: a[k].astype(np.int64) for k in ("type", "level", "joint")},
        )

    def shuffle_labels(self) -> None:
        """Shuffles the labels among the recordings."""
        order = np.random.default_rng(0).permutation(len(self.a34f))
        self.targets = {k: y[order] for k, y in self.targets.items()}

    def sequences(self) -> list[Matrix]:
        return [self.patches[a:b] for a, b in itertools.pairwise(self.offsets)]

    def owners(self) -> Labels:
        """The recording of each patch."""
        return np.repeat(np.arange(len(self.a34f)), np.diff(self.offsets))


def equal_parts(sequence: Matrix, parts: int) -> Matrix:
    """Means over equal parts, the maximum, and the log length."""
    edges = np.linspace(0, len(sequence), parts + 1)
    means = []
    for low, high in itertools.pairwise(edges):
        first = int(low)
        means.append(sequence[first : max(int(np.ceil(high)), first + 1)].mean(axis=0))
    return np.concatenate([*means, sequence.max(axis=0), [np.log(len(sequence))]])


def patch_labels(recordings: Recordings) -> tuple[Labels, Labels]:
    """For each patch, what is heard (0 for nothing, or the type) and how full it is (0 to 4)."""
    content, filling = [], []
    for row, sequence in enumerate(recordings.sequences()):
        start, end = recordings.action[row]
        time = (np.arange(len(sequence)) + 0.5) * PATCH_SECONDS
        active = (start >= 0) & (time >= start) & (time <= end)
        progress = (time - start) / max(end - start, PATCH_SECONDS)
        if recordings.container[row] in SHAKEN:
            progress = np.ones(len(sequence))
        part = FILLED[recordings.targets["level"][row]] * progress
        content.append(np.where(active, recordings.targets["type"][row], 0))
        filling.append(np.where(active, 1 + np.minimum(part / STEP, 3).astype(int), 0))
    return np.concatenate(content), np.concatenate(filling)


def patch_inputs(recordings: Recordings) -> Matrix:
    """Each patch with its neighbours, its time, and the length of the recording."""
    rows = []
    for sequence in recordings.sequences():
        padded = np.concatenate([sequence[:1], sequence, sequence[-1:]])
        time = np.arange(len(sequence))[:, None]
        length = np.full((len(sequence), 1), len(sequence))
        rows.append(np.hstack([padded[:-2], sequence, padded[2:], time, length]))
    return np.concatenate(rows)


def patch_probabilities(
    recordings: Recordings, train: Labels, test: Labels, make: Callable[[], Model]
) -> tuple[Matrix, Matrix]:
    """Probabilities of `patch_labels` for every patch: for training containers, from models of the
    other training containers; for the rest, from models of all training containers."""
    x, owner = patch_inputs(recordings), recordings.owners()
    inside = np.flatnonzero(np.isin(owner, train))
    outside = np.flatnonzero(np.isin(owner, test))
    container = recordings.container[owner]
    found = []
    for y, n_classes in zip(patch_labels(recordings), (4, 5), strict=True):

        def fit_predict(a: Labels, b: Labels, y: Labels = y, n: int = n_classes) -> Matrix:
            model = make()
            model.fit(x[a], y[a])
            proba = np.zeros((len(b), n))
            proba[:, np.unique(y[a])] = model.predict_proba(x[b])
            return proba

        proba = np.zeros((len(x), n_classes))
        proba[inside] = held_out(lambda a, b: fit_predict(inside[a], inside[b]), container[inside])
        proba[outside] = fit_predict(inside, outside)
        found.append(proba)
    return found[0], found[1]


def progress(content: Matrix, filling: Matrix) -> Matrix:
    """Evidence for each type, and durations, extremes and trend of what the patch models hear in a
    recording."""
    active = 1 - content[:, 0]
    total = active.sum() + 1e-9
    time = np.arange(len(active)) * PATCH_SECONDS
    centre = (active * time).sum() / total
    full = filling[:, 1:] @ (STEP * (np.arange(4) + 0.5)) / filling[:, 1:].sum(axis=1).clip(1e-9)
    done = (np.cumsum(active) - active / 2) / total
    parts = [(active * part).sum() for part in (done < 1 / 3, done >= 2 / 3)]
    ends = [
        (active * part * full).sum() / max(weight, 1e-9)
        for part, weight in zip((done < 1 / 3, done >= 2 / 3), parts, strict=True)
    ]
    return np.concatenate(
        [
            content[:, 1:].sum(axis=0),
            content[:, 1:].max(axis=0),
            content[:, 1:].sum(axis=0) / total,
            active @ np.log(content[:, 1:] + 0.01) / total,
            [active.min(), active.max()],
            filling[:, 1:].sum(axis=0),
            filling[:, 1:].max(axis=0),
            [total, np.log(total + 0.5), np.sqrt((active * (time - centre) ** 2).sum() / total)],
            [centre, time[-1], time[-1] - centre],
            [(active * full).sum() / total, *ends, ends[1] - ends[0], full[active.argmax()]],
        ]
    )


def over_activity(sequence: Matrix, active: Matrix) -> Matrix:
    """Means over the beginning, middle and end of the activity, and end minus beginning."""
    weight = active + 1e-6
    done = (np.cumsum(weight) - weight / 2) / weight.sum()
    means = []
    for centre in (1 / 6, 1 / 2, 5 / 6):
        hat = weight * np.maximum(1 - np.abs(done - centre) * 2, 1e-6)
        means.append(hat @ sequence / hat.sum())
    return np.concatenate([*means, means[2] - means[0]])


def inputs(recordings: Recordings, train: Labels, test: Labels) -> dict[str, Matrix]:
    """Inputs of all recordings by name; patch models are fitted only on `train`."""
    sequences = recordings.sequences()
    spans = [slice(a, b) for a, b in itertools.pairwise(recordings.offsets)]
    heard = [patch_probabilities(recordings, train, test, make) for make in PATCH_MODELS]
    steps = [
        np.array([progress(content[s], filling[s]) for s in spans]) for content, filling in heard
    ]
    active = 1 - heard[0][0][:, 0]
    over = [over_activity(q, active[s]) for q, s in zip(sequences, spans, strict=True)]
    table = np.hstack([recordings.a34f, *steps])
    return {
        "progress": table,
        "activity": np.hstack([table, over]),
        "thirds": np.hstack([table, [equal_parts(sequence, 3) for sequence in sequences]]),
    }
