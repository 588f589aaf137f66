"""The Gaussian approximation at the mode against independent computations, and when it must warn that it misleads."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import norm
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app
from dovetail.errors import ParameterError
from dovetail.identification.result_file import load_result
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import (
    ModelError,
    Posterior,
    laplace_posterior,
    sample_posterior,
    typical_model_error,
)
from dovetail.inference.posterior.laplace import LaplaceApproximation
from dovetail.inference.posterior.likelihood import MarginalisedResiduals, PosteriorResiduals, marginalised_squares
from dovetail.inference.posterior.mode_search import maximise_posterior
from dovetail.inference.posterior.verdicts import split_half_difference
from dovetail.interfaces import NO_LIMIT
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation, SumOfSquares
from support.noisy_measurements import noisy


class Banana(SumOfSquares):
    """z2 = bent z1^2 within `narrow`: all there is to know of a bent valley, by hand."""

    def __init__(self, bent, narrow=0.01):
        self.bent, self.narrow = bent, narrow

    def residuals(self, fraction):
        z = ndtri(fraction)
        return ((z[:, 1] - self.bent * z[:, 0] ** 2) / self.narrow)[:, np.newaxis]

    def linearise(self, fraction):
        z = ndtri(fraction)
        by_z = np.stack([-2 * self.bent * z[:, 0], np.ones(len(z))], axis=1) / self.narrow
        jacobian = (by_z / norm.pdf(z))[:, :, np.newaxis]
        residuals = self.residuals(fraction)
        return Linearisation(residuals, jacobian)


@pytest.mark.parametrize("model_error", [0.0, 1e-4])
def test_both_forms_agree_on_a_gaussian_posterior(sdof, model_error):
    frf = noisy(sdof, sdof.frf(sdof.from_unit(np.array([0.4, 0.5]))), 0.02, 1)
    fit = refine(Problem.of(sdof, frf))
    sampled = sample_posterior(Problem.of(sdof, frf), fit, samples=2000, model_error=typical_model_error(model_error))
    found = laplace_posterior(Problem.of(sdof, frf), fit, samples=2000, model_error=typical_model_error(model_error))
    assert found.form == "laplace"
    assert found.unreliable == ()
    for name, (low, high) in sampled.interval().items():
        np.testing.assert_allclose(found.interval()[name], (low, high), atol=0.05 * (high - low))


def test_a_sharp_resonance_is_found_again_close_to_the_ends_of_the_ranges(sdof):
    """A start at a fiftieth of the range from its end would be 5 Hz, or 20 widths of the peak, off."""
    theta = np.array([9.99e6, 1.5])
    frf = noisy(sdof, sdof.frf(theta), 0.02, 1)
    found = laplace_posterior(Problem.of(sdof, frf), refine(Problem.of(sdof, frf)))
    for name, value in zip(found.names, theta, strict=True):
        low, high = found.interval()[name]
        assert low < value < high


def test_the_bend_of_a_curved_posterior_is_that_computed_by_hand():
    for bent in (0.002, 0.01, 0.05):
        problem = PosteriorResiduals(Banana(bent))
        mode = maximise_posterior(problem, np.array([[0.5, 0.2]]))[0]
        np.testing.assert_allclose(mode, 0.0, atol=0.01)
        gaussian = LaplaceApproximation.at(problem, np.zeros(2))
        np.testing.assert_allclose(np.sort(np.linalg.norm(gaussian.axes, axis=1)), [0.01, 1.0], rtol=1e-3)
        assert gaussian.bend == pytest.approx([0.0, bent / 0.01], rel=1e-2, abs=1e-6)
        assert gaussian.unreliable.tolist() == [False, bent > 0.003]


def test_a_place_that_is_not_the_most_probable_is_not_trusted():
    assert LaplaceApproximation.at(PosteriorResiduals(Banana(0.0)), np.array([1.0, 0.0])).unreliable.all()


def test_errors_of_the_model_are_integrated_out_as_by_the_formula():
    random = np.random.default_rng(3)
    errors, residuals = 3.0 * random.standard_normal((4, 30)), random.standard_normal((5, 30))

    class Plain:
        limit = NO_LIMIT

        def residuals(self, fraction):
            return residuals

    widened = MarginalisedResiduals(Plain(), errors).residuals(np.zeros((5, 1)))
    np.testing.assert_allclose(np.sum(widened**2, axis=1), marginalised_squares(residuals, errors))


def test_unreliable_parameters_are_named_everywhere(sdof, tmp_path):
    fraction = np.random.default_rng(0).random((300, 2))
    weight = np.full(300, 1 / 300)
    options = {"model_error": ModelError(0.0), "searches": 300, "lines": 9, "seconds": 0.1}
    name = sdof.parameters[1].name
    sampled = Posterior.from_fractions(sdof.parameters, fraction, weight, **options)
    posterior = replace(sampled, form="laplace", unreliable=(name,))
    assert name in posterior.warnings[0]
    plain = posterior.to_dict()
    assert plain["form"] == "laplace"
    assert [one["unreliable"] for one in plain["parameters"].values()] == [False, True]


def test_the_form_is_stored_and_shown(sdof, assemblies, tmp_path):
    result = dovetail.identify(
        sdof, noisy(sdof, sdof.frf(sdof.from_unit(np.array([0.4, 0.5]))), 0.1, 1), "posterior", form="laplace"
    )
    (tmp_path / "result.json").write_text(json.dumps(result.to_dict()))
    again = load_result(tmp_path)
    assert again.posterior.form == "laplace"
    np.testing.assert_allclose(again.posterior.mode, result.posterior.mode)
    ours, theirs = dovetail.predict_band(sdof, again), dovetail.predict_band(sdof, result)
    np.testing.assert_allclose(ours.upper, theirs.upper, rtol=1e-9)
    page = dovetail.write_report(result, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "A Gaussian at the most probable place" in page
    spoilt = result.to_dict()
    spoilt["posterior"]["mode"] = [1.0]
    (tmp_path / "result.json").write_text(json.dumps(spoilt))
    with pytest.raises(dovetail.DovetailError, match="most probable place"):
        load_result(tmp_path)


def test_a_form_that_does_not_exist_is_refused(sdof):
    with pytest.raises(ParameterError, match="Did you mean 'laplace'"):
        dovetail.identify(
            sdof, noisy(sdof, sdof.frf(sdof.from_unit(np.array([0.4, 0.5]))), 0.1, 1), "posterior", form="laplas"
        )


def test_the_command_prints_form_and_convergence(assemblies):
    measured = assemblies / "measurements" / "h0_j_t0_60Nm.uff"
    command = ["identify", str(assemblies / "bt40_er32.yaml"), str(measured), "--method", "posterior"]
    done = CliRunner().invoke(app, [*command, "--form", "laplace"])
    assert done.exit_code == 0, done.output
    assert "A Gaussian at the most probable place" in done.output
    assert "two halves" in done.output


@pytest.mark.parametrize(
    ("options", "least"),
    [
        ({"form": "laplace", "cause_seconds": 0.0}, 0.85),
        pytest.param({"samples": 200}, 0.9, marks=pytest.mark.slow),
    ],
    ids=["laplace", "samples"],
)
def test_the_predicted_band_of_another_tool_contains_its_measurement(collet, assemblies, options, least):
    folder = assemblies / "campaign"
    joint = dovetail.read_frf(folder / "measurements" / "h0_j40_t0.uff", accelerometer_mass=1.2e-3)
    result = dovetail.identify(collet, joint, "posterior", **options)
    other = dovetail.load(folder / "h0_t2.yaml")
    band = dovetail.predict_band(other, result)
    measured = dovetail.read_frf(folder / "measurements" / "h0_j40_t2.uff", accelerometer_mass=1.2e-3)
    amplitude = np.interp(other.frequency, measured.frequency, measured.to("accelerance").amplitude)
    reported = other.frequency <= collet.frequency[-1]  # beyond, the joint was not measured
    assert ((band.lower <= amplitude) & (amplitude <= band.upper))[reported].mean() >= least
    assert np.median((band.upper / band.lower)[reported]) < 1.2


def test_a_shift_between_halves_of_the_samples_is_measured_per_parameter():
    random = np.random.default_rng(0)
    sound = random.standard_normal((400, 2))
    weight = np.full(400, 1 / 400)
    assert split_half_difference(sound, weight, 0.9).max() < 0.25
    drifting = sound + np.where(np.arange(400) < 200, 0.0, 3.0)[:, np.newaxis] * [0.0, 1.0]
    separate = split_half_difference(drifting, weight, 0.9)
    assert separate[0] < 0.25
    assert separate[1] > 0.5
    assert split_half_difference(sound[:1], np.ones(1), 0.9).tolist() == [1.0, 1.0]


def test_few_effective_samples_are_warned_of(sdof):
    random = np.random.default_rng(0)
    options = {"model_error": ModelError(0.0), "searches": 400, "lines": 9, "seconds": 0.1}
    fraction = random.random((400, 2))
    even = Posterior.from_fractions(sdof.parameters, fraction, np.full(400, 1 / 400), **options)
    assert even.warnings == ()
    weight = np.where(np.arange(400) < 10, 1.0, 1e-6)
    few = Posterior.from_fractions(sdof.parameters, fraction, weight / weight.sum(), **options)
    assert "effective sample size is only 10" in few.warnings[0]
