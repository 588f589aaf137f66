"""Measurements of amplitudes alone, with so much noise that amplitudes follow Rice's distribution, not a normal one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import rice

import dovetail
from dovetail.frf.rice import noise_in_scatter, rice_negative_log_density
from dovetail.measurement import complex_noise
from dovetail.problem.random_error import estimated_variance, residual_variance


def amplitudes_of(assembly, theta, level, kind, seed):
    clean = dovetail.Frf(assembly.frequency, assembly.frf(theta), assembly.description.response.quantity)
    return replace(clean, values=np.abs(complex_noise(clean.values, level, seed, kind=kind)), has_phase=False)


@pytest.mark.parametrize("lines", [100, 1500])
@pytest.mark.parametrize("kind", ["proportional", "uniform"])
def test_a_right_model_fits_noisy_amplitudes_down_to_their_noise(sdof, kind, lines):
    """Half of these were said not to fit."""
    for seed in range(6):
        assembly = sdof.on(np.linspace(1.0, 600.0, lines))
        theta = assembly.from_unit(np.random.default_rng([seed, lines]).uniform(0.1, 0.9, 2))
        measured = amplitudes_of(assembly, theta, 0.2, kind, seed)
        result = dovetail.identify(assembly, measured, "refined", cause_seconds=0)
        assert result.adequacy.word == "to the noise"
        assert result.fit.chi_squared == pytest.approx(1.0, abs=0.25)
        assert result.fit.theta[0] == pytest.approx(theta[0], rel=0.03)


def test_amplitudes_of_another_structure_do_not_fit_to_the_noise(sdof):
    ripple = 1.0 + 0.5 * np.sin(sdof.frequency / 30.0)
    measured = amplitudes_of(sdof, sdof.from_unit(np.full(2, 0.5)), 0.2, "proportional", 1)
    result = dovetail.identify(sdof, replace(measured, values=measured.values * ripple), "refined", cause_seconds=0)
    assert result.adequacy.word != "to the noise"


@pytest.mark.filterwarnings("error")
def test_a_dead_part_of_the_axis_has_no_noise_and_no_warning(sdof):
    measured = amplitudes_of(sdof, sdof.from_unit(np.full(2, 0.5)), 0.05, "proportional", 1)
    values = measured.values.copy()
    values[100:300] = 0.0
    measured = replace(measured, values=values)
    for model in (None, np.abs(sdof.frf(sdof.from_unit(np.full(2, 0.5))))):
        assert np.isfinite(estimated_variance(measured, model)).all()


@pytest.mark.parametrize("clear", [0.0, 0.3, 1.0, 3.0, 50.0, 3e4])
def test_the_density_is_rices(clear):
    scale, measured = np.sqrt(0.5), np.abs(clear + np.linspace(-1.5, 1.5, 7)) + 0.1
    exact = -rice.logpdf(measured, clear / scale, scale=scale) if clear < 1e4 else (measured - clear) ** 2
    amplitude, one, step = np.full(7, clear), np.ones(7), 1e-6
    surprise, slope = rice_negative_log_density(measured, amplitude, one)
    jacobian = np.log(measured) if clear < 1e4 else 0.0
    np.testing.assert_allclose(np.diff(surprise), np.diff(exact + jacobian), rtol=1e-4, atol=1e-4)
    change = (
        rice_negative_log_density(measured, amplitude, one + step)[0]
        - rice_negative_log_density(measured, amplitude, one - step)[0]
    )
    np.testing.assert_allclose(slope, change / (2.0 * step), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("clear", [0.0, 0.5, 2.0, 8.0])
def test_the_noise_is_estimated_from_scatter_and_mean_square(clear):
    scatter = rice.var(np.sqrt(2.0) * clear, scale=3.0 * np.sqrt(0.5))
    (noise,) = noise_in_scatter(np.array([scatter]), np.array([9.0 * (clear**2 + 1.0)]))
    assert noise == pytest.approx(9.0, rel=0.02)


@pytest.mark.parametrize(("floor", "share"), [(1.0, 0.0), (0.0, 0.04), (1.0, 0.04)])
def test_floor_and_share_of_the_noise_are_estimated_from_amplitudes(floor, share):
    """Most of the FRF lies below the floor; the rest is ten times above it."""
    frequency = np.arange(1.0, 20_001.0)
    model = 20.0 / np.hypot(1.0, (frequency - 1e4) / 300.0)
    truth = floor + share * model**2
    normal = np.random.default_rng(3).standard_normal((2, len(model)))
    values = np.abs(model + np.sqrt(truth / 2.0) * (normal[0] + 1j * normal[1]))
    measured = dovetail.Frf(frequency, values, "accelerance", has_phase=False)
    reported = residual_variance(measured, model + 0j, np.ones(len(model), dtype=bool))
    np.testing.assert_allclose(reported, truth, rtol=0.06)
    np.testing.assert_allclose(np.median(estimated_variance(measured, model) / truth), 1.0, atol=0.1)
