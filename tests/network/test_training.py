"""Training uses the training split only, and reports what it did."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dovetail
from dovetail.errors import DatasetError
from dovetail.frf import Frf
from dovetail.network import novelty
from dovetail.network.preprocessing import BLOCK_ROWS, log10p1
from dovetail.network.training import draw_test_samples

SDOF = Path(__file__).parents[2] / "assemblies" / "sdof.yaml"


class InMemoryDataset:
    """A dataset of arrays that belongs to whatever assembly it is given to."""

    def __init__(self, parameters: np.ndarray, frequency: np.ndarray, amplitude: np.ndarray) -> None:
        self.parameters, self.frequency, self.amplitude = parameters, frequency, amplitude
        self.storage = "amplitude"

    def __len__(self) -> int:
        return len(self.parameters)

    def require(self, assembly: dovetail.Assembly) -> None:
        assert len(assembly.frequency) == self.amplitude.shape[1]


def in_memory(dataset: dovetail.Dataset, samples: int) -> InMemoryDataset:
    return InMemoryDataset(
        dataset.parameters[:samples].copy(), dataset.frequency, np.array(dataset.amplitude[:samples])
    )


@pytest.fixture(scope="module")
def quick(with_settings: Callable[..., dovetail.Assembly]) -> dovetail.Assembly:
    return with_settings(
        reducer={"model": "pca", "n_components": 5},
        regressor={"model": "mlp", "hidden": [8, 8], "max_epochs": 3},
        test_fraction=0.25,
    )


def test_the_test_part_has_its_share_and_is_drawn_by_the_seed() -> None:
    is_test = draw_test_samples(200, 0.2, seed=4)
    assert is_test.sum() == 40
    np.testing.assert_array_equal(is_test, draw_test_samples(200, 0.2, seed=4))
    assert not np.array_equal(is_test, draw_test_samples(200, 0.2, seed=5))


@pytest.mark.parametrize(("samples", "fraction"), [(5, 0.2), (100, 0.001), (100, 0.999)])
def test_a_part_too_small_is_refused(samples: int, fraction: float) -> None:
    with pytest.raises(DatasetError, match="for training and"):
        draw_test_samples(samples, fraction, seed=0)


def test_nothing_of_the_test_part_reaches_the_network(quick: dovetail.Assembly, dataset: dovetail.Dataset) -> None:
    clean, spoilt = in_memory(dataset, 200), in_memory(dataset, 200)
    is_test = draw_test_samples(200, 0.25, seed=quick.description.identification.seed)
    spoilt.amplitude[is_test] *= 1e3
    spoilt.parameters[is_test] *= 7.0
    one, other = dovetail.train(quick, clean).network, dovetail.train(quick, spoilt).network
    np.testing.assert_array_equal(one.feature_scaling.mean, other.feature_scaling.mean)
    np.testing.assert_array_equal(one.feature_scaling.deviation, other.feature_scaling.deviation)
    np.testing.assert_array_equal(one.target_scaling.upper, other.target_scaling.upper)
    np.testing.assert_array_equal(one.predict(clean.amplitude), other.predict(clean.amplitude))


def test_the_scaling_is_that_of_the_training_part(
    with_settings: Callable[..., dovetail.Assembly], dataset: dovetail.Dataset
) -> None:
    assembly = with_settings(
        reducer={"model": "none"}, regressor={"model": "mlp", "hidden": [4, 4], "max_epochs": 1}, test_fraction=0.25
    )
    samples = in_memory(dataset, 200)
    is_test = draw_test_samples(200, 0.25, seed=assembly.description.identification.seed)
    network = dovetail.train(assembly, samples).network
    features = log10p1(samples.amplitude[~is_test]).astype(float)
    np.testing.assert_allclose(network.feature_scaling.mean, features.mean(axis=0), rtol=1e-9)
    np.testing.assert_allclose(network.feature_scaling.deviation, features.std(axis=0), rtol=1e-9)
    np.testing.assert_array_equal(network.target_scaling.upper, samples.parameters[~is_test].max(axis=0))


def test_the_metrics_are_those_of_the_test_part(quick: dovetail.Assembly, dataset: dovetail.Dataset) -> None:
    samples = in_memory(dataset, 200)
    is_test = draw_test_samples(200, 0.25, seed=quick.description.identification.seed)
    model = dovetail.train(quick, samples)
    error = model.predict_parameters(samples.amplitude[is_test]) - samples.parameters[is_test]
    metrics = model.evaluation.parameters["k"]
    assert metrics.mae_si == pytest.approx(np.abs(error[:, 0]).mean())
    assert (model.evaluation.training_samples, model.evaluation.test_samples) == (150, 50)


def test_rows_stay_with_their_targets_across_blocks(with_settings: Callable[..., dovetail.Assembly]) -> None:
    small = with_settings(
        reducer={"model": "pca", "n_components": 2},
        regressor={"model": "mlp", "hidden": [16, 16], "dropout": 0.0, "learning_rate": 0.01, "max_epochs": 15},
    )
    rng = np.random.default_rng(0)
    samples = BLOCK_ROWS + 500
    theta = small.from_unit(rng.random((samples, 2)))
    amplitude = np.zeros((samples, len(small.frequency)), dtype=np.float32)
    amplitude[:, :20] = small.to_unit(theta)[:, :1]
    amplitude[:, 20:] = small.to_unit(theta)[:, 1:]
    model = dovetail.train(small, InMemoryDataset(theta, small.frequency, amplitude))
    assert model.evaluation.mean_r2 > 0.99


def test_the_same_seed_trains_the_same_model(quick: dovetail.Assembly, dataset: dovetail.Dataset) -> None:
    samples = in_memory(dataset, 100)
    one, other = dovetail.train(quick, samples), dovetail.train(quick, samples)
    amplitude = samples.amplitude[:5]
    np.testing.assert_array_equal(one.predict_parameters(amplitude), other.predict_parameters(amplitude))


def test_without_a_dataset_one_is_generated(with_settings: Callable[..., dovetail.Assembly]) -> None:
    assembly = with_settings(
        samples=60,
        reducer={"model": "pca", "n_components": 5},
        regressor={"model": "mlp", "hidden": [8, 8], "max_epochs": 2},
    )
    stages: list[str] = []
    evaluation = dovetail.train(assembly, progress=lambda stage, *_: stages.append(stage)).evaluation
    assert (evaluation.training_samples, evaluation.test_samples) == (48, 12)
    assert list(evaluation.seconds) == [
        *("dataset", "features", "reducer", "reduction", "regressor", "evaluation", "novelty")
    ]
    assert all(seconds > 0 for seconds in evaluation.seconds.values())
    assert list(dict.fromkeys(stages))[:4] == ["generate", "features", "reducer", "reduction"]
    assert list(dict.fromkeys(stages))[5:] == ["evaluation", "novelty"]


@pytest.mark.parametrize(("samples", "held_out"), [(600, 40), (4000, 80)])
def test_the_novelty_statistics_are_taken_of_few_frfs(monkeypatch, samples: int, held_out: int) -> None:
    """Their time is that of these FRFs at each level of noise: one for each 40 of the training, 40 at least."""
    asked = []
    statistics = novelty._statistics

    def counted(*arguments):
        asked.append(1)
        return statistics(*arguments)

    monkeypatch.setattr(novelty, "_statistics", counted)
    monkeypatch.setattr(novelty, "in_parts", lambda work, count, _: [work(np.arange(count))])  # all in this process
    identification = {
        "samples": samples,
        "reducer": {"model": "pca", "n_components": 5},
        "regressor": {"model": "mlp", "hidden": [8, 4], "max_epochs": 1},
    }
    sdof = json.loads(dovetail.load(SDOF).description.text)
    dovetail.train(dovetail.load({**sdof, "identification": identification}))
    assert len(asked) == held_out * len(novelty._SETTINGS.noise_levels)


@pytest.mark.parametrize("quantity", ["receptance", "mobility", "accelerance"])
def test_novelty_estimates_noise_in_the_quantity_that_was_measured(quantity: str) -> None:
    frequency, generator = np.linspace(5.0, 120.0, 400), np.random.default_rng(1)
    noise = generator.standard_normal((2, 400)) / np.sqrt(2.0)
    clean = 1.0 / (1.0 - (frequency / 20.0) ** 2 + 0.5j * frequency / 20.0)
    not_given = Frf(frequency, clean + 0.01 * (noise[0] + 1j * noise[1]), quantity)
    amplitude = not_given.to("accelerance").amplitude
    basis = novelty.PrincipalComponents.fit(amplitude * generator.uniform(0.5, 2.0, (40, 1)), amplitude[np.newaxis])
    _, level, _ = novelty._statistics(basis, not_given, amplitude)
    _, given, _ = novelty._statistics(basis, replace(not_given, variance=np.full(400, 0.01**2)), amplitude)
    assert level == pytest.approx(given, rel=0.2)


@pytest.mark.parametrize("count", [40, 400])
def test_one_in_four_hundred_exceeds_a_novelty_limit_for_any_sample_size(count: int) -> None:
    from dovetail.network.novelty import _limit

    generator = np.random.default_rng(3)
    limits = [_limit(np.exp(0.3 * generator.standard_normal(count))) for _ in range(200)]
    new = np.exp(0.3 * generator.standard_normal(100_000))
    exceeding = np.mean([np.mean(new > limit) for limit in limits])
    assert 0.0005 < exceeding < 0.006


def test_few_frfs_of_statistics_with_long_tails_still_give_a_limit_that_few_exceed() -> None:
    """The logarithms have a normal distribution with a deviation of one."""
    generator = np.random.default_rng(3)
    limits = [novelty._limit(np.exp(generator.standard_normal(60))) for _ in range(200)]
    new = np.exp(generator.standard_normal(100_000))
    assert np.mean([np.mean(new > limit) for limit in limits]) < 0.005


def test_amplitudes_that_are_not_finite_are_refused(quick: dovetail.Assembly, dataset: dovetail.Dataset) -> None:
    samples = in_memory(dataset, 100)
    samples.amplitude[41, 7] = np.nan
    with pytest.raises(DatasetError, match="not finite"):
        dovetail.train(quick, samples)


def test_a_dataset_of_another_assembly_is_refused(collet: dovetail.Assembly, dataset: dovetail.Dataset) -> None:
    with pytest.raises(DatasetError, match="another description"):
        dovetail.train(collet, dataset)


def test_a_network_without_finite_predictions_on_noise_is_trained(assemblies, tmp_path):
    """Far from what it saw, the logarithms that it answers overflow: it is as unlike the measurement as can be."""
    ranges = "k: {range: [1e5 N/m, 1e7 N/m], scale: log}, c: {range: [1 N s/m, 100 N s/m], scale: log}"
    (tmp_path / "wide.yaml").write_text(
        f"extends: {assemblies / 'sdof.yaml'}\nname: wide\njoints: {{mount: {{parameters: {{{ranges}}}}}}}\n"
        "identification: {samples: 300, reducer: {model: none}, regressor: {model: mlp, hidden: [8], max_epochs: 3}}\n"
    )
    assert dovetail.train(tmp_path / "wide.yaml").evaluation.test_samples > 0
