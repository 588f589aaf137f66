"""The optimizer of the networks: the steps of torch's own, without what torch loads for these."""

from __future__ import annotations

import subprocess
import sys

import pytest
import torch

from dovetail_plugins.regressors.training import Adam, TrainingConfig
from support.waiting import PATIENCE


def network() -> torch.nn.Module:
    torch.manual_seed(0)
    return torch.nn.Sequential(torch.nn.Linear(3, 4), torch.nn.ReLU(), torch.nn.Linear(4, 2))


@pytest.mark.parametrize(("name", "kind"), [("adam", torch.optim.Adam), ("adamw", torch.optim.AdamW)])
def test_its_steps_are_those_of_torch(name, kind):
    config = TrainingConfig(optimizer=name, learning_rate=0.01, weight_decay=0.2)
    ours, theirs = network(), network()
    adam, reference = Adam(ours, config, 0.0, None), kind(theirs.parameters(), 0.01, weight_decay=0.2, fused=True)
    for _ in range(5):
        inputs = torch.randn(8, 3)
        for trained, optimizer in ((ours, adam), (theirs, reference)):
            torch.autograd.backward(trained(inputs).square().mean())
            optimizer.step()
            trained.zero_grad()
    for weights, expected in zip(ours.parameters(), theirs.parameters(), strict=True):
        assert torch.equal(weights, expected)


def test_its_rate_is_that_of_torch_when_the_loss_no_longer_falls():
    config = TrainingConfig(learning_rate=0.01, patience=7)
    reference = torch.optim.Adam(network().parameters(), 0.01)
    plateau = torch.optim.lr_scheduler.ReduceLROnPlateau(reference, factor=0.5, patience=7 // 3)
    adam = Adam(network(), config, 0.0, None)
    for loss in [3.0, 2.0, 2.0, 2.1, 1.0, *[0.99999] * 8, 0.5, *[0.6] * 3, 0.4, -0.1, *[-0.100001] * 4]:
        adam.end_epoch(loss)
        plateau.step(loss)
        assert adam._rate == reference.param_groups[0]["lr"]
    assert adam._rate == 0.01 / 8


def test_a_training_does_not_load_the_compiler_of_torch():
    """Which takes longer than many trainings."""
    script = (
        "import sys, numpy as np\n"
        "from dovetail_plugins.regressors.mlp import MLP\n"
        "mlp = MLP(MLP.Config(max_epochs=2, hidden=(4,), uncertainty='gaussian'))\n"
        "mlp.fit(np.ones((9, 2), np.float32), np.full((9, 1), 0.5), seed=0)\n"
        "print('torch' in sys.modules, 'torch._dynamo' in sys.modules)\n"
    )
    printed = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=PATIENCE, check=True
    ).stdout
    assert printed.split() == ["True", "False"]
