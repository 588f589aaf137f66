"""Transformers and regressors of scikit-learn by their names: safe, and refused clearly where they are not."""

from __future__ import annotations

import json
import multiprocessing
import os
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from sklearn.cross_decomposition import PLSRegression
from sklearn.decomposition import KernelPCA

import dovetail
from dovetail.testing.training_sets import frf_samples
from dovetail_plugins.reducers.scikit_learn import Transformer
from dovetail_plugins.regressors.scikit_learn import ScikitLearnRegressor


def reducer(estimator, **options):
    return Transformer(Transformer.Config(estimator=estimator, options=options))


def regressor(estimator, **options):
    return ScikitLearnRegressor(ScikitLearnRegressor.Config(estimator=estimator, options=options))


@pytest.fixture(scope="module")
def features():
    return frf_samples(160, lines=120, seed=7).features


@pytest.fixture(scope="module")
def targets():
    return frf_samples(160, lines=120, seed=7).targets


def test_a_reducer_is_scikit_learn_s_own(features):
    options = {"n_components": 6, "kernel": "rbf", "gamma": 0.02}
    own = KernelPCA(**options, random_state=1).fit(features.astype(float))
    fitted = reducer("KernelPCA", **options).fit(features, seed=1)
    np.testing.assert_allclose(fitted.transform(features[:9]), own.transform(features[:9].astype(float)), atol=1e-6)


def test_a_regressor_is_scikit_learn_s_own(features, targets):
    own = PLSRegression(n_components=5).fit(features.astype(float), targets)
    fitted = regressor("PLSRegression", n_components=5).fit(features, targets, seed=0)
    np.testing.assert_allclose(fitted.predict(features[:9]), own.predict(features[:9].astype(float)), atol=1e-9)


@pytest.mark.parametrize("name", ["KernelRidge", "SVR", "BayesianRidge", "MLPRegressor", "Ridge"])
def test_regressors_of_one_or_several_targets_are_fitted_and_restored(features, targets, name):
    fitted = regressor(name).fit(features, targets, seed=0)
    assert fitted.predict(features[:4]).shape == (4, 2)
    again = regressor(name).restore(fitted.state())
    np.testing.assert_array_equal(again.predict(features[:4]), fitted.predict(features[:4]))


@pytest.mark.parametrize(
    ("make", "options", "said"),
    [
        (reducer, {"estimator": "KernelPcA"}, r"scikit-learn has no 'KernelPcA' \(did you mean 'KernelPCA'\?\)"),
        (reducer, {"estimator": "TSNE"}, "scikit-learn's TSNE has no method 'transform' for new FRFs"),
        (regressor, {"estimator": "LogisticRegression"}, "scikit-learn's LogisticRegression is not a regressor"),
        (reducer, {"estimator": "os.system"}, "scikit-learn has no 'os.system'"),
        (reducer, {"estimator": "sklearn.decomposition.PCA"}, "scikit-learn has no 'sklearn.decomposition.PCA'"),
        (
            reducer,
            {"estimator": "KernelPCA", "n_component": 3},
            r"'n_component' is not an option of KernelPCA \(did you",
        ),
        (
            reducer,
            {"estimator": "KernelPCA", "n_components": "many"},
            "The 'n_components' parameter of KernelPCA must be",
        ),
        (reducer, {"estimator": "PCA", "random_state": 3}, "'random_state' cannot be chosen: the description's seed"),
        (reducer, {"estimator": "FeatureAgglomeration", "memory": "x"}, "'memory' cannot be chosen: nothing is kept"),
        (regressor, {"estimator": "VotingRegressor"}, "VotingRegressor cannot be made of plain values"),
        (reducer, {"estimator": "PCA", "tol": {"a": 1}}, "options.tol"),
    ],
)
def test_wrong_options_in_a_description_are_refused(make, options, said):
    with pytest.raises(ValidationError, match=said):
        make(**options)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("RandomForestRegressor", r"not made of arrays alone \(RandomForestRegressor\.estimators_\[0\]\.tree_: Tree, "),
        ("GaussianProcessRegressor", r"GaussianProcessRegressor\.kernel_: .*no model could be stored without pickle"),
    ],
)
def test_estimators_with_other_state_than_arrays_are_refused_before_any_work(name, said):
    with pytest.raises(ValidationError, match=said):
        regressor(name)


def test_an_estimator_that_fails_to_fit_is_an_error_with_its_reason(features):
    with pytest.raises(dovetail.DovetailError, match=r"\(SelectKBest\)\n  it cannot be fitted: estimator requires y"):
        reducer("SelectKBest").fit(features, seed=0)


@pytest.mark.parametrize(
    "structure",
    [
        {"estimator": "os.system", "with": {}},
        {"estimator": "Pipeline2", "with": {}},
        {"array": "gone"},
        {"code": "x"},
        {"dtype": "object_"},
        "no",
    ],
)
def test_a_manipulated_state_creates_no_other_class(features, structure):
    state = {"structure": json.dumps(structure), "width": 120}
    with pytest.raises(dovetail.DovetailError):
        reducer("PCA").restore(state).transform(features)


def test_a_description_with_both_is_trained_stored_and_loaded(assemblies, tmp_path):
    description = tmp_path / "small.yaml"
    description.write_text(
        f"extends: {assemblies / 'sdof.yaml'}\n"
        "identification:\n"
        "  samples: 300\n"
        "  reducer: {model: sklearn, estimator: KernelPCA, options: {n_components: 12, kernel: rbf, gamma: 0.001}}\n"
        "  regressor: {model: sklearn, estimator: KernelRidge, options: {kernel: rbf, alpha: 1e-3}}\n"
    )
    assembly = dovetail.load(description)
    model = dovetail.train(assembly)
    assert model.evaluation.parameters["k"].r2 > 0.9
    model.save(tmp_path / "model")
    amplitude = np.abs(assembly.frf([[3e6, 40.0], [5e6, 60.0]])).astype(np.float32)
    again = dovetail.load_model(tmp_path / "model").predict_parameters(amplitude)
    np.testing.assert_allclose(again, model.predict_parameters(amplitude), rtol=1e-9)


def test_a_misspelt_option_is_reported_with_its_position(assemblies, tmp_path):
    description = tmp_path / "small.yaml"
    description.write_text(
        f"extends: {assemblies / 'sdof.yaml'}\n"
        "identification:\n"
        "  reducer: {model: sklearn, estimator: KernelPCA, options: {n_component: 12}}\n"
    )
    with pytest.raises(dovetail.DovetailError, match=r"small\.yaml:3:\d+  identification\.reducer\n  'n_comp"):
        dovetail.load(description)


def changed(state, name, make):
    """A state in which an array of the first estimator within has been replaced, or a plain value."""
    tree = json.loads(state["structure"])
    inside = tree["with"]["estimators_"]["list"][0]["with"]
    if isinstance(inside.get(name), dict) and "array" in inside[name]:
        return state | {inside[name]["array"]: make(state[inside[name]["array"]])}
    inside[name] = make(inside.get(name))
    return state | {"structure": json.dumps(tree)}


LIBSVM = {
    "fewer vectors": ("support_vectors_", lambda vectors: vectors[:1].copy()),
    "fewer columns": ("support_vectors_", lambda vectors: vectors[:, :3].copy()),
    "fewer weights": ("_dual_coef_", lambda weights: weights[:, :1].copy()),
    "a far index": ("support_", lambda indices: indices + 10**9),
    "more classes": ("_n_support", lambda _: np.full(1000, 10**9, dtype=np.int32)),
    "another kind of machine": ("_impl", lambda _: "c_svc"),
    "sparse vectors": ("_sparse", lambda _: True),
    "single precision": ("support_vectors_", lambda vectors: vectors.astype(np.float32)),
}


@pytest.mark.parametrize("change", LIBSVM)
@pytest.mark.parametrize("name", ["SVR", "NuSVR"])
def test_a_state_on_which_libsvm_would_crash_is_refused_unused(features, targets, name, change):
    state = regressor(name).fit(features, targets, seed=0).state()
    regressor(name).restore(state)
    with pytest.raises(dovetail.DovetailError, match=f"not those of a fitted {name}"):
        regressor(name).restore(changed(state, *LIBSVM[change]))


@pytest.mark.parametrize("name", ["SVC", "OneClassSVM", "KMeans", "KNeighborsRegressor"])
def test_estimators_whose_native_code_trusts_their_state_are_refused_by_name(features, name):
    with pytest.raises(ValidationError, match=f"{name} is refused: its native code trusts a stored model"):
        reducer(name) if name == "KMeans" else regressor(name)
    structure = json.dumps({"estimator": name, "with": {}})
    with pytest.raises(dovetail.DovetailError, match="its state cannot be read"):
        reducer("PCA").restore({"structure": structure, "width": 120})


def test_no_process_is_started_for_jobs(features, targets, tmp_path, monkeypatch):
    """A process of joblib's would import what lies in the current folder."""
    (tmp_path / "secrets.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
    monkeypatch.chdir(tmp_path)
    state = regressor("SVR").fit(features, targets, seed=0).state()
    tree = json.loads(state["structure"])
    tree["with"]["n_jobs"] = 2
    before = {child.name for child in multiprocessing.active_children()}
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children")
    known = children.read_text() if children.exists() else ""
    regressor("SVR").restore(state | {"structure": json.dumps(tree)}).predict(features[:3])
    regressor("LinearRegression", n_jobs=2).fit(features, targets, seed=0).predict(features[:3])
    assert (children.read_text() if children.exists() else "") == known
    assert {child.name for child in multiprocessing.active_children()} == before
    assert not (tmp_path / "ran").exists()
