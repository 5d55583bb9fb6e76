"""ResNet-18 against torchvision's own: outputs, training mode, gradients, two steps, its file.

Weights are random; running statistics, scales and shifts of batch normalisation are random, too.
torchvision is no requirement of the tests: `pip install torchvision`, then
`pytest python/tests/test_resnet_vs_torchvision.py`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from corsmal_feat import nets

torch = pytest.importorskip("torch")
torchvision = pytest.importorskip("torchvision")

CLASSES = 5
RECIPE = {"optimizer": "adam", "lr": 1e-4}


def theirs() -> Any:
    """torchvision's network in double precision, nothing in it trivial."""
    torch.manual_seed(3)
    net = torchvision.models.resnet18(weights=None, num_classes=CLASSES)
    for module in net.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            torch.nn.init.normal_(module.running_mean, 0.0, 0.3)
            torch.nn.init.uniform_(module.running_var, 0.4, 1.8)
            torch.nn.init.uniform_(module.weight, 0.5, 1.5)
            torch.nn.init.normal_(module.bias, 0.0, 0.2)
    return net.double()


def ours(net: Any) -> nets.Network:
    network = nets.build("resnet18_type", outputs=CLASSES)
    network.load_state_dict({k: v.float().numpy() for k, v in net.state_dict().items()})
    return network


def pictures(items: int) -> Any:
    return torch.from_numpy(np.random.default_rng(4).normal(size=(items, 3, 112, 112)))


def near(got: Any, want: Any, theirs_single: Any) -> None:
    """Within ten times what PyTorch's own single precision differs by, as for other networks."""
    want, single = np.asarray(want), np.asarray(theirs_single, dtype=np.float64)
    atol = max(10 * np.abs(single - want).max(), 1e-5 * np.abs(want).max(), 1e-6)
    np.testing.assert_allclose(got, want, rtol=0, atol=atol)


def seen(net: Any, x: Any) -> tuple[Any, Any]:
    """Outputs and features in evaluation mode."""
    with torch.no_grad():
        body = torch.nn.Sequential(*list(net.eval().children())[:-1])
        return net(x).numpy(), body(x).flatten(1).numpy()


def trained(net: Any, x: Any, y: Any) -> tuple[list[float], dict[str, float], dict[str, Any], Any]:
    """Losses of two steps, norms of the first gradients; running statistics and outputs after."""
    optimiser = torch.optim.Adam(net.train().parameters(), lr=RECIPE["lr"])
    losses: list[float] = []
    norms: dict[str, float] = {}
    for _ in range(2):
        optimiser.zero_grad()
        loss = torch.nn.functional.cross_entropy(net(x), torch.from_numpy(y))
        loss.backward()
        norms = norms or {name: float(p.grad.norm()) for name, p in net.named_parameters()}
        optimiser.step()
        losses.append(float(loss.detach()))
    running = {k: v.numpy() for k, v in net.state_dict().items() if "running" in k}
    return losses, norms, running, seen(net, x)[0]


def test_outputs_and_features() -> None:
    net, x = theirs(), pictures(3)
    network, single = ours(net), theirs().float()
    for got, want, of_single in zip(
        (network.forward(x.float().numpy()), network.features(x.float().numpy())),
        seen(net, x),
        seen(single, x.float()),
        strict=True,
    ):
        near(got, want, of_single)
    assert network.num_parameters == sum(p.numel() for p in net.parameters())


def test_training_steps() -> None:
    net, x, y = theirs(), pictures(6), np.arange(6) % CLASSES
    network = ours(net)
    found = network.train_steps(x.float().numpy(), y, 2, RECIPE)
    losses, norms, running, after = trained(net, x, y)
    losses_32, norms_32, running_32, after_32 = trained(theirs().float(), x.float(), y)
    near(found["losses"], losses, losses_32)
    assert set(found["gradient_norms"]) == set(norms)
    for name, norm in norms.items():
        rtol = max(3e-3, 10 * abs(norms_32[name] / norm - 1))
        assert found["gradient_norms"][name] == pytest.approx(norm, rel=rtol), name
    state = network.state_dict()
    for name, value in running.items():
        near(state[name], value, running_32[name])
    near(network.forward(x.float().numpy()), after, after_32)


def test_its_file_is_read(tmp_path: Path) -> None:
    net = theirs().float()
    torch.save(net.state_dict(), tmp_path / "resnet18.pth")
    state = nets.read_weights(tmp_path / "resnet18.pth")
    for name, value in net.state_dict().items():
        if not name.endswith("num_batches_tracked"):
            np.testing.assert_array_equal(state[name], value.numpy())
