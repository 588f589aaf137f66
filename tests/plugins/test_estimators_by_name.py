"""scikit-learn's estimators by name: same results as scikit-learn's own, also after storing, without side effects."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sklearn
from pydantic import ValidationError
from sklearn.utils import all_estimators

import dovetail
from dovetail_plugins import scikit_learn
from dovetail_plugins.reducers.scikit_learn import Transformer
from dovetail_plugins.regressors.scikit_learn import ScikitLearnRegressor

DOCS = Path(__file__).resolve().parents[2] / "docs"
FEATURES = np.random.default_rng(0).standard_normal((60, 8)).astype(np.float32) + 3.0
TARGETS = np.stack([FEATURES[:, 0] - FEATURES[:, 1], FEATURES[:, 2] ** 2], axis=1).astype(np.float64)


def reducer(estimator, **options):
    return Transformer(Transformer.Config(estimator=estimator, options=options))


def regressor(estimator, **options):
    return ScikitLearnRegressor(ScikitLearnRegressor.Config(estimator=estimator, options=options))


def stored(state):
    """A state as a model's folder keeps it: arrays, and what JSON holds."""
    plain = {name: value for name, value in state.items() if not isinstance(value, np.ndarray)}
    return {**{name: value for name, value in state.items() if name not in plain}, **json.loads(json.dumps(plain))}


def test_the_estimators_are_those_that_scikit_learn_lists():
    assert scikit_learn._exported() == {
        name: entry for name, entry in all_estimators() if name not in scikit_learn._TRUSTING
    }


def test_no_other_library_is_imported_for_an_estimator():
    code = "import sys; from dovetail_plugins.scikit_learn import _exported; _exported(); print('torch' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("StandardScaler", {}),
        ("RobustScaler", {"quantile_range": [10.0, 90.0]}),
        ("PCA", {"n_components": 3, "whiten": True}),
        ("IncrementalPCA", {"n_components": 4}),
        ("FactorAnalysis", {"n_components": 2}),
        ("GaussianRandomProjection", {"n_components": 5}),
        ("Nystroem", {"n_components": 7, "gamma": 0.05}),
        ("PolynomialFeatures", {"degree": 2, "include_bias": False}),
        ("QuantileTransformer", {"n_quantiles": 20}),
    ],
)
def test_a_transformer_is_its_own_before_and_after_it_is_stored(name, options):
    fitted = reducer(name, **options).fit(FEATURES, seed=5)
    given = {key: tuple(value) if isinstance(value, list) else value for key, value in options.items()}
    model = dict(all_estimators())[name]
    seeded = {"random_state": 5} if "random_state" in model().get_params() else {}
    own = model(**given, **seeded).fit(FEATURES.astype(float)).transform(FEATURES[:7].astype(float))
    own = own.toarray() if hasattr(own, "toarray") else own
    answer = fitted.transform(FEATURES[:7])
    np.testing.assert_allclose(answer, own, rtol=1e-5, atol=1e-6)
    assert answer.dtype == np.float32
    again = reducer(name, **options).restore(stored(fitted.state()))
    np.testing.assert_array_equal(again.transform(FEATURES), fitted.transform(FEATURES))


def test_a_sparse_result_is_converted_to_a_dense_one():
    features = np.tile([[0.0, 2.0], [1.0, 2.0], [1.0, 5.0]], (4, 1)).astype(np.float32)
    fitted = reducer("OneHotEncoder").fit(features, seed=0)
    expected = [[1, 0, 1, 0], [0, 1, 1, 0], [0, 1, 0, 1]]
    np.testing.assert_array_equal(fitted.transform(features[:3]), expected)


def test_an_estimator_that_differs_after_restoring_is_refused(monkeypatch):
    """By a hundredth, where a ten-thousandth is allowed; the estimator was tried by itself before."""
    decode, made_before = scikit_learn._decode, regressor("Ridge")

    def changed(node, arrays):
        made = decode(node, arrays)
        if hasattr(made, "intercept_"):
            made.intercept_ = made.intercept_ + 1e-2
        return made

    monkeypatch.setattr(scikit_learn, "_decode", changed)
    with pytest.raises(dovetail.DovetailError, match="made of its arrays it answers otherwise"):
        made_before.fit(FEATURES, TARGETS, seed=0)


def test_a_regressor_of_a_single_target_is_fitted_to_each():
    reported = []
    fitted = regressor("SVR", C=50.0).fit(FEATURES, TARGETS, seed=0, progress=lambda *call: reported.append(call))
    answer = fitted.predict(FEATURES)
    for column in range(2):
        own = sklearn.svm.SVR(C=50.0).fit(FEATURES.astype(float), TARGETS[:, column])
        np.testing.assert_allclose(answer[:, column], own.predict(FEATURES.astype(float)), rtol=1e-9)
    again = regressor("SVR", C=50.0).restore(stored(fitted.state()))
    np.testing.assert_array_equal(again.predict(FEATURES), answer)
    assert reported == [("regressor", 1, 1, "SVR")]
    assert fitted.predict(FEATURES[:1]).shape == (1, 2)


def test_the_seed_is_that_of_the_description():
    first, same, other = (
        reducer("GaussianRandomProjection", n_components=3).fit(FEATURES, seed=seed).transform(FEATURES)
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, same)
    assert not np.allclose(first, other)


def test_the_callers_random_numbers_go_on_as_if_nothing_had_been_fitted():
    np.random.seed(3)  # noqa: NPY002
    expected = np.random.random(4)  # noqa: NPY002
    np.random.seed(3)  # noqa: NPY002
    regressor("MLPRegressor", hidden_layer_sizes=[4], max_iter=3).fit(FEATURES, TARGETS, seed=0)
    np.testing.assert_array_equal(np.random.random(4), expected)  # noqa: NPY002


def test_a_state_returns_copies():
    fitted = reducer("PCA", n_components=2).fit(FEATURES, seed=0)
    before = fitted.transform(FEATURES)
    for value in fitted.state().values():
        if isinstance(value, np.ndarray):
            value[...] = 0
    np.testing.assert_array_equal(fitted.transform(FEATURES), before)


@pytest.mark.parametrize("rows", [FEATURES[:, :7], FEATURES[0], np.full((1, 8), np.nan)])
def test_rows_of_another_kind_are_refused(rows):
    fitted = reducer("StandardScaler").fit(FEATURES, seed=0)
    with pytest.raises(dovetail.DovetailError, match=r"reducer 'sklearn' \(StandardScaler\)"):
        fitted.transform(rows)


def test_sparse_matrices_within_a_transformer_are_refused_before_any_work():
    with pytest.raises(ValidationError, match=r"arrays alone \(SparseRandomProjection\.components_: "):
        reducer("SparseRandomProjection", n_components=5)


def test_one_that_the_trial_cannot_fit_is_not_refused():
    assert reducer("PCA", n_components=200).config.options == {"n_components": 200}


@pytest.mark.parametrize(("method", "heading"), [("transform", "Transformers"), ("predict", "Regressors")])
def test_the_page_lists_estimators_that_work_with_the_installed_version(method, heading):
    made = runpy.run_path(str(DOCS / "make_estimators.py"))
    section = (DOCS / "estimators.md").read_text(encoding="utf-8").partition(f"## {heading}")[2].partition("## ")[0]
    listed, working = made["names_in"](section), scikit_learn.working_estimators(method)
    installed = [name for name in listed if name in scikit_learn._exported()]  # a version may lack one
    assert len(installed) > 30
    assert set(installed) <= set(working)


def test_a_state_without_its_arrays_is_refused():
    fitted = regressor("Ridge").fit(FEATURES, TARGETS, seed=0)
    state = dict(fitted.state())
    assert state
    for missing in state:
        with pytest.raises(dovetail.DovetailError, match=r"regressor 'sklearn' \(Ridge\)"):
            regressor("Ridge").restore({key: value for key, value in state.items() if key != missing})
