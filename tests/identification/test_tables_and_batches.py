"""The one table of parameters, and results as other objects: batches, data frames, inference data, pickles, files."""

from __future__ import annotations

import builtins
import json
import pickle
import sys
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest

import dovetail
from dovetail.identification.parameters import is_in_range

TRUTH = np.array([4e6, 60.0])


def measured(assembly: dovetail.Assembly, theta: np.ndarray, label: str, seed: int = 0) -> dovetail.Frf:
    values = assembly.frf(theta)
    random = np.random.default_rng(seed)
    noise = 0.01 * (random.standard_normal(values.shape) + 1j * random.standard_normal(values.shape))
    return dovetail.Frf(assembly.frequency, values * (1 + noise), "accelerance", label=label)


@pytest.fixture(scope="module")
def result(sdof) -> dovetail.Identification:
    return dovetail.identify(sdof, measured(sdof, TRUTH, "first.csv"), samples=100)


def test_the_default_method_has_intervals(result):
    assert result.method == "posterior"
    for row, truth in zip(result.table, TRUTH, strict=True):
        assert row.interval_low < truth < row.interval_high
        assert row.interval_high - row.interval_low < 0.2 * truth  # damping is allowed to be 5 % off
        assert row.verdict == "identified"


def test_the_table_holds_estimate_interval_and_best_fit(result):
    posterior = result.posterior
    assert len(result.table) == len(TRUTH)
    for column, (name, row) in enumerate(zip(result.parameters, result.table, strict=True)):
        assert row.estimate == posterior.estimate[column] != result.theta[column] == row.best_fit
        assert (row.interval_low, row.interval_high) == posterior.interval()[name]
        assert (row.verdict, row.why) == (posterior.verdicts[name].word, posterior.verdicts[name].reason)
        assert row.network is None


def test_without_a_posterior_the_estimate_is_the_fit(sdof):
    result = dovetail.identify(sdof, measured(sdof, TRUTH, "first.csv"), "refined")
    assert len(result.table) == len(TRUTH)
    for row, value in zip(result.table, result.theta.tolist(), strict=True):
        assert (row.estimate, row.best_fit, row.interval_low, row.verdict) == (value, None, None, "")


def test_the_table_has_no_intervals_of_an_untrustworthy_result(result):
    untrusted = replace(result, adequacy=dovetail.Adequacy("does not fit"))
    assert len(untrusted.table) == len(TRUTH)
    for row in untrusted.table:
        assert (row.interval_low, row.interval_high, row.is_trustworthy) == (None, None, False)
        assert row.verdict == "not trustworthy"
        assert row.why == untrusted.warning


@pytest.mark.parametrize(
    ("value", "scale", "expected"),
    [
        (2.0, "linear", True),
        (np.nextafter(2.0, 3.0), "linear", True),
        (2.0 + 1e-6, "linear", False),
        (np.nextafter(1.0, 0.0), "log", True),
        (0.999, "log", False),
        (-1.0, "log", False),
        (np.nan, "linear", False),
    ],
)
def test_a_rounded_value_at_the_end_of_its_range_is_in_range(value, scale, expected):
    assert is_in_range(value, 1.0, 2.0, scale) is expected


@pytest.mark.parametrize("mapping", ["parameters", "known", "provenance"])
def test_the_mappings_of_a_result_are_read_only(result, mapping):
    with pytest.raises(TypeError, match="does not support item assignment"):
        getattr(result, mapping)["k"] = None


def test_a_result_is_read_again_and_pickled(result, tmp_path):
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    for again in (dovetail.load_result(tmp_path), pickle.loads(pickle.dumps(result))):
        for row, original in zip(again.table, result.table, strict=True):
            for name, value in asdict(original).items():
                same = pytest.approx(value, rel=1e-12) if isinstance(value, float) else value
                assert getattr(row, name) == same
        np.testing.assert_array_equal(again.posterior.log_likelihood, result.posterior.log_likelihood)
        with pytest.raises(TypeError):
            again.parameters["k"] = None


def test_the_log_likelihood_is_that_of_the_measurement(sdof):
    """With an exact model and a known variance it is the sum of squares, by hand."""
    frf = measured(sdof, TRUTH, "first.csv")
    variance = 2 * (0.01 * np.abs(sdof.frf(TRUTH))) ** 2
    result = dovetail.identify(sdof, replace(frf, variance=variance), samples=20, model_error=0.0)
    squares = np.abs(frf.values - sdof.frf(result.posterior.theta)) ** 2 / variance
    expected = -squares.sum(axis=1)
    differences = result.posterior.log_likelihood - result.posterior.log_likelihood[0]
    np.testing.assert_allclose(differences, expected - expected[0], atol=0.02 * np.ptp(expected) + 1e-6)


def test_samples_of_equal_weight_are_drawn_in_proportion_to_the_weights(result):
    weight = np.arange(1.0, 1 + len(result.posterior.weight))
    posterior = replace(result.posterior, weight=weight / weight.sum())
    drawn = posterior.sample(4000, seed=3)
    counts = [(drawn == theta).all(axis=1).sum() for theta in posterior.theta]
    assert np.abs(counts - 4000 * posterior.weight).max() <= 1.0
    assert not np.array_equal(drawn, drawn[np.argsort(drawn[:, 0])])


def test_a_data_frame_has_the_rows_of_the_table(result):
    frame = result.to_dataframe()
    assert list(frame.index) == ["k", "c"]
    assert frame.loc["k", "estimate"] == result.table[0].estimate
    assert list(frame.columns) == [name for name in asdict(result.table[0]) if name != "name"]


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_inference_data_hold_samples_priors_and_units(result, sdof):
    data = result.to_inferencedata(draws=500, seed=1)
    assert data.posterior["k"].shape == data.prior["c"].shape == data.log_likelihood["frf"].shape == (1, 500)
    assert data.posterior["k"].attrs["units"] == "N/m"
    mean, deviation = float(data.posterior["k"].mean()), float(data.posterior["k"].std())
    assert abs(mean - result.table[0].estimate) < 0.2 * deviation
    prior = data.prior["k"].to_numpy().ravel()
    bounds = sdof.parameters[0].lower, sdof.parameters[0].upper
    assert bounds[0] <= prior.min() < prior.max() <= bounds[1]
    assert abs(prior.mean() - np.mean(bounds)) < 0.1 * np.ptp(bounds)


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_inference_data_has_what_the_model_predicts_and_what_was_measured(result, sdof):
    data = result.to_inferencedata(draws=400, seed=2)
    observed, predicted = data.observed_data["frf"], data.posterior_predictive["frf"]
    assert observed.dims == ("frequency", "part")
    assert predicted.dims == ("chain", "draw", "frequency", "part")
    assert observed.attrs["units"] == predicted.attrs["units"] == result.measured.unit
    np.testing.assert_array_equal(observed.sel(part="imag"), result.measured.values.imag)
    np.testing.assert_array_equal(observed["frequency"], result.measured.frequency)
    low, high = np.quantile(predicted.to_numpy()[0], [0.05, 0.95], axis=0)
    inside = np.mean((low <= observed.to_numpy()) & (observed.to_numpy() <= high))
    assert 0.85 <= inside <= 0.97
    assert data.sample_stats["lp"].shape == data.sample_stats["weight"].shape == (1, 400)
    other = result.to_inferencedata(draws=400, seed=2, assembly=sdof)
    np.testing.assert_array_equal(other.posterior_predictive["frf"], predicted)


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_without_a_description_there_are_no_predicted_values_and_the_reason_is_given(result):
    bare = replace(result, provenance={**result.provenance, "description": ""})
    data = bare.to_inferencedata(draws=20)
    assert "posterior_predictive" not in data.groups()
    assert data.attrs["no_posterior_predictive"]
    assert "observed_data" in data.groups()


@pytest.mark.filterwarnings("ignore::FutureWarning")
def test_inference_data_holds_its_provenance(result):
    data = result.to_inferencedata(draws=10)
    assert (data.attrs["warning"], data.attrs["measurement"]) == (result.warning, result.measured.label)


@pytest.mark.parametrize("version", ["0.x", "1.x"])
def test_every_version_of_arviz_gets_the_same_groups(result, monkeypatch, version):
    """With stand-ins that have the arguments of each version."""
    arrays = SimpleNamespace(attrs={})
    made = {}

    def from_dict(data=None, *, attrs, coords, dims, **groups):
        assert dims["frf"] == ["frequency", "part"]
        assert len(coords["frequency"]) == len(result.measured.frequency)
        assert (data is None) == (version == "0.x")
        made.update(groups or data)
        made["attrs"] = attrs if version == "0.x" else attrs["/"]
        return {name: dict.fromkeys(group, arrays) for name, group in (groups or data).items()}

    stand_in = SimpleNamespace(from_dict=from_dict, __version__=version.replace("x", "20"))
    monkeypatch.setitem(sys.modules, "arviz", stand_in)
    result.to_inferencedata(draws=30)
    samples = {"posterior", "prior", "posterior_predictive", "log_likelihood", "sample_stats"}
    assert set(made) == {*samples, "observed_data", "attrs"}
    assert made["posterior"]["k"].shape == made["prior"]["c"].shape == (1, 30)
    assert made["attrs"]["measurement"] == result.measured.label


def test_without_a_posterior_there_is_no_inference_data(sdof):
    fitted = dovetail.identify(sdof, measured(sdof, TRUTH, "first.csv"), "refined")
    with pytest.raises(dovetail.DovetailError, match="the method 'refined' gives no posterior"):
        fitted.to_inferencedata()


@pytest.mark.parametrize("library", ["pandas", "arviz"])
def test_a_library_that_is_not_installed_is_named(result, monkeypatch, library):
    ordinary = builtins.__import__

    def without(name, *arguments, **options):
        if name == library:
            raise ImportError(name)
        return ordinary(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(dovetail.DovetailError, match=rf'pip install "dovetail-frf\[{library}\]"'):
        result.to_dataframe() if library == "pandas" else result.to_inferencedata()


def test_no_measurement_of_a_batch_is_lost_because_of_its_name(sdof):
    frfs = [measured(sdof, sdof.from_unit(np.full(2, 0.5)), label, 1) for label in ("a (2)", "a", "a", "b")]
    batch = dovetail.identify_many(sdof, frfs, "refined", processes=1)
    assert list(batch.results) == ["a (2)", "a", "a (3)", "b"]


def test_a_batch_is_what_each_measurement_gives_alone(sdof, tmp_path):
    thetas = sdof.from_unit(np.random.default_rng(5).random((3, 2)))
    frfs = [measured(sdof, theta, "same.csv", seed) for seed, theta in enumerate(thetas)]
    dovetail.write_frf(frfs[2], tmp_path / "third.csv")
    reported = []
    batch = dovetail.identify_many(
        sdof,
        [frfs[0], frfs[1], tmp_path / "third.csv", tmp_path / "gone.csv", replace(frfs[0], values=0 * frfs[0].values)],
        processes=2,
        progress=lambda *stage: reported.append(stage),
        samples=60,
    )
    assert list(batch.results) == ["same.csv", "same.csv (2)", "third.csv"]
    assert list(batch.failures) == ["gone.csv", "same.csv (3)"]
    assert "there is no such file" in batch.failures["gone.csv"]
    assert "exactly zero" in batch.failures["same.csv (3)"]
    assert reported[-1] == ("identifying", 5, 5)
    for name, frf in zip(batch.results, frfs, strict=True):
        alone = dovetail.identify(sdof, frf, samples=60)
        estimates = [[row.estimate for row in found.table] for found in (batch.results[name], alone)]
        np.testing.assert_allclose(*estimates, rtol=1e-9)
    frame = batch.to_dataframe()
    assert list(frame.index) == [(name, parameter) for name in batch.results for parameter in ("k", "c")]
    assert batch.is_trustworthy
    assert repr(batch) == "<Batch: 3 identifications, 2 failures>"
    assert list(pickle.loads(pickle.dumps(batch)).results) == list(batch.results)


def test_an_empty_batch_has_no_results(sdof):
    batch = dovetail.identify_many(sdof, [])
    assert (dict(batch.results), dict(batch.failures), batch.table, batch.is_trustworthy) == ({}, {}, [], True)
    assert batch.to_dataframe().empty
