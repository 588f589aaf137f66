"""The normalising flow: non-Gaussian distributions, reproducible answers, and the error if its package is missing."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numpy.typing import NDArray

import dovetail
import dovetail_bench
from dovetail_plugins.regressors.flow import Flow
from dovetail_plugins.regressors.mlp import MLP
from support.mass_on_mount import mass_on_mount
from support.packages import skip_module_without
from support.waiting import PATIENCE

skip_module_without("zuko")

SMALL = {"hidden": (32,), "transforms": 1, "units": 32, "dropout": 0.0, "batch_size": 200, "learning_rate": 1e-2}
BLOCK = mass_on_mount(
    {"start": 150, "stop": 600, "step": 2},
    {"k": {"range": [1e6, 1e7]}, "c": {"range": [20, 200]}},
    identification={
        "samples": 2000,
        "reducer": {"model": "pca", "n_components": 20},
        "regressor": {"model": "flow", **SMALL, "hidden": [64], "max_epochs": 30, "patience": 8},
        "augmentation": {"additive": 0.0, "multiplicative": 0.1},
    },
)


def parabola(count: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """What is seen of x, even from 0 to 1, is (2 x - 1)^2 with noise: two values of x are as likely as each other."""
    generator = np.random.default_rng(seed)
    x = generator.random((count, 1))
    return standardised((2.0 * x - 1.0) ** 2 + 0.05 * generator.standard_normal((count, 1))), x


def standardised(seen: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.asarray((seen - 1.0 / 3.0) / 0.3, dtype=np.float32)


@pytest.fixture(scope="module")
def fitted() -> dovetail.FittedRegressor:
    return Flow(Flow.Config(**SMALL, max_epochs=20, patience=6)).fit(*parabola(3000, 1), seed=0)


@pytest.fixture(scope="module")
def rows() -> NDArray[np.float32]:
    return parabola(40, 3)[0]


def test_a_distribution_with_two_branches_has_both_and_nothing_between(fitted):
    """The branches of 0.64 are at 0.1 and 0.9, a few hundredths wide; a Gaussian of the same features fills the gap."""
    seen = standardised(np.array([[0.64]]))
    draws = fitted.predict_distribution(seen).samples[0, :, 0]
    for branch in (0.1, 0.9):
        assert np.mean(np.abs(draws - branch) < 0.1) == pytest.approx(0.5, abs=0.08)
    assert np.mean((draws > 0.25) & (draws < 0.75)) < 0.03
    options = {"uncertainty": "gaussian", "activation": "silu", "hidden": (64, 64), "dropout": 0.0}
    gaussian = MLP(MLP.Config(**options, max_epochs=20, learning_rate=3e-3)).fit(*parabola(3000, 1), seed=0)
    straight = gaussian.predict_distribution(seen).samples[0, :, 0]
    assert np.mean((straight > 0.25) & (straight < 0.75)) > 0.25


def test_its_intervals_hold_the_truth_as_often_as_they_say(fitted):
    """Of 2000 cases, 90 % and 50 % with a standard deviation of 0.7 % and 1.1 % if the distribution is right."""
    features, targets = parabola(2000, 2)
    below = np.mean(fitted.predict_distribution(features).samples < targets[:, np.newaxis], axis=1)
    assert np.mean(np.abs(2.0 * below - 1.0) < 0.9) == pytest.approx(0.9, abs=0.03)
    assert np.mean(np.abs(2.0 * below - 1.0) < 0.5) == pytest.approx(0.5, abs=0.06)


def test_a_row_gives_the_same_result_in_any_batch(fitted, rows):
    together, means = fitted.predict_distribution(rows).samples, fitted.predict(rows)
    assert (together.shape, together.dtype) == ((40, 500, 1), np.float64)
    alone = np.concatenate([fitted.predict_distribution(row[np.newaxis]).samples for row in rows])
    np.testing.assert_allclose(alone, together, rtol=0, atol=1e-4)
    np.testing.assert_allclose(np.concatenate([fitted.predict(row[np.newaxis]) for row in rows]), means, atol=1e-4)
    np.testing.assert_allclose(means, together.mean(axis=1), atol=0.03)


def test_the_number_of_threads_does_not_matter(rows):
    import torch

    before, states, answers = torch.get_num_threads(), [], []
    try:
        for threads in (1, 2):
            torch.set_num_threads(threads)
            again = Flow(Flow.Config(**SMALL, max_epochs=2)).fit(*parabola(600, 1), seed=4)
            states.append(again.state())
            answers.append(again.predict(rows))
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    for name, values in states[0].items():
        np.testing.assert_array_equal(states[1][name], values)
    np.testing.assert_allclose(answers[1], answers[0], atol=1e-6)


@pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux alone")
def test_forked_processes_ask_it_though_the_threads_of_torch_are_not_theirs():
    """In a process of its own, which is ended where it waits without end."""
    script = """
import numpy as np, torch
from dovetail.parallel import side_by_side
from dovetail_plugins.regressors.flow import Flow
torch.set_num_threads(2)
torch.rand(2000, 2000).exp().sum()
flow = Flow(Flow.Config(hidden=(8,), transforms=1))
fitted = flow.fitted(flow.network(3, 2))
row = np.zeros((1, 3), np.float32)
here = fitted.predict_distribution(row).samples
answers = side_by_side(lambda _: fitted.predict_distribution(row).samples, 2, 2)
assert all(np.array_equal(there, here) for _, there in answers)
"""
    subprocess.run([sys.executable, "-c", script], check=True, timeout=PATIENCE)


def test_a_state_that_is_not_of_a_flow_is_refused(fitted, rows):
    state = dict(fitted.state())
    np.testing.assert_array_equal(Flow().restore(state).predict(rows), fitted.predict(rows))
    weight = next(name for name in state if name.endswith("weight"))
    sizes = state["sizes"].copy()
    sizes[1] = 10**9
    without = {name: values for name, values in state.items() if name != weight}
    for damaged in (
        without,
        {**state, weight: state[weight][:-1]},
        {**state, "sizes": sizes},
        {**state, "sizes": sizes[:3]},
    ):
        with pytest.raises(dovetail.DovetailError, match="regressor 'flow'\n  its state"):
            Flow().restore(damaged)


def test_a_missing_package_is_an_error_with_the_install_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "zuko", None)
    with pytest.raises(dovetail.DovetailError) as error:
        Flow().fit(*parabola(20, 1), seed=0)
    assert 'pip install "dovetail-frf[flow]"' in error.value.faults[0].remedy


def described(**changes: object) -> dovetail.Assembly:
    """Return the block with other options of its flow, or other settings of its training."""
    section = BLOCK["identification"]
    own = {name: changes.pop(name) for name in ("max_epochs", "patience") if name in changes}
    regressor = {**section["regressor"], **own}
    return dovetail.load({**BLOCK, "identification": {**section, **changes, "regressor": regressor}})


def test_a_network_with_a_flow_has_intervals_and_is_stored(tmp_path):
    model = dovetail.train(described(samples=500, max_epochs=10))
    result = model.identify(model.assembly.simulate({"k": 4e6, "c": 80.0}), "network")
    low, high = result.interval["k"]
    assert 1e6 < low < 4e6 < high < 1e7
    again = dovetail.load_model(model.save(tmp_path / "model")).identify(result.measured, "network")
    np.testing.assert_allclose(again.posterior.theta, result.posterior.theta, rtol=1e-5)


@pytest.mark.slow
def test_a_network_with_a_flow_is_calibrated():
    """With noise of the middle of the training's levels: an amplitude has 0.7 of the complex noise."""
    model = dovetail.train(described())
    noise = {"noise": 0.07, "noise_kind": "proportional"}
    done = dovetail_bench.calibrate(model.assembly, cases=200, seed=5, method="network", model=model, **noise)
    assert 0.83 < done.coverage[0] < 0.96
    assert all(parameter.r2 > 0.7 for parameter in done.parameters)


def test_it_learns_from_endless_data_until_a_time_is_up():
    epochs = []

    def listen(stage, done, total, note=""):
        if stage == "regressor":
            epochs.append(done)

    endless = described(samples=200, max_epochs=100_000, patience=100_000)
    model = dovetail.train(endless, fresh=True, minutes=0.02, progress=listen)
    assert 1 <= epochs[-1] < 100_000
    assert 1.0 < model.evaluation.seconds["regressor"] < PATIENCE
