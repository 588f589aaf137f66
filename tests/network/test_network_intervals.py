"""A network whose regressor gives a distribution: the same table as the posterior's, calibrated, in a file and back."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest

import dovetail
import dovetail_bench
from dovetail.errors import ParameterError
from dovetail.network.epochs import FreshEpochs
from support.mass_on_mount import GAUSSIAN_NETWORK, mass_on_mount
from support.waiting import PATIENCE

DESCRIPTION = mass_on_mount(
    {"start": 150, "stop": 600, "step": 2},
    {"k": {"range": [1e6, 1e7]}, "c": {"range": [20, 200]}},
    identification={
        **GAUSSIAN_NETWORK,
        "samples": 2500,
        "augmentation": {"additive": 0.0, "multiplicative": 0.1},
    },
)


@pytest.fixture(scope="module")
def model():
    return dovetail.train(dovetail.load(DESCRIPTION))


@pytest.fixture(scope="module")
def result(model):
    measured = dovetail.noisy_frf(model.assembly.simulate({"k": 4e6, "c": 80.0}), 0.02, 1, kind="proportional")
    began = time.perf_counter()
    result = model.identify(measured, "network")
    assert 0.0 < result.posterior.seconds < time.perf_counter() - began  # not those of the training
    return result


def test_the_table_of_a_network_has_intervals_and_verdicts(result):
    assert (result.table[0].name, result.table[0].verdict) == ("k", "identified")
    low, high = result.interval["k"]
    assert low < 4e6 < high < 1.2 * low
    assert result.parameters["k"].value == pytest.approx(result.posterior.estimate[0])


def test_the_intervals_are_calibrated_on_unseen_samples(model):
    """With noise of the middle of the training's levels: an amplitude has 0.7 of the complex noise."""
    done = dovetail_bench.calibrate(
        model.assembly, cases=120, noise=0.07, seed=5, method="network", model=model, noise_kind="proportional"
    )
    covered, _ = done.coverage
    assert 0.84 < covered < 0.96
    assert all(parameter.r2 > 0.8 for parameter in done.parameters)


@pytest.mark.parametrize("change", ["mass", "fixed", "narrower band"])
@pytest.mark.parametrize("method", ["network", "refined"])
def test_a_model_of_another_assembly_is_refused(model, change, method):
    other = json.loads(model.assembly.description.text)
    if change == "mass":
        other["substructures"]["mass"]["masses"][0]["mass"] = 2.0
    elif change == "fixed":
        other["joints"]["mount"]["parameters"]["c"] = {"value": 80.0}
    else:
        other["frequency"] = {"start": 200, "stop": 500, "step": 2}
    measured = model.assembly.simulate({"k": 4e6, "c": 80.0})
    if change == "narrower band":
        assert dovetail.identify(dovetail.load(other), measured, method, model=model).theta[0] == pytest.approx(
            4e6, rel=0.2
        )
        return
    with pytest.raises(ParameterError, match="trained for another assembly"):
        dovetail.identify(dovetail.load(other), measured, method, model=model)


def test_a_stored_model_gives_the_same_intervals(model, result, tmp_path):
    again = dovetail.load_model(model.save(tmp_path / "model")).identify(result.measured, "network")
    np.testing.assert_allclose(again.posterior.theta, result.posterior.theta, rtol=1e-6)


def test_calibrating_a_network_without_distribution_is_refused():
    identification = {"samples": 200, "reducer": {"model": "pca", "n_components": 5}}
    identification["regressor"] = {"model": "mlp", "hidden": [8], "max_epochs": 2}
    plain = dovetail.train(dovetail.load({**DESCRIPTION, "identification": identification}))
    with pytest.raises(ParameterError, match="the method 'network' gives no intervals here"):
        dovetail_bench.calibrate(plain.assembly, cases=2, method="network", model=plain)


def small(**changes):
    """Return the block with a small network and `changes` of its identification."""
    regressor = {"model": "mlp", "uncertainty": "gaussian", "hidden": [32], "learning_rate": 3e-3}
    identification = {"samples": 400, "reducer": {"model": "pca", "n_components": 10}, "regressor": regressor}
    return dovetail.load({**DESCRIPTION, "identification": {**identification, **changes}})


def test_fresh_training_sees_no_sample_twice(monkeypatch):
    seen = []
    epoch = FreshEpochs.__call__

    def watched(self, number):
        features, targets = epoch(self, number)
        seen.append(targets[0].tolist())
        return features, targets

    monkeypatch.setattr(FreshEpochs, "__call__", watched)
    regressor = {"model": "mlp", "hidden": [8], "max_epochs": 4, "patience": 10}
    model = dovetail.train(small(regressor=regressor), fresh=True)
    assert len(seen) == 4
    assert len({tuple(row) for row in seen}) == 4
    augmentation = model.assembly.description.identification.augmentation
    assert (augmentation.fresh, augmentation.additive) == (True, 0.2)


def test_a_time_ends_the_training_and_the_learning_rate_with_it():
    epochs = []

    def listen(stage, done, total, note=""):
        if stage == "regressor" and note:
            epochs.append(done)

    regressor = {"model": "mlp", "hidden": [8], "max_epochs": 100_000, "patience": 100_000}
    model = dovetail.train(small(regressor=regressor), minutes=0.02, progress=listen)
    assert 1 <= epochs[-1] < 100_000
    assert 1.0 < model.evaluation.seconds["regressor"] < PATIENCE


@pytest.mark.parametrize(("minutes", "regressor"), [(0.0, "mlp"), (float("nan"), "mlp"), (1.0, "sklearn")])
def test_a_time_that_cannot_be_is_refused(minutes, regressor):
    options = {"model": regressor, **({"estimator": "Ridge"} if regressor == "sklearn" else {})}
    with pytest.raises(ParameterError):
        dovetail.train(small(regressor=options), minutes=minutes)
