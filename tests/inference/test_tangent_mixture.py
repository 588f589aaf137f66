"""Searches by tangent maps of many anchors: weights against integrals, and what one map alone cannot reach."""

from __future__ import annotations

import time

import numpy as np
import pytest

import dovetail
from dovetail.inference.fitting import refine
from dovetail.inference.posterior import sample_posterior, typical_model_error
from dovetail.inference.posterior.randomize_then_optimize import LinearisedPoints, TangentMap, TangentSearches
from dovetail.inference.posterior.tangent_mixture import TangentMixture
from dovetail.inference.posterior.weights import are_counted, effective_sample_size, enough_correlation, tempered
from dovetail.interfaces import TimeLimit
from dovetail.problem import Problem
from dovetail.problem.least_squares import Linearisation
from dovetail_bench import calibrate
from support.bent_valley import Bow
from support.small_joints import measured


def mixture_in(problem, start, seed=0, limit=None):
    mode = LinearisedPoints.at(problem, np.array([start]))
    options = {} if limit is None else {"limit": limit}
    return TangentMixture(problem, mode, mode.z, np.random.default_rng(seed), **options)


def bow_density():
    """Return places along the valley and the density there, with the narrow direction integrated out."""
    along = np.linspace(-4.0, 4.0, 4001)
    return along, np.exp(-(along**2 + (along**2 - 1.0) ** 2) / 2.0) * 0.01 * np.sqrt(2.0 * np.pi)


@pytest.mark.parametrize("start", [0.0, 0.8, 1.5])
def test_samples_of_a_bent_valley_have_its_distribution_and_integral(start):
    mixture = mixture_in(Bow(), [start, start**2 - 1.0])
    mixture.sample(1000, 100)
    along, density = bow_density()
    weight = np.exp(mixture.log_weight)
    integral = density.sum() * (along[1] - along[0]) / (2.0 * np.pi)
    assert weight.sum() / mixture.begun == pytest.approx(integral, rel=0.15)
    samples = mixture.ends.z[:, 0]
    for end in (-1.2, -0.5, 0.3, 0.7, 1.2):
        wanted = density[along > end].sum() / density.sum()
        assert weight @ (samples > end) / weight.sum() == pytest.approx(wanted, abs=0.06)


def test_one_map_reaches_a_part_of_a_bent_valley_and_many_reach_all_of_it():
    one, many = mixture_in(Bow(), [1.5, 1.25]), mixture_in(Bow(), [1.5, 1.25])
    anchor = LinearisedPoints.at(Bow(), np.array([[1.5, 1.25]]))
    for _ in range(8):
        one.search(anchor, 100)
    many.sample(400, 100)
    assert one.misses_a_part
    assert one.ends.z[:, 0].min() > -0.5
    assert many.ends.z[:, 0].min() < -1.2
    assert effective_sample_size(many.log_weight) > 0.3 * many.begun


class Parabola:
    """One coordinate of which (z - 2)(z + 1) is measured as 0: where z < 0.5 the map from z = 2 has folded over."""

    def residuals(self, z):
        return np.concatenate([z, (z - 2.0) * (z + 1.0) / 0.05], axis=1)

    def linearise(self, z):
        return Linearisation(self.residuals(z), np.stack([np.ones_like(z), (2.0 * z - 1.0) / 0.05], axis=2))


def test_no_search_ends_where_its_map_has_folded_over():
    mixture = mixture_in(Parabola(), [2.0])
    mixture._known = np.array([[-1.0]]), Parabola().residuals(np.array([[-1.0]]))  # the nearest known point
    mixture.search(LinearisedPoints.at(Parabola(), np.array([[1.99]])), 200)
    assert len(mixture.ends.z) > 190
    assert (mixture.ends.z > 0.5).all()


def test_an_end_that_lies_behind_a_fold_is_no_sample(monkeypatch):
    """The components at z = -1 are those at z = 2, but no path leads there."""
    mixture, behind = mixture_in(Parabola(), [2.0]), LinearisedPoints.at(Parabola(), np.full((50, 1), -1.0))

    def run(searches, settle, _limit):
        searches.ends, searches._squares = behind.copy(), np.zeros(50)
        settle(np.arange(50))

    monkeypatch.setattr(TangentSearches, "run", run)
    mixture.search(LinearisedPoints.at(Parabola(), np.array([[2.0]])), 50)
    assert (mixture.begun, len(mixture.ends.z)) == (50, 0)


class Wave:
    """sin 3z is measured as 0: maps of every second mode have the same components and the same sign."""

    def residuals(self, z):
        return np.concatenate([z, np.sin(3.0 * z) / 0.05], axis=1)

    def linearise(self, z):
        return Linearisation(self.residuals(z), np.stack([np.ones_like(z), 3.0 * np.cos(3.0 * z) / 0.05], axis=2))


def test_the_map_of_a_mode_has_no_density_about_another_with_the_same_components():
    places = np.arange(-2, 3) * np.pi / 3.0
    modes = LinearisedPoints.at(Wave(), places[:, np.newaxis])
    mixture = TangentMixture(Wave(), modes, modes.z, np.random.default_rng(2))
    mixture.sample(2000, 500)
    nearest = np.abs(mixture.ends.z - places).argmin(axis=1)
    share = np.bincount(nearest, np.exp(mixture.log_weight), minlength=5)
    expected = np.exp(-(places**2) / 2.0)
    np.testing.assert_allclose(share / share.sum(), expected / expected.sum(), atol=0.01)


def test_a_batch_that_the_time_limit_ends_is_no_part_of_the_samples():
    mixture = mixture_in(Bow(), [0.8, -0.36], limit=TimeLimit.of(1e-9))
    time.sleep(0.01)
    assert mixture.sample(400, 100) == 400
    assert (mixture.begun, len(mixture.ends.z)) == (0, 0)


def test_each_mode_gets_its_share_of_the_searches_and_keeps_its_weight():
    modes = LinearisedPoints.at(Parabola(), np.array([[2.0], [-1.0]]))
    mixture = TangentMixture(Parabola(), modes, modes.z, np.random.default_rng(1))
    mixture.sample(2000, 500)
    z = np.linspace(-3.0, 4.0, 700_001)
    density = np.exp(-np.sum(Parabola().residuals(z[:, np.newaxis]) ** 2, axis=1) / 2.0)
    weight = np.exp(mixture.log_weight)
    assert weight[mixture.ends.z[:, 0] > 0.5].sum() / weight.sum() == pytest.approx(
        density[z > 0.5].sum() / density.sum(), abs=0.01
    )


def test_uneven_weights_are_tempered_until_a_quarter_of_them_counts():
    log_weight = -np.arange(200.0)
    assert effective_sample_size(tempered(log_weight)) == pytest.approx(50.0, rel=0.05)
    assert tempered(np.zeros(5)) is not None
    assert (tempered(np.zeros(5)) == 0.0).all()


def test_weights_below_the_largest_by_twelve_powers_of_e_do_not_count():
    assert are_counted(np.array([0.0, -11.9, -12.1])).tolist() == [True, True, False]
    assert are_counted(np.empty(0)).tolist() == []


@pytest.mark.parametrize(("effective", "correlation"), [(5, 0.25), (80, 0.612), (159, 0.996), (200, 1.0)])
def test_moved_samples_may_resemble_starts_whose_weights_are_nearly_even(effective, correlation):
    """400 samples that count as 160: with a correlation c, c^2 / effective + (1 - c^2) / 400 is 1 / 160."""
    log_weight = np.where(np.arange(400) < effective, 0.0, -50.0)
    assert enough_correlation(log_weight, 400) == pytest.approx(correlation, abs=0.01)


def test_searches_in_a_narrow_valley_get_the_steps_that_they_need(assemblies):
    """Half of the searches need more than 35 steps here, and one in ten more than 100."""
    study = calibrate(dovetail.load(assemblies / "bt40_er32_quick.yaml"), cases=1, seed=3)
    assert study.reached[0] > 0.9


def test_searches_do_not_leave_a_bent_valley_that_is_narrow():
    """Of two mounts only the sum of the stiffnesses shows: the valley is 4000 times as long as wide."""
    assembly, frf = measured("two mounts")
    problem = Problem.of(assembly, frf)
    posterior = sample_posterior(problem, refine(problem), model_error=typical_model_error(5e-4))
    assert posterior.converged_fraction > 0.95


def test_a_search_that_comes_no_nearer_is_given_up():
    """No z has a component beyond the fold of the map; that of z = 1 is reached in few steps."""

    class Counted:
        computed = 0

        def residuals(self, z):
            return np.concatenate([z, (z - 2.0) * (z + 1.0) / 0.5], axis=1)

        def linearise(self, z):
            self.computed += len(z)
            return Linearisation(self.residuals(z), np.stack([np.ones_like(z), (2.0 * z - 1.0) / 0.5], axis=2))

    problem = Counted()
    start = LinearisedPoints.at(problem, np.array([[2.0]]))
    tangent_map = TangentMap(problem, start)
    points = np.array([[[2.0]], [[1.0]], [[0.5]]])
    anchored, reachable, fold = (tangent_map.components(problem.residuals(z)) for z in points)
    for target, reached, most in ((reachable, True, 20), (2.0 * fold - anchored, False, 45)):
        problem.computed = 0
        assert tangent_map.solve(target, start, 200)[1].tolist() == [reached]
        assert problem.computed <= most
