"""Parameters fitted to the measured FRF itself."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.errors import MeasurementError, ParameterError
from dovetail.identification.refinement import _Problem, identify_from_range, refine
from dovetail.measurement import complex_noise


def measured_of(assembly, theta, noise=0.0, seed=0, **of_frf):
    values = complex_noise(assembly.frf(theta), noise, seed)
    return dovetail.Frf(assembly.frequency, values, "accelerance", **of_frf)


def test_known_parameters_come_back_without_a_network(collet, torque_20):
    result = identify_from_range(collet, measured_of(collet, torque_20))
    np.testing.assert_allclose(result.theta, torque_20, rtol=1e-4)
    assert result.method == "refined"
    assert result.mean_coherence == pytest.approx(1.0, abs=1e-9)


def test_noise_leaves_the_misfit_it_should(collet, torque_100):
    values = collet.frf(torque_100)
    noise = 0.01 * np.abs(values)
    fits = [
        refine(collet, measured_of(collet, torque_100, 0.01, seed, variance=noise**2), [torque_100]).misfit
        for seed in range(3)
    ]
    expected = 0.01**2 / (0.01**2 + 0.005**2)  # the fit also allows half a per cent for the model
    np.testing.assert_allclose(fits, expected, rtol=0.05)


def test_an_amplitude_alone_is_enough(collet, torque_20):
    frf = measured_of(collet, torque_20)
    amplitude = dovetail.Frf(frf.frequency, frf.amplitude, "accelerance", has_phase=False)
    fitted = refine(collet, amplitude)
    np.testing.assert_allclose(np.abs(collet.frf(fitted.theta)), frf.amplitude, rtol=1e-3)


@pytest.mark.parametrize("has_phase", [True, False])
def test_the_derivatives_are_those_of_the_residuals(collet, torque_20, has_phase):
    frf = measured_of(collet, torque_20, 0.02, 1)
    target = frf if has_phase else dovetail.Frf(frf.frequency, frf.amplitude, "accelerance", has_phase=False)
    problem, at = _Problem(collet, target), np.linspace(0.3, 0.7, 12)
    for column in range(12):
        step = 1e-6 * np.eye(12)[column]
        slope = (problem.residuals(at + step) - problem.residuals(at - step)) / 2e-6
        exact = problem.jacobian(at)[:, column]
        assert np.abs(slope - exact).max() <= 1e-4 * np.abs(exact).max()


def test_the_ranges_hold(sdof):
    beyond = dovetail.Frf(sdof.frequency, sdof.frf({"k": 3e7, "c": 40.0}), "accelerance")
    fitted = refine(sdof, beyond, [np.array([-1.0, 1e9])])
    assert all(p.lower <= value <= p.upper for p, value in zip(sdof.parameters, fitted.theta, strict=True))
    assert fitted.misfit > 100


def test_nothing_to_identify_and_too_few_lines(sdof, assemblies):
    tool = dovetail.load(assemblies / "campaign" / "t0.yaml")
    frf = dovetail.Frf(tool.frequency, tool.frf(), "accelerance")
    with pytest.raises(ParameterError, match="nothing to identify"):
        identify_from_range(tool, frf)
    with pytest.raises(MeasurementError, match="the measurement covers"):
        identify_from_range(sdof, dovetail.Frf(sdof.frequency[5:], sdof.frf()[5:], "accelerance"))
