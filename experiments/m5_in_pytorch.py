"""M5's R(2+1)D network for the type, trained in PyTorch as published, containers held out.

    python experiments/m5_in_pytorch.py [--shared ../shared] [--seeds 1337,1,2,3,4]

Needs torch and scikit-learn. Not a protocol of ours: it asks whether the published score repeats,
and how much it changes from seed to seed. Recipe and random numbers are those of the published
run (PyTorch 1.6): one seed for initial values and shuffles, set anew for each fold. With seed 1337
the first epoch has the loss of M5's log (1.4438; filling_type/r21d_rgb/main.ipynb of
v-iashin/CORSMAL at 2cf06cb). Prints the weighted F1 of the best epoch on the held-out containers,
which M5 reports, and of the last one.
"""

from __future__ import annotations

import argparse
import pathlib

import numpy as np
import torch
from sklearn.metrics import f1_score
from torch.nn.utils.rnn import pad_sequence

FOLDS = ((3, 6, 9), (2, 5, 8), (1, 4, 7))
BATCH, EPOCHS, PADDING, VIEWS, TYPES = 64, 30, -10.0, 4, 4
Item = tuple[torch.Tensor, int]


class View(torch.nn.Module):
    """The network of one view: its logits."""

    def __init__(self) -> None:
        super().__init__()
        self.rnn = torch.nn.GRU(512, 256, 2, batch_first=True)
        self.fc = torch.nn.Linear(256, TYPES)
        for parameter in self.parameters():
            if parameter.dim() > 1:
                torch.nn.init.xavier_uniform_(parameter)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Of sequences [items, steps, 512], through their padding."""
        steps, _ = self.rnn(x)
        logits: torch.Tensor = self.fc(torch.relu(steps[:, -1]))
        return logits


def recordings(path: pathlib.Path) -> dict[int, list[Item]]:
    """By container, in the order of their names: [steps, views, 512] and type."""
    table = np.load(path)
    x, offsets = table["X"].astype(np.float32), table["offsets"]
    views: dict[tuple[int, str], dict[int, np.ndarray]] = {}
    keys = zip(table["container"], table["sequence"], table["view"], strict=True)
    for row, (container, name, view) in enumerate(keys):
        of = views.setdefault((int(container), str(name)), {})
        of[int(view)] = x[offsets[row] : offsets[row + 1]]
    items: dict[int, list[Item]] = {}
    for (container, name), of in sorted(views.items()):
        stacked = torch.from_numpy(np.stack([of[v] for v in range(1, VIEWS + 1)], axis=1))
        items.setdefault(container, []).append((stacked, int(name.split("_")[1][2:])))
    return items


def logits(models: list[View], items: list[Item]) -> torch.Tensor:
    """The sum over the views."""
    x = pad_sequence([x for x, _ in items], batch_first=True, padding_value=PADDING)
    return torch.stack([model(x[:, :, v]) for v, model in enumerate(models)]).sum(0)


def fold(train: list[Item], held: list[Item], seed: int) -> tuple[list[float], list[float]]:
    """Loss and weighted F1 on the held-out recordings after each epoch."""
    torch.manual_seed(seed)
    models = [View() for _ in range(VIEWS)]
    optimiser = torch.optim.Adam([p for model in models for p in model.parameters()], lr=1e-4)
    truth = [kind for _, kind in held]
    losses, scores = [], []
    for _ in range(EPOCHS):
        # PyTorch 1.6 draws one number for each loader, and shuffles with the common generator.
        torch.empty((), dtype=torch.int64).random_()
        order = torch.randperm(len(train)).tolist()
        loss_sum = 0.0
        for begin in range(0, len(train), BATCH):
            items = [train[i] for i in order[begin : begin + BATCH]]
            optimiser.zero_grad()
            kinds = torch.tensor([kind for _, kind in items])
            loss = torch.nn.functional.cross_entropy(logits(models, items), kinds)
            loss.backward()
            optimiser.step()
            loss_sum += loss.item() * len(items)
        torch.empty((), dtype=torch.int64).random_()
        with torch.no_grad():
            batches = [held[begin : begin + BATCH] for begin in range(0, len(held), BATCH)]
            found = torch.cat([logits(models, items).argmax(1) for items in batches]).tolist()
        losses.append(loss_sum / len(train))
        scores.append(float(f1_score(truth, found, average="weighted")))
    return losses, scores


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shared", type=pathlib.Path, default=pathlib.Path("../shared"))
    parser.add_argument("--seeds", default="1337,1,2,3,4")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    items = recordings(arguments.shared / "data/ccm/r21d_train_f16.npz")
    for seed in map(int, arguments.seeds.split(",")):
        best, last = [], []
        for held in FOLDS:
            rest = sorted(set(items) - set(held))
            parts = [[item for c in containers for item in items[c]] for containers in (rest, held)]
            losses, scores = fold(parts[0], parts[1], seed)
            best.append(max(scores))
            last.append(scores[-1])
            print(
                f"seed {seed} without {held}: loss {losses[0]:.4f} to {losses[-1]:.4f}", flush=True
            )
        means = f"best epochs {100 * np.mean(best):.2f}, last epochs {100 * np.mean(last):.2f}"
        print(f"seed {seed}: {means}", flush=True)


if __name__ == "__main__":
    main()
