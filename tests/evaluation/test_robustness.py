"""The study of robustness to noise."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.errors import PluginError
from dovetail.measurement import data_noise
from dovetail.registry import components
from dovetail_bench import robustness
from dovetail_bench.evaluation.robustness import variant, with_noise


@pytest.fixture(scope="module")
def study(sdof, tmp_path_factory):
    description = json.loads(sdof.description.text)
    description["identification"].update(
        samples=1000,
        reducer={"model": "pca", "n_components": 12},
        regressor={"model": "mlp", "hidden": [128, 64], "batch_size": 64},
    )
    assembly = dovetail.load(description)
    dataset = dovetail.generate(assembly, tmp_path_factory.mktemp("study") / "data.zarr")
    return assembly, dataset, robustness(assembly, dataset, models=["pca", "none"], levels=[0.0, 0.1, 0.3])


def test_every_model_meets_every_level(study):
    assert [(row.model, row.level) for row in study[2]] == [
        (m, level) for m in ("pca", "none") for level in (0, 0.1, 0.3)
    ]


def test_the_clean_row_is_the_evaluation_of_training(study):
    assembly, dataset, rows = study
    evaluation = dovetail.train(assembly, dataset).evaluation
    assert rows[0].r2 == pytest.approx(evaluation.mean_r2, abs=1e-9)
    squares = [metrics.rmse**2 for metrics in evaluation.parameters.values()]
    assert rows[0].rmse == pytest.approx(np.sqrt(np.mean(squares)), abs=1e-9)


def test_noise_costs_accuracy(study):
    for model in ("pca", "none"):
        r2 = [row.r2 for row in study[2] if row.model == model]
        rmse = [row.rmse for row in study[2] if row.model == model]
        assert r2[0] > 0.7
        assert r2[0] > r2[1] > r2[2]
        assert rmse[0] < rmse[1] < rmse[2]


def test_noise_has_the_size_of_each_response():
    clean = np.random.default_rng(0).normal(100.0, 1.0, (400, 60)).astype(np.float32)
    clean[:, 30:] *= 1000.0
    one, other = np.split(with_noise(clean, 2, 0.1, 0) - clean, 2, axis=1)
    assert one.std() == pytest.approx(0.1, rel=0.05)
    assert other.std() == pytest.approx(100.0, rel=0.05)
    assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 0.05
    np.testing.assert_array_equal(with_noise(clean, 1, 0.1, 3), np.abs(data_noise(clean, 0.1, 3)).astype(np.float32))


def test_robust_training_with_a_residual_mass_keeps_phases(sdof):
    description = json.loads(sdof.description.text)
    regressor = {"model": "mlp", "hidden": [16], "max_epochs": 2}
    described = {"samples": 50, "reducer": {"model": "none"}, "regressor": regressor, "augmentation": {"mass": "1 g"}}
    rows = robustness(dovetail.load({**description, "identification": described}), models=["none+robust"], levels=[0.0])
    assert len(rows) == 1


@pytest.mark.slow
def test_umap_takes_part(study):
    assembly, dataset, _ = study
    clean, noisy = robustness(assembly, dataset, models=["umap"], levels=[0.0, 0.3])
    assert clean.r2 > 0.3
    assert clean.r2 > noisy.r2
    assert clean.rmse < noisy.rmse


def test_a_row_is_flat_for_a_table(study):
    assert list(study[2][0].flat()) == ["model", "level", "r2", "rmse", "r2 k", "r2 c"]


def test_another_reducer_takes_the_number_of_components(sdof):
    assert variant(sdof, "pca", components()).description.identification.reducer.config.n_components == 20
    with pytest.raises(PluginError, match="'tsne' is not a reducer model"):
        variant(sdof, "tsne", components())


def test_the_text_of_a_variant_describes_its_changes(sdof):
    plain, robust = variant(sdof, "pca", components()), variant(sdof, "pca+robust", components())
    assert json.loads(plain.description.text)["identification"]["reducer"]["model"] == "pca"
    assert plain.description.identification.augmentation is None
    assert dovetail.load(json.loads(robust.description.text)).description.identification.augmentation is not None
    assert variant(robust, "pca", components()).description.identification.augmentation is None
    assert robust.description.fingerprint == sdof.description.fingerprint


def test_a_model_is_trained_plainly_or_robustly(sdof):
    with pytest.raises(PluginError, match="'sturdy' is nothing that a model can be trained with"):
        variant(sdof, "pca+sturdy", components())


def test_robust_training_costs_little_and_keeps_much(study):
    assembly, dataset, rows = study
    plain = {row.level: row.r2 for row in rows if row.model == "pca"}
    robust = robustness(assembly, dataset, models=["pca+robust"], levels=[0.0, 0.1])
    assert robust[0].r2 > plain[0.0] - 0.05
    assert robust[1].r2 > plain[0.1] + 0.1
