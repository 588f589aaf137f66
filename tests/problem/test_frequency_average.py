"""Averages over neighbouring lines: noise stays white, derivatives are exact, few model lines are computed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.inference.posterior import ModelError
from dovetail.inference.posterior.frequency_average import AveragedResiduals, needs_average, weigh, with_deviations
from dovetail.problem.observations import Observations, StackedResiduals
from dovetail.problem.residuals import FrfResiduals, ModelFrfs
from support.noisy_measurements import noisy

EVEN = np.arange(50.0, 2050.0, 0.25)
UNEVEN = np.unique(np.concatenate([EVEN[::4], EVEN[3000:5000], [60.1, 60.2]]))
LEVEL = 10.0
"""Amplitude of a flat FRF, far above its noise."""


def averaged_noise(frequency, width, seed, *, has_phase=True, deviation=0.0):
    """Residuals of a flat FRF, right but for noise that grows with the frequency."""
    variance = 0.01 * (frequency / frequency[0]) ** 2
    normal = np.sqrt(variance / 2.0) * np.random.default_rng(seed).standard_normal((2, len(frequency)))
    values = LEVEL + (normal[0] + 1j * normal[1] if has_phase else normal[0] + 0j)
    measured = dovetail.Frf(frequency, values, "accelerance", has_phase=has_phase)
    used = np.random.default_rng(seed).random(len(frequency)) > 0.05
    flat, lines = np.full(len(frequency), LEVEL + 0j), np.arange(len(frequency))
    residual = AveragedResiduals(measured, variance, used, lines, width, np.full(len(frequency), deviation))
    return residual.of(flat[np.newaxis])[0].reshape(-1, 2 if has_phase else 1)


@pytest.mark.parametrize("has_phase", [True, False])
@pytest.mark.parametrize("frequency", [EVEN, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("width", [1e-3, 0.01, 0.05])
def test_averages_of_noise_are_white(frequency, width, has_phase):
    residuals = np.concatenate([averaged_noise(frequency, width, seed, has_phase=has_phase) for seed in range(20)])
    count = residuals.size
    assert np.mean(residuals**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / count))
    assert np.mean(residuals[1:] * residuals[:-1]) == pytest.approx(0.0, abs=4.0 / np.sqrt(count))
    if has_phase:
        assert np.mean(residuals[:, 0] * residuals[:, 1]) == pytest.approx(0.0, abs=4.0 / np.sqrt(len(residuals)))


def test_an_error_of_each_average_is_part_of_its_random_error():
    plain, allowed = (averaged_noise(EVEN, 0.01, 1, deviation=deviation) for deviation in (0.0, 5.0))
    assert allowed.shape == plain.shape
    assert np.mean(allowed**2) < 1e-3


def test_a_single_line_has_residuals_and_no_error_shapes():
    measured = dovetail.Frf(np.array([100.0]), np.array([2.0 + 0j]), "accelerance")
    one = np.ones(1)
    residual = AveragedResiduals(measured, one, one > 0.0, np.zeros(1, dtype=np.intp), 0.01, 0.0 * one)
    np.testing.assert_allclose(residual.of(np.array([[3.0 + 0j]])), [[np.sqrt(2.0), 0.0]], rtol=1e-6)
    assert residual.jacobian(np.ones((1, 1), complex), np.ones((1, 0, 1), complex)).shape == (1, 0, 2)


@pytest.mark.parametrize("has_phase", [True, False])
@pytest.mark.parametrize("step", [1, 3])
def test_derivatives_of_averages_are_their_differences(sdof, has_phase, step):
    frequency = np.concatenate([sdof.frequency[:200:step], sdof.frequency[200:]])
    assembly = sdof.on(frequency)
    frf = noisy(assembly, assembly.frf(), 0.01, 1, has_phase=has_phase)
    lines = np.arange(len(frequency))
    used = lines % 50 > 0
    residual = AveragedResiduals(frf, frf.variance, used, lines, 0.02, 0.01 * np.abs(frf.values))
    problem, fraction = FrfResiduals(assembly, residual), np.array([[0.4, 0.6]])
    jacobian = problem.linearise(fraction).jacobian[0]
    for index, change in enumerate(1e-6 * np.eye(2)):
        difference = (problem.residuals(fraction + change) - problem.residuals(fraction - change))[0] / 2e-6
        np.testing.assert_allclose(jacobian[index], difference, atol=1e-5 * np.abs(difference).max())


def test_small_errors_leave_single_lines():
    assert not needs_average(ModelError(5e-4))
    assert needs_average(ModelError(2e-3))


@pytest.mark.parametrize("width", [2e-3, 0.01, 0.05])
def test_fewer_lines_of_the_model_give_the_same_averages(collet, torque_100, width, monkeypatch):
    """Within 1 % of the averaged magnitude, also where a resonance is displaced by the error that is allowed.

    The last averages, of half as many lines, are within 5 %.
    """
    values = collet.frf(torque_100)
    target = Observations.of(collet.description, noisy(collet, values, 0.01, 1))
    used, variance = np.ones(len(values), dtype=bool), target.frfs[0].variance
    lines, residual = weigh(target, variance, used, values, ModelError(width))
    every_line = np.arange(len(values))
    whole = AveragedResiduals(target.frfs[0], variance, used, every_line, 2.0 * width, np.zeros(len(values)))
    assert len(lines) < 0.5 * len(values)
    for factor in (1.0, 1.0 + width):
        shown = np.interp(collet.frequency / factor, collet.frequency, values)
        few, every = residual.responses[0]._averaged(shown[np.newaxis, lines])[0], whole._averaged(shown[np.newaxis])[0]
        magnitude = whole._averaged(np.abs(shown)[np.newaxis])[0]
        error = np.abs(few - every) / magnitude
        assert error[:-2].max() < 0.01
        assert error[-2:].max() < 0.05


def test_several_responses_are_averaged_each_on_its_own_lines(assemblies):
    assembly = dovetail.load(assemblies / "bt40_er32_two_points.yaml")
    assembly = assembly.on(np.arange(100.0, 9001.0, 8.0), np.arange(102.0, 8000.0, 5.0))
    theta = assembly.from_unit(np.full(len(assembly.parameters), 0.4))
    frfs = [noisy(alone, alone.frf(theta), 0.01, seed) for seed, alone in enumerate(assembly.each_response)]
    model, target = ModelFrfs.of(assembly), Observations.of(assembly.description, frfs)
    values, variance = model.frf(theta[np.newaxis])[0], np.concatenate([frf.variance for frf in frfs])
    without = Observations.of(
        assembly.description, [replace(frf, values=part) for frf, part in zip(frfs, target.split(values), strict=True)]
    )
    shown = []
    for measured in (target, without):
        lines, residual = weigh(measured, variance, variance > 0.0, values, ModelError(0.01))
        assert isinstance(residual, StackedResiduals)
        shown.append(residual.of(model.at(lines).frf(theta[np.newaxis]))[0])
        np.testing.assert_allclose(shown[-1], residual.of(values[np.newaxis, lines])[0], rtol=1e-6, atol=1e-9)
    of_noise = shown[0] - shown[1]
    assert np.mean(of_noise**2) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / len(of_noise)))


def test_averages_with_another_error_of_each_are_those_that_are_made_with_it(sdof):
    frf, size = noisy(sdof, sdof.frf()), ModelError(0.01, other=0.2)
    values, variance = np.tile(1.1 * frf.values, 2), np.tile(frf.variance, 2)
    for count in (1, 2):
        target = Observations((frf,) * count)
        given = (target, variance[: 600 * count], variance[: 600 * count] > 0.0, values[: 600 * count])
        (lines, plain), (_, wanted) = weigh(*given, replace(size, other=0.0)), weigh(*given, size)
        deviation = [size.other * np.abs(values[:600])] * count
        at = np.concatenate([values[lines[lines < 600]]] * count)[np.newaxis]
        slopes = np.stack([at[0], 1j * at[0] ** 2])
        shown = with_deviations(plain, at[0], slopes)(deviation)
        np.testing.assert_allclose(shown[:1], wanted.of(at), rtol=1e-9)
        np.testing.assert_allclose(shown[1:], wanted.jacobian(at, slopes[np.newaxis])[0], rtol=1e-9)
        assert not np.allclose(plain.of(at), wanted.of(at), rtol=0.1)
