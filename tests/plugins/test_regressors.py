"""The multilayer perceptron: it learns, it stops in time, and its answers are reproducible."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from pydantic import ValidationError
from safetensors.numpy import save_file
from scipy.special import ndtr, ndtri

import dovetail
from dovetail_plugins.regressors import gated_layers
from dovetail_plugins.regressors.gated_layers import GatedNetwork
from dovetail_plugins.regressors.mlp import MLP, _gaussians

SMALL = {"hidden": (24, 12), "batch_size": 32, "learning_rate": 1e-2, "dropout": 0.0}
KINDS = [{}, {"uncertainty": "gaussian"}, {"uncertainty": "gaussian", "activation": "gated"}]


def recipe(**options: object) -> MLP:
    return MLP(MLP.Config(**{**SMALL, **options}))


def samples(count: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Four features and two targets that are smooth functions of them."""
    features = np.random.default_rng(seed).standard_normal((count, 4)).astype(np.float32)
    targets = np.stack([np.tanh(features[:, 0] + features[:, 1]), 0.5 * features[:, 2] ** 2], axis=1)
    return features, targets.astype(np.float64)


@pytest.fixture(scope="module")
def training() -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    return samples(500, 0)


@pytest.fixture(scope="module")
def rows() -> NDArray[np.float32]:
    return samples(80, 1)[0]


@pytest.fixture(scope="module")
def fitted(training) -> dovetail.FittedRegressor:
    return recipe(max_epochs=60).fit(*training, seed=0)


class Log:
    """Keeps what `progress` is reported."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, int, int, str]] = []

    def __call__(self, stage: str, done: int, total: int, note: str = "") -> None:
        self.calls.append((stage, done, total, note))

    @property
    def losses(self) -> list[float]:
        return [float(re.fullmatch(r"validation loss (\S+)", note).group(1)) for *_, note in self.calls]


def test_it_learns_a_smooth_function(fitted, rows):
    wanted = samples(80, 1)[1]
    error = ((fitted.predict(rows) - wanted) ** 2).mean(axis=0)
    assert np.all(1.0 - error / wanted.var(axis=0) > 0.95)


@pytest.mark.parametrize("unit", ["relu", "silu"])
def test_prediction_is_the_forward_pass_of_torch(training, rows, unit):
    fitted = recipe(max_epochs=3, activation=unit).fit(*training, seed=0)
    state = {name: torch.tensor(value).double() for name, value in fitted.state().items() if name[-1].isdigit()}
    activation = torch.from_numpy(rows).double()
    for layer in range(3):
        activation = torch.nn.functional.linear(activation, state[f"weight{layer}"].T, state[f"bias{layer}"])
        activation = activation if layer == 2 else getattr(torch.nn.functional, unit)(activation)
    np.testing.assert_allclose(fitted.predict(rows), activation.numpy(), rtol=1e-12, atol=1e-14)


@pytest.mark.skipif(torch.accelerator.is_available(), reason="a GPU rounds otherwise than the processor")
def test_the_processor_trains_without_a_gpu(training, rows):
    fitted = [recipe(max_epochs=3, device=device).fit(*training, seed=0) for device in ("auto", "cpu")]
    np.testing.assert_array_equal(*(one.predict(rows) for one in fitted))


@pytest.mark.skipif(not torch.accelerator.is_available(), reason="there is no GPU")
@pytest.mark.parametrize("options", KINDS)
def test_a_gpu_learns_what_the_processor_learns(training, rows, options):
    fitted = [recipe(max_epochs=20, device=device, **options).fit(*training, seed=0) for device in ("auto", "cpu")]
    np.testing.assert_allclose(*(one.predict(rows) for one in fitted), rtol=0, atol=0.05)


@pytest.mark.parametrize("options", KINDS)
def test_a_training_step_leaves_nothing_on_the_processor(options):
    """On a device without memory every operation with a tensor elsewhere fails, as it would on a GPU."""
    mlp = recipe(**options)
    network = mlp.network(4, 2).to("meta")
    loss = mlp.loss(network, torch.rand(8, 4, device="meta"), torch.rand(8, 2, device="meta"))
    loss.backward()
    assert {loss.device.type, *(one.grad.device.type for one in network.parameters())} == {"meta"}


def test_the_two_hidden_layers_have_the_given_sizes(fitted):
    shapes = [fitted.state()[f"weight{layer}"].shape for layer in range(3)]
    assert shapes == [(4, 24), (24, 12), (12, 2)]


def test_one_row_gives_the_same_result_in_any_batch(fitted, rows):
    together = fitted.predict(rows)
    assert together.dtype == np.float64
    alone = np.concatenate([fitted.predict(rows[i : i + 1]) for i in range(len(rows))])
    np.testing.assert_allclose(alone, together, rtol=0, atol=1e-12)
    np.testing.assert_allclose(fitted.predict(np.tile(rows, (100, 1)))[-80:], together, rtol=0, atol=1e-12)


def test_a_new_process_gives_the_same_after_loading_without_torch(fitted, rows, tmp_path):
    save_file(dict(fitted.state()), tmp_path / "state.safetensors")
    np.save(tmp_path / "rows.npy", rows)
    script = """
import sys
import numpy as np
from safetensors.numpy import load_file
from dovetail_plugins.regressors.mlp import MLP, _gaussians
np.save("answer.npy", MLP().restore(load_file("state.safetensors")).predict(np.load("rows.npy")))
print(*{"torch", "umap", "numba", "sklearn"} & set(sys.modules))
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
    np.testing.assert_allclose(np.load(tmp_path / "answer.npy"), fitted.predict(rows), rtol=0, atol=1e-12)


def test_the_same_seed_gives_the_same_network_and_another_seed_another(training, fitted):
    again = recipe(max_epochs=60).fit(*training, seed=0)
    for name, value in fitted.state().items():
        np.testing.assert_array_equal(again.state()[name], value)
    other = recipe(max_epochs=1).fit(*training, seed=1).state()["weight0"]
    assert not np.allclose(other, recipe(max_epochs=1).fit(*training, seed=0).state()["weight0"])


def test_training_leaves_the_callers_torch_as_it_was(training):
    threads = torch.get_num_threads()
    torch.set_num_threads(3)
    try:
        torch.manual_seed(7)
        random_state = torch.get_rng_state()
        recipe(max_epochs=2).fit(*training, seed=0)
        assert torch.equal(torch.get_rng_state(), random_state)
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(threads)


def test_training_does_not_depend_on_the_callers_random_numbers(training):
    torch.manual_seed(1)
    first = recipe(max_epochs=2, dropout=0.3).fit(*training, seed=0).state()["weight0"]
    torch.manual_seed(2)
    np.testing.assert_array_equal(recipe(max_epochs=2, dropout=0.3).fit(*training, seed=0).state()["weight0"], first)


def test_progress_reports_every_epoch_and_its_validation_loss(training):
    log = Log()
    recipe(max_epochs=5).fit(*training, seed=0, progress=log)
    assert [call[:3] for call in log.calls] == [("regressor", epoch, 5) for epoch in range(1, 6)]
    assert log.losses[-1] < log.losses[0]


def test_the_validation_loss_is_that_of_the_network_without_dropout():
    features, targets = np.ones((50, 4), dtype=np.float32), np.ones((50, 2))
    log = Log()
    network = recipe(max_epochs=1, dropout=0.5).fit(features, targets, seed=0, progress=log)
    assert log.losses == [pytest.approx(np.mean((network.predict(features) - targets) ** 2), rel=1e-4)]


def test_training_stops_when_the_validation_loss_no_longer_falls():
    generator = np.random.default_rng(0)
    features = generator.standard_normal((200, 4)).astype(np.float32)
    noise = generator.standard_normal((200, 2))
    log = Log()
    recipe(max_epochs=200, patience=6).fit(features, noise, seed=0, progress=log)
    best = int(np.argmin(log.losses)) + 1
    assert len(log.calls) == best + 6
    assert log.calls[-1][1:3] == (best + 6, 200)


def test_the_network_of_the_best_epoch_is_kept():
    generator = np.random.default_rng(0)
    features = generator.standard_normal((200, 4)).astype(np.float32)
    noise = generator.standard_normal((200, 2))
    log = Log()
    stopped = recipe(max_epochs=200, patience=6).fit(features, noise, seed=0, progress=log)
    best = int(np.argmin(log.losses)) + 1
    until_best = recipe(max_epochs=best, patience=6).fit(features, noise, seed=0)
    np.testing.assert_array_equal(stopped.state()["weight0"], until_best.state()["weight0"])
    one_more = recipe(max_epochs=best + 1, patience=6).fit(features, noise, seed=0)
    np.testing.assert_array_equal(one_more.state()["weight0"], until_best.state()["weight0"])


def test_gated_layers_agree_with_torch_and_learn_products_faster(training, rows):
    """One half of the units multiplies the other, which is what a curved valley needs."""
    features, _ = training
    product = (features[:, :1] * features[:, 1:2] * features[:, 2:3]).astype(np.float64)
    network = recipe(activation="gated").network(4, 1)
    expected = network(torch.from_numpy(rows)).detach().numpy()
    answers = recipe(activation="gated").fitted(network).predict(rows)
    np.testing.assert_allclose(answers, expected, rtol=1e-5, atol=1e-6)
    options = {"hidden": (24, 24), "max_epochs": 20, "learning_rate": 3e-3, "patience": 20}
    errors = {
        activation: np.std(
            recipe(**options, activation=activation).fit(features, product, seed=0).predict(features) - product
        )
        for activation in ("silu", "gated")
    }
    assert errors["gated"] < 0.8 * errors["silu"]


@pytest.mark.parametrize("uncertainty", ["none", "gaussian"])
def test_gated_layers_are_kept_and_read_again(training, rows, uncertainty):
    mlp = recipe(activation="gated", uncertainty=uncertainty, max_epochs=3)
    fitted = mlp.fit(training[0], np.clip(training[1] / 2.0 + 0.5, 0.0, 1.0), seed=0)
    again = mlp.restore(fitted.state())
    np.testing.assert_allclose(again.predict(rows), fitted.predict(rows), rtol=1e-5)
    with pytest.raises(dovetail.DovetailError, match="weight2"):
        mlp.restore({**fitted.state(), "weight2": np.zeros((5, 24), np.float32)})


def test_one_cycle_makes_every_epoch_and_ends_in_a_minimum(training):
    """With a rate that has not fallen the loss still jumps where that of one cycle has settled."""
    steady, cycle = Log(), Log()
    options = {"max_epochs": 30, "learning_rate": 0.01, "batch_size": 32, "patience": 29}
    recipe(**options).fit(*training, seed=0, progress=steady)
    recipe(**options | {"patience": 3}, schedule="one_cycle").fit(*training, seed=0, progress=cycle)
    assert len(cycle.losses) == 30
    assert cycle.losses[-1] < 1.01 * min(cycle.losses)
    assert np.std(cycle.losses[-5:]) < 0.2 * np.std(steady.losses[-5:])


@pytest.mark.parametrize("schedule", ["plateau", "one_cycle"])
def test_more_time_than_all_epochs_take_does_no_harm(training, rows, schedule):
    context = dovetail.FeatureContext(np.arange(1.0, 5.0), ("one",), ("a", "b"), seconds=3600.0)
    fitted = recipe(schedule=schedule, max_epochs=30).fit(*training, seed=0, context=context)
    error, wanted = fitted.predict(rows) - samples(80, 1)[1], samples(80, 1)[1]
    assert np.all(1.0 - (error**2).mean(axis=0) / wanted.var(axis=0) > 0.95)


def test_l2_regularisation_makes_the_weights_smaller(training):
    free, held = (recipe(max_epochs=10, weight_decay=decay).fit(*training, seed=0) for decay in (0.0, 0.1))
    assert np.linalg.norm(held.state()["weight0"]) < 0.5 * np.linalg.norm(free.state()["weight0"])


def test_adamw_decays_the_weights(training):
    """In the loss a factor so small does nothing that is seen next to the gradients."""
    options = {"max_epochs": 30, "learning_rate": 3e-3, "weight_decay": 2.0, "optimizer": "adamw"}
    held, free = (recipe(**options | change).fit(*training, seed=0) for change in ({}, {"weight_decay": 0.0}))
    assert np.linalg.norm(held.state()["weight0"]) < 0.8 * np.linalg.norm(free.state()["weight0"])


def test_intervals_contain_90_percent_for_small_and_large_noise_with_any_tails():
    """The likeliest Gaussian follows the variance, and holds up to 96 %."""

    def draw(count, seed):
        generator = np.random.default_rng(seed)
        features = generator.standard_normal((count, 2)).astype(np.float32)
        little, much = generator.uniform(-0.17, 0.17, count), 0.3 * generator.standard_t(3, count)
        is_noisy = features[:, 1] > 0.0
        errors = np.stack([np.where(is_noisy, much, little), 0.2 * generator.standard_normal(count)], axis=1)
        return features, ndtr(0.5 * features[:, :1] + errors), is_noisy

    features, targets, _ = draw(20_000, 1)
    options = {"hidden": (16,), "max_epochs": 40, "batch_size": 256, "validation_fraction": 0.5}
    fitted = recipe(**options, uncertainty="gaussian").fit(features, targets, seed=0)
    features, targets, is_noisy = draw(10_000, 2)
    low, high = np.quantile(fitted.predict_distribution(features).samples, [0.05, 0.95], axis=1)
    held = (low <= targets) & (targets <= high)
    for rows in (is_noisy, ~is_noisy):
        np.testing.assert_allclose(held[rows].mean(axis=0), 0.9, atol=0.02)


def test_a_calibration_keeps_means_and_correlations_and_needs_samples_enough(training):
    mlp = recipe(max_epochs=3, uncertainty="gaussian")
    features, targets = training[0], np.clip(training[1] / 2.0 + 0.5, 0.0, 1.0)
    fitted = mlp.fit(features, targets, seed=0)
    wider = fitted.calibrated(features, ndtri(np.clip(targets, 1e-3, 1.0 - 1e-3)))
    plain, calibrated = (ndtri(each.predict_distribution(features[:1]).samples[0]) for each in (fitted, wider))
    np.testing.assert_allclose(calibrated.mean(axis=0), plain.mean(axis=0), atol=0.02)
    np.testing.assert_allclose(np.corrcoef(calibrated.T), np.corrcoef(plain.T), atol=1e-6)
    assert not np.allclose(calibrated.std(axis=0), plain.std(axis=0), rtol=0.02)
    np.testing.assert_array_equal(mlp.restore(wider.state()).predict(features), wider.predict(features))
    with pytest.raises(dovetail.DovetailError, match="factors"):
        mlp.restore({**wider.state(), "factors": np.ones((1, 3))})
    held_back = (torch.from_numpy(features[:100]), torch.from_numpy(targets[:100]))
    assert mlp.calibrated(fitted, held_back) is fitted


def test_dropout_changes_training_and_not_prediction(training, rows):
    dropped = recipe(max_epochs=3, dropout=0.5).fit(*training, seed=0)
    assert not np.allclose(
        dropped.state()["weight0"], recipe(max_epochs=3, dropout=0.0).fit(*training, seed=0).state()["weight0"]
    )
    np.testing.assert_array_equal(dropped.predict(rows), dropped.predict(rows))


def test_changing_the_state_afterwards_changes_nothing(fitted, rows):
    before = fitted.predict(rows)
    for value in fitted.state().values():
        value[...] = 0.0
    np.testing.assert_array_equal(fitted.predict(rows), before)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(fitted, training, rows, value):
    rows = rows.copy()
    rows[5, 2] = value
    with pytest.raises(dovetail.DovetailError, match=r"row 5, column 2 is -?(nan|inf), which is not finite"):
        fitted.predict(rows)
    features, targets = training[0].copy(), training[1].copy()
    features[5, 2] = value
    with pytest.raises(dovetail.DovetailError, match=r"mlp'\n.*row 5, column 2"):
        recipe().fit(features, training[1], seed=0)
    targets[9, 1] = value
    with pytest.raises(dovetail.DovetailError, match=r"mlp', targets\n.*row 9, column 1"):
        recipe().fit(training[0], targets, seed=0)


def test_another_width_is_refused(fitted, rows):
    with pytest.raises(dovetail.DovetailError, match=r"given 3 columns, but was fitted to 4"):
        fitted.predict(rows[:, :3])


def test_one_row_without_its_sample_axis_is_refused(fitted, rows):
    with pytest.raises(dovetail.DovetailError, match=r"shape \(4,\)"):
        fitted.predict(rows[0])


def test_features_and_targets_of_different_length_are_refused(training):
    with pytest.raises(dovetail.DovetailError, match=r"500 rows of features and 499 of targets"):
        recipe().fit(training[0], training[1][:-1], seed=0)


def test_too_few_samples_are_refused(training):
    with pytest.raises(dovetail.DovetailError, match=r"2 samples are too few"):
        recipe().fit(training[0][:2], training[1][:2], seed=0)


@pytest.mark.parametrize("name", ["weight0", "weight2", "bias1"])
def test_a_damaged_state_is_refused(fitted, name):
    state = dict(fitted.state())
    with pytest.raises(dovetail.DovetailError, match=f"lacks '{name}'"):
        MLP().restore({key: value for key, value in state.items() if key != name})
    with pytest.raises(dovetail.DovetailError, match="its state has"):
        MLP().restore({**state, name: state[name][..., :-1]})
    with pytest.raises(dovetail.DovetailError, match="not finite"):
        MLP().restore({**state, name: np.full_like(state[name], np.nan)})


def test_an_unknown_activation_is_refused(fitted):
    with pytest.raises(dovetail.DovetailError, match="has the activation 'step'"):
        MLP().restore({**fitted.state(), "activation": "step"})


@pytest.mark.parametrize(
    "options",
    [
        {"hidden": ()},
        {"hidden": (8,) * 9},
        {"uncertainty": "some"},
        {"activation": "step"},
        {"hidden": (512, 0)},
        {"dropout": 1.0},
        {"weight_decay": -1e-3},
        {"optimizer": "sgd"},
        {"squared_error": -1.0},
        {"precision": "double"},
        {"learning_rate": 0.0},
        {"batch_size": 0},
        {"max_epochs": 0},
        {"patience": 0},
        {"validation_fraction": 1.0},
        {"layers": 3},
    ],
)
def test_options_out_of_bounds_are_refused(options):
    with pytest.raises(ValidationError):
        MLP.Config(**options)


def test_training_that_diverges_is_explained(training):
    with pytest.raises(dovetail.DovetailError, match=r"no longer finite after epoch \d+\.\n.*'learning_rate' below"):
        recipe(learning_rate=1e30, max_epochs=20).fit(*training, seed=0)


def test_training_accepts_read_only_arrays_and_changes_no_others(training):
    features, targets = training[0].copy(), training[1].astype(np.float32)
    writable = recipe(max_epochs=2).fit(features, targets, seed=0).state()["weight0"]
    np.testing.assert_array_equal(features, training[0])
    features.flags.writeable = targets.flags.writeable = False
    np.testing.assert_array_equal(recipe(max_epochs=2).fit(features, targets, seed=0).state()["weight0"], writable)


def test_a_gaussian_far_from_all_features_stays_finite_and_no_surer(training):
    """A hundred standard deviations away the answer is that of eight."""
    gaussian = recipe(max_epochs=3, uncertainty="gaussian").fit(*training, seed=0)
    far, farther = (np.full((1, 4), distance, dtype=np.float32) for distance in (8.0, 1e6))
    reported, same = (gaussian.predict_distribution(row).samples for row in (far, farther))
    assert np.isfinite(reported).all()
    np.testing.assert_array_equal(reported, same)


def test_a_steep_factor_is_inverted():
    """As exactly as its condition allows, where a general solver says that it is singular."""
    factor = np.eye(12)[np.newaxis] * np.exp(-9.0)
    factor[0, 11, :11] = 1e3
    output = np.zeros((1, 12 + 78))
    output[:, 12:] = factor[:, *np.tril_indices(12)]
    rows = np.cumsum(np.arange(1, 13)) - 1
    output[:, 12 + rows] = -9.0
    _, inverse = _gaussians(output)
    np.testing.assert_allclose(factor @ inverse, np.eye(12)[np.newaxis], atol=1e-6)


def test_the_squared_error_speeds_up_uncertain_targets():
    """Eleven targets that are reported exactly outweigh in the likelihood one that is reported within its noise."""
    generator = np.random.default_rng(0)
    features = generator.standard_normal((2000, 12)).astype(np.float32)
    quantiles = features + np.where(np.arange(12) == 0, 1.0, 0.0) * generator.standard_normal(features.shape)
    options = {"uncertainty": "gaussian", "activation": "gated", "max_epochs": 8, "patience": 8, "dropout": 0.0}

    def error(factor: float) -> float:
        reported = recipe(**options, squared_error=factor).fit(features, ndtr(quantiles), seed=0).predict(features)
        return float(np.mean((reported[:, 0] - ndtr(features[:, 0] / np.sqrt(2.0))) ** 2))

    assert error(10.0) < 0.8 * error(0.0)


def test_mixed_precision_rounds_only_during_training(training, monkeypatch):
    """The processor's speed decides whether it does; what it learns is the same but for rounding."""
    network = GatedNetwork(4, (16, 16), 3, 0.0, mixed=True)
    inputs = torch.from_numpy(training[0])
    rounded = network(inputs)
    exact = network.eval()(inputs)
    assert rounded.dtype == torch.float32
    assert 0.0 < float((rounded - exact).detach().abs().max()) < 0.05
    answers = []
    for is_faster in (True, False):
        monkeypatch.setattr(gated_layers, "is_faster_in_bfloat16", lambda is_faster=is_faster: is_faster)
        mlp = recipe(activation="gated", max_epochs=20, learning_rate=3e-3, precision="mixed")
        answers.append(mlp.fit(*training, seed=0).predict(training[0]))
    assert 0.0 < np.std(answers[0] - answers[1]) < 0.1 * np.std(answers[1])
