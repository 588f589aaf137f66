"""FRFs interpolated between exact lines: their error, how it is estimated, and when they are computed exactly."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.errors import DatasetError, ParameterError
from dovetail.synthesis.interpolation import RationalInterpolant, chebyshev_lines


def error(found, exact):
    return np.max(np.abs(found - exact) / np.abs(exact), axis=-1)


@pytest.fixture(scope="module")
def interpolated(collet):
    return collet.interpolated(1e-9)


@pytest.mark.parametrize("count", [1000, pytest.param(50_000, marks=pytest.mark.slow)])
def test_every_line_of_random_frfs_is_within_ten_times_the_tolerance(collet, interpolated, count):
    worst, refused = 0.0, interpolated.interpolation.rejections
    for seed in range(count // 500):
        theta = latin_hypercube(collet, 500, seed=seed)
        worst = max(worst, float(error(interpolated.frf(theta), collet.frf(theta)).max()))
    assert len(interpolated.interpolation.interpolant.lines) < 50
    assert interpolated.interpolation.rejections - refused < 0.05 * count
    assert 0 < worst < 1e-8


def test_amplitudes_are_those_of_the_exact_frfs_to_the_last_digit_but_one(collet, interpolated):
    theta = latin_hypercube(collet, 300, seed=7)
    np.testing.assert_array_max_ulp(
        interpolated.accelerance_amplitude(theta), collet.accelerance_amplitude(theta), maxulp=2
    )


def rational(frequency, poles, residues):
    return sum(r / (frequency - p) + r / (frequency + np.conj(p)) for p, r in zip(poles, residues, strict=True))


FREQUENCY = np.linspace(100.0, 9000.0, 4451)


def test_a_rational_function_of_low_degree_is_exact_with_a_small_error_estimate():
    poles, residues = np.array([1300 + 9j, 4000 - 30j, 6400 + 80j]), np.array([1.0, -2.0, -0.4 + 0.1j])
    exact = (residues / (FREQUENCY[:, None] - poles)).sum(axis=1)[None, :]
    interpolant = RationalInterpolant(FREQUENCY, chebyshev_lines(9, len(FREQUENCY)))
    found = np.empty_like(exact)
    estimated = interpolant.fill(exact[:, interpolant.lines], found)
    assert error(found, exact).max() < 1e-10
    assert estimated[0] < 1e-9


def test_the_error_is_infinite_without_a_fitting_rational_function():
    """The same value at every line: any weights would do, so that the equations for them are singular."""
    interpolant = RationalInterpolant(FREQUENCY, chebyshev_lines(9, len(FREQUENCY)))
    estimated = interpolant.fill(np.full((3, 9), 2.0 - 1.0j), np.empty((3, len(FREQUENCY)), dtype=complex))
    assert np.isinf(estimated).all()
    assert estimated.shape == (3,)


@pytest.mark.filterwarnings("ignore:AAA failed to converge")
def test_the_estimate_is_the_difference_of_both_functions_written_out():
    """kappa / ((f - a)(f - b) n d), against two rational functions that scipy makes of the same values."""
    from scipy.interpolate import AAA

    values = rational(FREQUENCY, [900 + 9j, 2500 + 40j, 4100 + 15j, 6400 + 80j, 8000 + 60j], [1, -2, 1j, 3, 1])[None]
    interpolant = RationalInterpolant(FREQUENCY, chebyshev_lines(9, len(FREQUENCY)))
    found = np.empty_like(values)
    estimated = interpolant.fill(values[:, interpolant.lines], found)
    x, y = FREQUENCY[interpolant.lines], values[0, interpolant.lines]
    low = np.delete(np.arange(9), [2, 6])  # all but a and b, the second and the fourth of the even ones
    others = AAA(x[low], y[low], max_terms=4, rtol=0, clean_up=False)(FREQUENCY)
    between = np.setdiff1d(np.arange(len(FREQUENCY)), interpolant.lines)
    expected = np.max(np.abs(found[0] - others)[between] / np.abs(found[0])[between])
    assert estimated[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("width", [0.05, 0.5, 5.0])
def test_a_resonance_that_the_lines_do_not_resolve_is_noticed(collet, interpolated, width):
    """A weak mode between two exact lines, which changes the FRF there by a few per cent at the most."""
    interpolant = interpolated.interpolation.interpolant
    exact = collet.frf(latin_hypercube(collet, 40, seed=2))
    centre = FREQUENCY[interpolant.lines[10] : interpolant.lines[11] + 1].mean()
    disturbed = exact * (1 + 0.02 * width / (FREQUENCY - (centre + width * 1j)))
    found = np.empty_like(disturbed)
    estimated = interpolant.fill(disturbed[:, interpolant.lines], found)
    true = error(found, disturbed)
    assert np.all((estimated > 1e-9) | (true < 1e-8))


def test_an_frf_that_cannot_be_interpolated_is_computed_exactly(collet):
    demanding = collet.interpolated(1e-9)
    interpolant = demanding.interpolation.interpolant
    fill = interpolant.fill
    some = [3, 50, 199]

    class Doubtful:
        lines = interpolant.lines

        def fill(self, exact, result):
            estimated = fill(exact, result)
            result[:] = 0.0
            return np.full_like(estimated, np.nan)

    demanding.interpolation.__dict__["interpolant"] = Doubtful()
    theta = latin_hypercube(collet, 200, seed=3)
    np.testing.assert_array_equal(
        demanding.accelerance_amplitude(theta)[some], collet.accelerance_amplitude(theta)[some]
    )
    assert demanding.interpolation.rejections == 200


def test_few_frfs_small_systems_sensitivities_and_measured_parts_are_exact(collet, sdof, assemblies, interpolated):
    theta = latin_hypercube(collet, 5, seed=4)
    np.testing.assert_array_equal(interpolated.frf(theta), collet.frf(theta))
    np.testing.assert_array_equal(interpolated.frf_jacobian(theta)[1], collet.frf_jacobian(theta)[1])
    assert sdof.interpolated().interpolation.interpolant is None
    spindle = dovetail.load(assemblies / "campaign" / "sf_h2_t1.yaml")  # a spline through a measurement is not rational
    many = latin_hypercube(spindle, 40, seed=5)
    np.testing.assert_array_equal(spindle.interpolated().frf(many), spindle.frf(many))


def test_it_stays_interpolated_at_other_frequencies(collet):
    assert collet.interpolated().on(FREQUENCY[:-1]).interpolation.interpolant is not None


def test_threads_change_nothing(collet):
    theta = latin_hypercube(collet, 300, seed=6)
    found = []
    for threads in (1, 3):
        assembly = collet.interpolated()
        assembly.engine.threads = threads
        found.append(assembly.frf(theta))
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("tolerance", [0.0, 1e-13, 1e-6, math.nan])
def test_a_tolerance_that_means_nothing_is_refused(collet, tolerance):
    with pytest.raises(ParameterError, match="the tolerance is"):
        collet.interpolated(tolerance)


def test_a_dataset_of_interpolated_frfs_is_marked_and_can_be_resumed(collet, tmp_path):
    whole = dovetail.generate(collet, tmp_path / "whole", samples=600, interpolation=1e-9)
    exact = dovetail.generate(collet, tmp_path / "exact", samples=600)
    assert (whole.attributes["interpolation"], exact.attributes["interpolation"]) == (1e-9, None)
    np.testing.assert_array_max_ulp(whole.amplitude[:], exact.amplitude[:], maxulp=2)
    assert np.any(whole.amplitude[:] != exact.amplitude[:])
    with pytest.raises(DatasetError, match="it was begun with interpolation 1e-09, not None"):
        dovetail.generate(collet, tmp_path / "whole", samples=600, resume=True)
    (tmp_path / "whole" / "amplitude" / "c" / "0" / "0").unlink()
    before = whole.amplitude[500:]
    again = dovetail.load(json.loads(collet.description.text))
    resumed = dovetail.generate(again, tmp_path / "whole", samples=600, interpolation=1e-9, resume=True)
    np.testing.assert_array_equal(resumed.amplitude[500:], before)
    repeated = dovetail.generate(again, tmp_path / "again", samples=600, interpolation=1e-9)
    np.testing.assert_array_equal(repeated.amplitude[:], resumed.amplitude[:])
    resumed.require(collet)
