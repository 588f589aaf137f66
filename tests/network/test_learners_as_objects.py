"""Reducers and regressors that `train` takes: names, objects, estimators of scikit-learn, sections."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.decomposition import PCA, KernelPCA
from sklearn.ensemble import RandomForestRegressor
from sklearn.kernel_ridge import KernelRidge

import dovetail
from dovetail.registry import installed_components
from support.small_joints import ASSEMBLIES

PCA_SECTION = {"model": "pca", "n_components": 4}
RIDGE_SECTION = {"model": "sklearn", "estimator": "KernelRidge", "options": {"alpha": 0.1, "kernel": "rbf"}}


@pytest.fixture(scope="module")
def sdof():
    band = {"start": "200 Hz", "stop": "400 Hz", "step": "4 Hz"}
    return dovetail.load({"extends": str(ASSEMBLIES / "sdof.yaml"), "name": "few lines", "frequency": band})


@pytest.fixture(scope="module")
def dataset(sdof, tmp_path_factory):
    return dovetail.generate(sdof, tmp_path_factory.mktemp("data") / "data.zarr", samples=120)


def shipped(kind, name, **options):
    model = installed_components().find(kind, name).component
    return model(model.Config(**options))


class Logarithms(dovetail.Reducer):
    """Every tenth line: a reducer that no plugin offers."""

    name = "every_tenth"
    summary = "Every tenth line"

    def fit(self, features, *, seed):
        return Tenth()

    def restore(self, state):
        return Tenth()


class Tenth(dovetail.FittedReducer):
    def transform(self, features):
        return np.ascontiguousarray(features[:, ::10])

    def state(self):
        return {}


@pytest.mark.parametrize(
    ("reducer", "regressor"),
    [
        (PCA_SECTION, RIDGE_SECTION),
        (shipped("reducer", "pca", n_components=4), KernelRidge(alpha=0.1, kernel="rbf")),
        (shipped("reducer", "pca", n_components=4), shipped("regressor", "sklearn", estimator="KernelRidge",
                                                            options={"alpha": 0.1, "kernel": "rbf"})),
    ],
    ids=["sections", "object and estimator", "objects"],
)  # fmt: skip
def test_all_forms_train_the_same_network_which_can_be_saved(sdof, dataset, tmp_path, reducer, regressor):
    expected = dovetail.train(sdof, dataset, reducer=PCA_SECTION, regressor=RIDGE_SECTION)
    model = dovetail.train(sdof, dataset, reducer=reducer, regressor=regressor)
    amplitude = dataset.amplitude[:5]
    np.testing.assert_array_equal(model.predict_parameters(amplitude), expected.predict_parameters(amplitude))
    again = dovetail.load_model(model.save(tmp_path / "model"))
    np.testing.assert_allclose(again.predict_parameters(amplitude), expected.predict_parameters(amplitude))


def test_a_name_takes_the_defaults_of_its_options_and_others_stay(sdof, dataset):
    model = dovetail.train(sdof, dataset, reducer="none", regressor=KernelRidge())
    assert model.assembly.description.identification.reducer.name == "none"
    assert model.assembly.description.identification.seed == sdof.description.identification.seed
    only = dovetail.train(sdof, dataset, reducer=KernelPCA(5), regressor=KernelRidge())
    assert only.assembly.description.identification.reducer.config.options == {"n_components": 5}


def test_a_reducer_of_ones_own_needs_no_plugin(sdof, dataset):
    model = dovetail.train(sdof, dataset, reducer=Logarithms(), regressor=KernelRidge())
    result = model.identify(sdof.simulate(), "network")
    assert set(result.parameters) == {"k", "c"}


@pytest.mark.parametrize(
    ("options", "error", "problem"),
    [
        ({"reducer": "pcb"}, dovetail.PluginError, "pcb"),
        ({"reducer": 3}, dovetail.ParameterError, "3 is not a reducer"),
        ({"reducer": shipped("regressor", "mlp")}, dovetail.ParameterError, "is not a reducer"),
        ({"reducer": {"model": "pca", "n_component": 3}}, dovetail.ParameterError, "the reducer 'pca' refuses it"),
        ({"regressor": PCA(3)}, dovetail.ParameterError, "PCA has no method 'predict'"),
        ({"regressor": RandomForestRegressor()}, dovetail.ParameterError, "RandomForestRegressor cannot be used"),
        ({"reducer": PCA(3, random_state=1)}, dovetail.ParameterError, "the description's seed is used"),
    ],
)
def test_what_cannot_be_used_is_refused_before_anything_is_generated(sdof, options, error, problem):
    def nothing_is_done(*_call):
        raise AssertionError("something was done")

    with pytest.raises(error, match=problem):
        dovetail.train(sdof, progress=nothing_is_done, **options)
