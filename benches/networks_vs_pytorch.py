"""CPU time of networks: corsmal-feat, PyTorch and ONNX Runtime, as Markdown tables.

    python benches/networks_vs_pytorch.py [train] [infer] [--only m2_type,m4_type] [--repeats 3]

A training step is the forward pass, backward pass and update of the published recipe, on random
inputs of the published size and from the same weights on both sides. The losses are compared first,
without dropout. The sides take turns, and medians are printed. Each uses one thread; CPU seconds
are those of the process.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ["CORSMAL_FEAT_JOBS"] = "1"
os.environ["OMP_NUM_THREADS"] = "1"

import numpy as np
import onnxruntime
import torch
from corsmal_feat import nets
from torch import nn
from torch.nn.utils.rnn import pack_padded_sequence

torch.set_num_threads(1)

PARSER = argparse.ArgumentParser(description=__doc__.splitlines()[0])
PARSER.add_argument("parts", nargs="*", default=["train", "infer"], help="train, infer")
PARSER.add_argument("--only", default="", help="names of networks")
PARSER.add_argument("--repeats", type=int, default=3)
ARGUMENTS = PARSER.parse_args()

#: steps in one call of ours, whose set-up (copies of all numbers) is divided by as many
STEPS = 3
#: seconds of sound of 64 recordings, spread as those of the data set
LENGTHS = [
    round(float(x))
    for x in np.interp(
        np.arange(64) / 63, [0, 0.05, 0.25, 0.5, 0.75, 0.95, 1], [1, 2, 3, 6.5, 11, 18, 24]
    )
]


class Named(nn.Module):
    """Layers in sequence, each under its name."""

    def __init__(self, layers: Sequence[tuple[str, nn.Module]]) -> None:
        super().__init__()
        self.order = [name for name, _ in layers]
        for name, layer in layers:
            self.add_module(name, layer)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        for name in self.order:
            x = getattr(self, name)(x)
        return x


def m2_type() -> nn.Module:
    return Named(
        [
            ("conv1", nn.Conv2d(1, 16, (120, 40), 4)),
            ("r1", nn.ReLU()),
            ("d1", nn.Dropout(0.25)),
            ("conv2", nn.Conv2d(16, 8, (40, 1), 2)),
            ("r2", nn.ReLU()),
            ("d2", nn.Dropout(0.25)),
            ("flat", nn.Flatten()),
            ("linear1", nn.Linear(1232, 4)),
        ]
    )


def m4_type() -> nn.Module:
    layers: list[tuple[str, nn.Module]] = []
    channels = 8
    blocks = ((32, 32), (64, 64), (128,) * 3, (256,) * 3, (256,) * 3)
    for b, widths in enumerate(blocks, 1):
        for k, width in enumerate(widths, 1):
            layers += [
                (f"conv{b}_{k}", nn.Conv2d(channels, width, 3, padding=1)),
                (f"r{b}_{k}", nn.ReLU()),
            ]
            channels = width
        layers += [(f"bn{b}", nn.BatchNorm2d(channels)), (f"p{b}", nn.MaxPool2d(2))]
    layers.append(("flat", nn.Flatten()))
    for k, inputs in ((1, 1024), (2, 512)):
        layers += [
            (f"fc{k}", nn.Linear(inputs, 512)),
            (f"rf{k}", nn.ReLU()),
            (f"d{k}", nn.Dropout(0.5)),
        ]
    # As published, the loss takes the softmax.
    return Named([*layers, ("fc3", nn.Linear(512, 4)), ("softmax", nn.Softmax(1))])


def m6_action() -> nn.Module:
    layers: list[tuple[str, nn.Module]] = []
    channels = 1
    for b, width in enumerate((64, 128), 1):
        for k in (1, 2):
            layers += [
                (f"conv{b}_{k}", nn.Conv2d(channels, width, 3, padding=1)),
                (f"r{b}_{k}", nn.ReLU()),
            ]
            channels = width
        layers.append((f"p{b}", nn.MaxPool2d(3)))
    layers += [("flat", nn.Flatten()), ("fc1", nn.Linear(12800, 512)), ("rf1", nn.ReLU())]
    layers += [("fc2", nn.Linear(512, 512)), ("rf2", nn.ReLU()), ("out", nn.Linear(512, 3))]
    return Named(layers)


class Recurrent(nn.Module):
    """GRU or LSTM, then the last step; on packed sequences if lengths are given."""

    def __init__(
        self, name: str, rnn: nn.Module, middle: nn.Module, fc: nn.Linear, end: nn.Module
    ) -> None:
        super().__init__()
        self.place, self.middle, self.fc, self.end = name, middle, fc, end
        self.add_module(name, rnn)

    def forward(self, x: torch.Tensor, lengths: list[int] | None = None) -> torch.Tensor:
        rnn = getattr(self, self.place)
        if lengths is None:
            last = rnn(x)[0][:, -1]
        else:
            packed = pack_padded_sequence(
                x, torch.tensor(lengths), batch_first=True, enforce_sorted=False
            )
            state = rnn(packed)[1]
            last = (state[0] if isinstance(state, tuple) else state)[-1]
        return self.end(self.fc(self.middle(last)))


def m5_vggish_level() -> nn.Module:
    return Recurrent(
        "rnn", nn.GRU(128, 512, 5, batch_first=True), nn.ReLU(), nn.Linear(512, 3), nn.Identity()
    )


def m4_level() -> nn.Module:
    lstm = nn.LSTM(1024, 256, 3, batch_first=True, dropout=0.2)
    return Recurrent("lstm", lstm, nn.Dropout(0.2), nn.Linear(256, 3), nn.Sigmoid())


@dataclass(frozen=True)
class Case:
    """A network and its training."""

    name: str
    about: str
    build: Callable[[], nn.Module]
    shape: tuple[int, ...]
    classes: int
    recipe: dict[str, Any]
    lengths: list[int] | None = None


GRU = {"optimizer": "adam", "lr": 3e-4}
SGD = {"optimizer": "sgd", "lr": 2.5e-4, "momentum": 0.9}
CASES = [
    Case(
        "m5_vggish_level",
        "M5's GRU, 64 of 1 to 24 s, padding left out",
        m5_vggish_level,
        (64, max(LENGTHS), 128),
        3,
        GRU,
        LENGTHS,
    ),
    Case(
        "m5_vggish_level",
        "the same through the padding",
        m5_vggish_level,
        (64, max(LENGTHS), 128),
        3,
        GRU,
    ),
    Case(
        "m4_type",
        "M4's CNN, 32 windows",
        m4_type,
        (32, 8, 64, 64),
        4,
        {"optimizer": "adam", "lr": 1e-5, "weight_decay": 1e-5},
    ),
    Case(
        "m6_action",
        "M6 action, 16",
        m6_action,
        (16, 1, 96, 96),
        3,
        {"optimizer": "adam", "lr": 1e-3},
    ),
    Case("m2_type", "M2 type, 16", m2_type, (16, 1, 1501, 40), 4, SGD),
    Case(
        "m4_level",
        "M4's LSTM, 16 of 100 steps",
        m4_level,
        (16, 100, 1024),
        3,
        {"optimizer": "adam", "lr": 1e-4, "clip_grad_norm": 0.5},
    ),
]


def weights_of(network: nets.Network, theirs: nn.Module) -> None:
    """Copies our weights into PyTorch's network."""
    state = {name: torch.from_numpy(np.array(v)) for name, v in network.state_dict().items()}
    missing, unexpected = theirs.load_state_dict(state, strict=False)
    assert not unexpected and all(name.endswith("num_batches_tracked") for name in missing)


def optimiser_of(theirs: nn.Module, recipe: dict[str, Any]) -> torch.optim.Optimizer:
    settings = {k: v for k, v in recipe.items() if k not in ("optimizer", "clip_grad_norm")}
    kind = torch.optim.Adam if recipe["optimizer"] == "adam" else torch.optim.SGD
    return kind(theirs.parameters(), **settings)


def cpu_seconds(work: Callable[[], object]) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def inputs_of(case: Case, items: int) -> tuple[np.ndarray, list[int] | None]:
    random = np.random.default_rng(0)
    x = random.random((items, *case.shape[1:]), dtype=np.float32)
    lengths = None if case.lengths is None else case.lengths[-items:]
    for row, length in zip(x, lengths or [], strict=False):
        row[length:] = 0
    return x, lengths


def training(case: Case) -> tuple[float, float]:
    """Median CPU seconds of a step: PyTorch, corsmal-feat."""
    ours, theirs = nets.build(case.name), case.build()
    weights_of(ours, theirs)
    x, lengths = inputs_of(case, case.shape[0])
    y = np.arange(len(x)) % case.classes
    tensor, classes = torch.from_numpy(x), torch.from_numpy(y)
    more = () if lengths is None else (lengths,)
    optimiser = optimiser_of(theirs, case.recipe)

    def step() -> float:
        optimiser.zero_grad()
        loss = nn.functional.cross_entropy(theirs(tensor, *more), classes)
        loss.backward()
        if "clip_grad_norm" in case.recipe:
            nn.utils.clip_grad_norm_(theirs.parameters(), case.recipe["clip_grad_norm"])
        optimiser.step()
        return float(loss.detach())

    def own(steps: int, dropout: bool) -> list[float]:
        found = ours.train_steps(x, y, steps, case.recipe, dropout=dropout, lengths=lengths)
        return found["losses"]

    theirs.train()
    quiet = [m for m in theirs.modules() if isinstance(m, nn.Dropout)]
    rates = [m.p for m in quiet]
    lstm = getattr(theirs, "lstm", None)
    for module in quiet:
        module.p = 0.0
    if lstm is not None:
        lstm.dropout = 0.0
    np.testing.assert_allclose(own(2, dropout=False), [step(), step()], rtol=2e-3)
    for module, rate in zip(quiet, rates, strict=True):
        module.p = rate
    if lstm is not None:
        lstm.dropout = 0.2
    taken: list[tuple[float, float]] = []
    for _ in range(ARGUMENTS.repeats):
        of_torch = cpu_seconds(step)
        taken.append((of_torch, cpu_seconds(lambda: own(STEPS, dropout=True)) / STEPS))
    return statistics.median(t for t, _ in taken), statistics.median(o for _, o in taken)


def inference(case: Case, items: int, folder: Path) -> tuple[float, float, float]:
    """Median CPU seconds of a forward pass: PyTorch, ONNX Runtime, corsmal-feat."""
    ours, theirs = nets.build(case.name), case.build()
    weights_of(ours, theirs)
    theirs.eval()
    x, _ = inputs_of(case, items)
    tensor, path = torch.from_numpy(x), folder / "network.onnx"
    torch.onnx.export(
        theirs, (tensor,), str(path), input_names=["x"], opset_version=17, dynamo=False
    )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])

    def torch_forward() -> np.ndarray:
        with torch.inference_mode():
            return theirs(tensor).numpy()

    def own_forward() -> np.ndarray:
        return ours.forward(x)

    def onnx_forward() -> np.ndarray:
        return session.run(None, {"x": x})[0]

    sides = (torch_forward, onnx_forward, own_forward)
    outputs = torch_forward()
    np.testing.assert_allclose(onnx_forward(), outputs, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(own_forward(), outputs, rtol=1e-3, atol=1e-4)
    taken: list[list[float]] = [[], [], []]
    for _ in range(ARGUMENTS.repeats):
        for side, times in zip(sides, taken, strict=True):
            times.append(cpu_seconds(side))
    of_torch, onnx, of_ours = (statistics.median(times) for times in taken)
    return of_torch, onnx, of_ours


def main() -> None:
    wanted = ARGUMENTS.only.split(",")
    chosen = [case for case in CASES if not ARGUMENTS.only or case.name in wanted]
    print(f"PyTorch {torch.__version__}, ONNX Runtime {onnxruntime.__version__}, one thread")
    if "train" in ARGUMENTS.parts:
        print("\n| a training step | PyTorch, CPU s | ours, CPU s | ours / PyTorch |")
        print("|---|---|---|---|")
        for case in chosen:
            theirs, own = training(case)
            ratio = own / theirs
            print(f"| {case.about} | {theirs:.3f} | {own:.3f} | {ratio:.2f} |", flush=True)
    if "infer" in ARGUMENTS.parts:
        print(
            "\n| inference | items | PyTorch, CPU s | ONNX Runtime, CPU s | ours, CPU s | ratio |"
        )
        print("|---|---|---|---|---|---|")
        with tempfile.TemporaryDirectory() as folder:
            for case in (case for case in chosen if case.lengths is None):
                for items in (1, case.shape[0]):
                    sides = inference(case, items, Path(folder))
                    times = " | ".join(f"{seconds:.4f}" for seconds in sides)
                    ratio = sides[2] / sides[1]
                    row = f"| `{case.name}` | {items} | {times} | {ratio:.2f} |"
                    print(row, flush=True)


if __name__ == "__main__":
    main()
