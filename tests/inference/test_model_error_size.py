"""The size of the model error is estimated from the measurement: for structures that are wrong by a known amount."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import dovetail
from dovetail.errors import ParameterError
from dovetail.frf.resonance_peaks import resonance_peaks
from dovetail.inference.adequacy.error_effects import ErrorEffects
from dovetail.inference.adequacy.model_error_size import (
    _improbability,
    _Linearised,
    _most_plausible,
    estimate_model_error,
)
from dovetail.inference.adequacy.perturbations import list_perturbations
from dovetail.inference.adequacy.verdict import word_for
from dovetail.inference.fitting import fit_at, refine
from dovetail.inference.posterior import ModelError
from dovetail.inference.posterior.frequency_average import unshaped_deviation
from dovetail.inference.posterior.model_error import fit_resonances
from dovetail.problem import Problem
from dovetail.problem.observations import Observations
from dovetail_bench.evaluation.mesh_refinement import finer
from support.fewer_lines import every
from support.noisy_measurements import frf_on, noisy

TRUTH = np.array([2e6, 20.0, 1e6, 10.0])
METHODS = ("refined", "multistart", "posterior")
NO_CAUSES = {"cause_seconds": 0.0}
"""What would explain a misfit takes most of the time, and is tested in test_causes.py."""


def load_chain(*masses):
    """Five masses in a row on springs, of which two are identified."""
    names = ["base", *(f"mass{index}" for index in range(len(masses)))]
    lumped = {
        name: {"model": "lumped", "masses": [{"mass": mass}]} for name, mass in zip(names[1:], masses, strict=True)
    }
    joints = {}
    for index, (below, above) in enumerate(pairwise(names)):
        identified = {"k": {"range": [1e5, 1e7]}, "c": {"range": [1, 100]}}
        joints[f"spring{index}"] = {
            "model": "spring_damper",
            "direction": "x",
            "connect": {"a": {"to": above, "at": 0}, "b": {"to": below, "at": 0}},
            "parameters": identified if index in (0, 2) else {"k": {"value": 1.5e6}, "c": {"value": 15.0}},
        }
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "chain",
            "frequency": {"start": "20 Hz", "stop": "500 Hz", "lines": 600},
            "substructures": {**lumped, "base": {"model": "ground"}},
            "joints": joints,
            "responses": [{"at": names[-1], "position": 0}],
            "identification": {"samples": 100},
        }
    )


@pytest.fixture(scope="module")
def chain():
    return load_chain(*["1 kg"] * 5)


@pytest.fixture(scope="module")
def off(chain):
    """The FRF of a chain whose fourth mass is 2 % heavier."""
    return noisy(chain, load_chain("1 kg", "1 kg", "1 kg", "1.02 kg", "1 kg").frf(TRUTH), 0.005, 3)


def error_left(model, theta, true, truth):
    """The relative difference (rms) of natural frequencies within the band."""
    low, high = model.frequency[[0, -1]]
    expected = true.natural_frequencies(truth, 10)
    within = (expected > low) & (expected < high)
    return float(np.sqrt(np.mean((model.natural_frequencies(theta, 10)[within] / expected[within] - 1.0) ** 2)))


def check_size(reported, left):
    """Hold a size against what the fit leaves: not less than half of it.

    It may be up to four times as large: three to five resonances, each with an error of its own, do not determine it
    better, and what parameters can follow is no longer seen in their natural frequencies.
    """
    assert 0.5 * left < reported < 4.0 * left


@pytest.mark.parametrize("index", [pytest.param(2, marks=pytest.mark.slow), 3])
def test_the_size_of_a_mass_two_per_cent_off_is_estimated(chain, index):
    true = load_chain(*("1.02 kg" if at == index else "1 kg" for at in range(5)))
    result = dovetail.identify(chain, noisy(chain, true.frf(TRUTH), 0.005, 3), "refined", **NO_CAUSES)
    assert result.adequacy.word == "good"
    check_size(result.adequacy.size.natural_frequency, error_left(chain, result.theta, true, TRUTH))
    assert error_left(chain, result.theta, true, TRUTH) < 0.01


@pytest.mark.parametrize("modulus", [0.01, *(pytest.param(size, marks=pytest.mark.slow) for size in (0.03, 0.1))])
def test_the_size_of_a_wrong_modulus_is_estimated(collet, torque_100, modulus):
    """Of the holder. The joint follows an error of 1 % to 0.1 % of noise, and most of a larger one."""
    model = collet.on(np.arange(100.0, 9001.0, 8.0))
    true = {entry.name: entry for entry in list_perturbations(model)}["holder: material.young"].apply(np.log1p(modulus))
    true = true.on(model.frequency)
    measured = noisy(model, true.frf(torque_100), 0.001, 3)
    result = dovetail.identify(collet, measured, "refined", **NO_CAUSES)
    left = error_left(model, result.theta, true, torque_100)
    if modulus == 0.01:
        assert result.adequacy.word == "to the noise"
        assert left < 3e-4
    else:
        assert result.adequacy.word == "good"
        check_size(result.adequacy.size.natural_frequency, left)


def size_of_moved_resonance(chain, theta, number, ratio, damping=1.0):
    """Return the size that is reported if one resonance is elsewhere, how far it is, and the measured peaks."""
    values, axis = chain.frf(theta), chain.frequency
    resonances = fit_resonances([frf_on(axis, "accelerance")], [values])
    pole, near = resonances.poles[number], resonances.near[0][number]
    other = ratio * complex(pole.real, damping * pole.imag)
    moved = values + near * (axis - pole) / (axis - other) - near
    measured = noisy(chain, moved, 1e-3, 1)
    target = Observations.of(chain.description, measured)
    fit = fit_at(Problem(chain, target), chain.to_unit(theta))
    reported = estimate_model_error(ErrorEffects(Problem(chain, target), fit)).size
    return reported, abs(ratio - 1.0) / np.sqrt(len(resonances.poles)), resonance_peaks(measured)


def test_a_damped_resonance_that_makes_no_peak_may_be_farther_away_than_all_peaks(chain):
    """The four peaks are where they should be, the fifth resonance is 2 % away: 0.9 % over all."""
    reported, left, peaks = size_of_moved_resonance(chain, np.array([2e6, 90.0, 1e6, 90.0]), 4, 0.98)
    assert len(peaks) == 4
    assert 0.5 * left < reported.natural_frequency < 4.0 * left


def test_the_error_of_natural_frequencies_is_at_least_the_distance_of_peaks(chain):
    """One of five by 6 %: averages wide enough for it explained the residuals with half as much."""
    reported, left, peaks = size_of_moved_resonance(chain, np.array([2e6, 30.0, 1e6, 30.0]), 3, 0.94)
    assert len(peaks) == 5
    assert 0.9 * left < reported.natural_frequency < 1.5 * left


def test_an_error_of_damping_only_is_not_reported_for_natural_frequencies(chain):
    """Of one resonance in five, by 30 %: 13 % over all."""
    reported, *_ = size_of_moved_resonance(chain, TRUTH, 1, 1.0, damping=1.3)
    assert reported.natural_frequency < 1e-4
    assert 0.5 * 0.13 < reported.damping < 4.0 * 0.13


@pytest.mark.parametrize("torque", [20, pytest.param(60, marks=pytest.mark.slow)])
def test_intervals_allow_for_a_mesh_that_is_too_coarse(collet, assemblies, torque):
    """Two resonances do not determine its size, which is unknown then; intervals allow for twice a size like it."""
    folder, name = assemblies / "campaign" / "measurements", f"h0_j{torque}_t0"
    frf = every(3, dovetail.read_frf(folder / f"{name}.uff", accelerometer_mass=1.2e-3))
    truth = json.loads((folder / "truth.json").read_text())["tests"][name]["parameters"]
    adequacy = dovetail.identify(collet, frf, "refined", **NO_CAUSES).adequacy
    mesh = error_left(collet, truth, finer(collet, 4), truth)
    assert np.isnan(adequacy.size.natural_frequency)
    assert mesh / 3.0 < adequacy.in_intervals.natural_frequency / 2.0 < 3.0 * mesh


def test_the_prior_of_sizes_has_the_right_derivatives():
    """Against central differences, where typical sizes grow and where they have reached their limit."""
    step = 1e-6
    for frequency in (2e-5, 0.003, 0.03):
        point = np.log([frequency, 0.3, 0.02, 0.004])
        values = [
            _improbability(ModelError(*np.exp(point + sign * step * unit)))[0] for unit in np.eye(4) for sign in (1, -1)
        ]
        slopes = -np.diff(np.reshape(values, (4, 2)))[:, 0] / (2.0 * step)
        assert np.allclose(_improbability(ModelError(*np.exp(point)))[1], slopes, rtol=1e-5, atol=1e-6)


def test_other_errors_are_as_large_in_an_antiresonance_that_the_model_has_too_deep(chain):
    exact = chain.frf(TRUTH)
    deep, target = exact.copy(), Observations.of(chain.description, dovetail.Frf(chain.frequency, exact, "accelerance"))
    deep[np.argmin(np.abs(deep))] *= 0.01
    assert np.allclose(unshaped_deviation(target, deep, ModelError(1e-4, other=0.1)), 0.1 * np.abs(exact))


def test_the_damping_error_is_estimated_from_heights_of_misplaced_peaks(chain):
    """All resonances are 2 % higher, many of their widths, with a quarter of the damping: the residuals forget that."""
    theta, axis = chain.vector(TRUTH), chain.frequency
    values = chain.frf(theta)
    resonances = fit_resonances([frf_on(axis, "accelerance")], [values])
    moved = values.copy()
    for pole, near in zip(resonances.poles, resonances.near[0], strict=True):
        moved += near * (axis - pole) / (axis - 1.02 * complex(pole.real, 0.25 * pole.imag)) - near
    problem = Problem.of(chain, noisy(chain, moved, 1e-3, 1))
    fit = fit_at(problem, chain.to_unit(theta))
    reported = estimate_model_error(ErrorEffects(problem, fit)).size
    assert 0.7 < reported.damping / np.log(4.0) < 1.5


def test_plausible_errors_are_preferred_among_those_that_explain_a_misfit():
    narrow, wide = ModelError(5e-4, magnitude=1.05, other=0.03), ModelError(0.03, damping=0.3, magnitude=0.1)
    assert _most_plausible([(5e-4, narrow), (0.032, wide)]) == wide
    assert _most_plausible([(5e-4, narrow), (0.032, replace(wide, damping=2.5))]) == narrow
    assert _most_plausible([(5e-4, replace(narrow, magnitude=0.1)), (0.032, wide)]).magnitude == 0.1


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize(("mass", "size", "noise"), [(2, 1.1, 1e-2), (3, 0.995, 1e-3), (2, 1.02, 1e-3)])
def test_the_estimated_errors_explain_the_residuals(chain, mass, size, noise):
    """By the averages that intervals use; by those for the size, chi-squared was 2 to 4."""
    masses = ["1 kg"] * 5
    masses[mass] = f"{size} kg"
    measured = noisy(chain, load_chain(*masses).frf(TRUTH), noise, 1)
    problem = Problem.of(chain, measured)
    fit = refine(problem)
    reported = estimate_model_error(ErrorEffects(problem, fit))
    assert reported.chi_squared < 1.1


def test_a_fit_to_the_noise_reports_no_model_error_on_any_lines(sdof, collet, torque_100):
    for assembly, theta, step in ((sdof, None, 0.37), (collet, torque_100, 12.7)):
        there = assembly.on(np.arange(assembly.frequency[0] + step, assembly.frequency[-1], step))
        for known in (True, False):
            measured = noisy(there, there.frf(theta), 0.01, 7, known=known)
            adequacy = dovetail.identify(assembly, measured, "refined").adequacy
            assert (adequacy.word, adequacy.size, adequacy.causes, adequacy.bands) == ("to the noise", None, (), ())
            assert adequacy.sentence == "The model fits to the noise."


@pytest.mark.parametrize(
    ("size", "word"),
    [
        (ModelError(0.009), "good"),
        (ModelError(0.011), "rough"),
        (ModelError(0.059), "rough"),
        (ModelError(0.061), "does not fit"),
        (ModelError(0.001, damping=0.6), "rough"),
        (ModelError(0.001, magnitude=0.9), "does not fit"),
        (ModelError(0.001, phase=0.2), "rough"),
        (ModelError(0.001, other=0.8), "does not fit"),
    ],
)
def test_a_word_is_that_of_the_worst_error(size, word):
    """As in docs/adequacy.md."""
    assert word_for(size) == word


def test_an_allowed_error_sets_the_intervals_of_the_posterior(chain, off):
    spread, reported = [], []
    for allowed in (5e-4, 0.01):
        result = dovetail.identify(
            chain, off, "posterior", form="laplace", samples=100, model_error=allowed, **NO_CAUSES
        )
        assert result.posterior.model_error.natural_frequency == allowed
        assert result.provenance["model_error"] == allowed
        low, high = np.transpose([*result.interval.values()])
        spread.append(np.log(high / low))
        reported.append(result.adequacy.size)
    assert np.all(spread[1] > 2.0 * spread[0])
    assert reported[0] == reported[1]  # what the measurement shows does not depend on what is allowed


def test_twice_what_the_measurement_shows_sets_the_intervals_by_default(chain, off):
    """Its size is known within a factor of two; what has no shape is held by chi-squared."""
    result = dovetail.identify(chain, off, "posterior", form="laplace", samples=100, **NO_CAUSES)
    allowed, reported = result.posterior.model_error, result.adequacy.size
    assert result.adequacy.allowed is None
    assert allowed.natural_frequency == 2.0 * reported.natural_frequency > 2e-3
    assert allowed.other == reported.other


def test_an_allowed_error_sets_the_weights_of_the_estimate(chain, off):
    fits = [dovetail.identify(chain, off, "refined", model_error=allowed, **NO_CAUSES).fit for allowed in (1e-4, 0.01)]
    deviations = [np.sqrt(np.diag(np.linalg.inv(fit.information + np.eye(4)))) for fit in fits]
    assert np.all(deviations[1] > 2.0 * deviations[0])
    assert np.max(np.abs(np.log(fits[0].theta / fits[1].theta))) > 1e-3


def test_many_searches_are_judged_by_the_allowed_error_and_keep_their_estimate(chain, off):
    theta = []
    for allowed, enough in ((1e-4, False), (0.05, True), (None, True)):
        result = dovetail.identify(chain, off, "multistart", starts=8, model_error=allowed, **NO_CAUSES)
        assert result.adequacy.word == "good"
        assert result.adequacy.allowed == allowed
        assert any("more than the 0.01 % that are allowed" in text for text in result.adequacy.reasons) is not enough
        theta.append(result.theta)
    np.testing.assert_array_equal(theta[0], theta[1])
    np.testing.assert_array_equal(theta[0], theta[2])


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model_error", [-1.0, np.nan, 2.0])
def test_an_impossible_model_error_is_one_clear_error(sdof, method, model_error):
    with pytest.raises(ParameterError, match="is not a relative error") as raised:
        dovetail.identify(sdof, noisy(sdof, sdof.frf()), method, model_error=model_error)
    assert len(raised.value.faults) == 1


def test_a_network_takes_no_model_error(model, measured):
    with pytest.raises(ParameterError, match="model_error"):
        model.identify(measured, "network", model_error=0.01)


@pytest.mark.sweep(keep=4)
@pytest.mark.usefixtures("few_mode_searches")
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model_error", [0.0, 1e-4, pytest.param(0.01, marks=pytest.mark.slow), 0.3])
def test_every_error_can_be_allowed_with_noise_and_without(sdof, method, model_error):
    lines = sdof.frequency[::5]
    for values in (sdof.on(lines).frf(), 1.2 * sdof.on(lines).frf()):
        exact = dovetail.Frf(lines, values, "accelerance")
        options = {"posterior": {"samples": 20}, "multistart": {"starts": 4}}.get(method, {})
        result = dovetail.identify(sdof, exact, method, model_error=model_error, **options, **NO_CAUSES)
        assert np.isfinite(result.theta).all()
        assert result.adequacy.allowed == model_error


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("given", [None, 1e-3])
@pytest.mark.parametrize("factor", [-3.0, -1e5])
def test_a_single_line_that_does_not_fit_is_reported(sdof, factor, given):
    line = sdof.on(np.array([100.0]))
    values = factor * line.frf()
    variance = None if given is None else (given * np.abs(values)) ** 2
    measured = dovetail.Frf(line.frequency, values, "accelerance", variance=variance)
    result = dovetail.identify(sdof, measured, "refined", cause_seconds=20.0)
    assert (result.adequacy.word, result.is_trustworthy) == ("does not fit", False)
    assert factor != -3.0 or [cause.name for cause in result.adequacy.causes] == ["sign"]


def test_errors_that_cancel_each_other_give_way_to_plausible_ones_that_leave_little(chain, monkeypatch):
    """Damping and magnitude of a resonance may nearly cancel: of two shafts on springs with a gain of 1.2, errors of
    damping by a factor of 20,000 were the most probable."""
    measured = noisy(chain, 1.2 * chain.frf(TRUTH), 1e-3, 1)
    problem = Problem.of(chain, measured)
    fit = refine(problem)
    monkeypatch.setattr(_Linearised, "estimate", lambda _: ModelError(3e-4, damping=10.0, magnitude=8.0, phase=0.1))
    reported = estimate_model_error(ErrorEffects(problem, fit))
    assert reported.chi_squared == pytest.approx(1.0, abs=0.05)
    assert 0.02 < reported.size.magnitude < 0.4
    assert word_for(reported.size) != "does not fit"
