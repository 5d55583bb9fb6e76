"""Filling level on CCM from sound and video; containers are held out three at a time.

    python experiments/ccm_video.py --checkpoints FOLDER [--shared ../shared] [--seeds 1337,1,2]

FOLDER holds the trainings of `m5_r21d_level` by the example `container_folds` (docs/results.md).

Protocol, written down before any score of this average was seen (fusion's were known, and those of
the R(2+1)D networks of one fold):

* The networks of the last epoch are used; no score chose them, unlike those of the best epoch on
  the held-out containers. They predict as M5 does, in batches of 64 that are padded.
* Three probabilities with equal weights, as in M5's own fusion: `fusion` and the networks on VGGish
  sequences (both in ccm_container_folds.py), and the mean of the R(2+1)D networks over their seeds.
"""

from __future__ import annotations

import argparse
import pathlib

import numpy as np
from ccm_container_folds import OUTER, networks
from ccm_vggish import Recordings
from corsmal_feat import nets
from stacking import Labels, Matrix, weighted_f1

BATCH, PADDING = 64, -10.0
VIEWS = 4


def sequences(path: pathlib.Path, recordings: Recordings) -> list[Matrix]:
    """By recording [views, steps, 512]."""
    table = np.load(path)
    x, offsets = table["X"].astype(np.float32), table["offsets"]
    named = {
        (int(c), str(s), int(v)): x[offsets[i] : offsets[i + 1]]
        for i, (c, s, v) in enumerate(
            zip(table["container"], table["sequence"], table["view"], strict=True)
        )
    }
    names = zip(recordings.container.tolist(), recordings.sequence, strict=True)
    return [np.stack([named[c, s, v] for v in range(1, VIEWS + 1)]) for c, s in names]


def predicted(checkpoint: pathlib.Path, items: list[Matrix]) -> Matrix:
    """Probabilities by the parameters of the last epoch."""
    network = nets.build("m5_r21d_level")
    state = nets.read_weights(checkpoint)
    network.load_state_dict(
        {k.removeprefix("now."): v for k, v in state.items() if k[:4] == "now."}
    )
    found = []
    for at in range(0, len(items), BATCH):
        batch = items[at : at + BATCH]
        steps = max(item.shape[1] for item in batch)
        x = np.full((len(batch), VIEWS, steps, 512), PADDING, dtype=np.float32)
        for row, item in zip(x, batch, strict=True):
            row[:, : item.shape[1]] = item
        logits = network.forward(x).astype(np.float64)
        e = np.exp(logits - logits.max(axis=1, keepdims=True))
        found.append(e / e.sum(axis=1, keepdims=True))
    return np.concatenate(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--shared", default="../shared", type=pathlib.Path)
    parser.add_argument("--checkpoints", required=True, type=pathlib.Path)
    parser.add_argument("--seeds", default="1337,1,2")
    arguments = parser.parse_args()
    folder = arguments.shared / "data" / "ccm"
    recordings = Recordings.load(folder)
    items = sequences(folder / "r21d_train_f16.npz", recordings)
    truth = recordings.targets["level"]
    scores = []
    for number, fold in enumerate(OUTER):
        held = np.isin(recordings.container, fold)
        train, test = np.flatnonzero(~held), np.flatnonzero(held)

        def score(proba: Matrix, test: Labels = test) -> float:
            return 100 * weighted_f1(truth[test], proba.argmax(axis=1))

        by_seed = [
            predicted(
                arguments.checkpoints / f"m5_r21d_level-{seed}" / f"fold-{number}.safetensors",
                [items[i] for i in test],
            )
            for seed in arguments.seeds.split(",")
        ]
        video = np.mean(by_seed, axis=0)
        sound = networks(recordings, train, test)["level"]
        scores.append([score(sound), score(video), score((2 * sound + video) / 3)])
        print(f"{fold}: sound {scores[-1][0]:.2f}, ", end="")
        print(f"video {scores[-1][1]:.2f}, both {scores[-1][2]:.2f}; ", end="")
        print("video by seed " + ", ".join(f"{score(p):.2f}" for p in by_seed), flush=True)
    print("mean: sound {:.2f}, video {:.2f}, both {:.2f}".format(*np.mean(scores, axis=0)))


if __name__ == "__main__":
    main()
