"""The study of robustness to noise."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.assembly import components
from dovetail.errors import PluginError
from dovetail.evaluation import robustness
from dovetail.evaluation.robustness import with_reducer


@pytest.fixture(scope="module")
def study(sdof, tmp_path_factory):
    description = json.loads(sdof.description.text)
    description["identification"].update(
        samples=1000, reducer={"model": "pca", "n_components": 12}, regressor={"model": "mlp", "batch_size": 64}
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


def test_a_row_is_flat_for_a_table(study):
    assert list(study[2][0].flat()) == ["model", "level", "r2", "rmse", "r2 k", "r2 c"]


def test_another_reducer_takes_the_number_of_components(sdof):
    assert with_reducer(sdof, "pca", components()).description.identification.reducer.config.n_components == 20
    assert with_reducer(sdof, "umap", components()) is sdof
    with pytest.raises(PluginError, match="'tsne' is not a reducer model"):
        with_reducer(sdof, "tsne", components())
