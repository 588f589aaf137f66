"""Metropolis steps of each kind keep the posterior, and all kinds together reach it from other places."""

import numpy as np
import pytest

from dovetail.inference.posterior.metropolis import Chains, decorrelate
from dovetail.inference.posterior.tangent_steps import Density
from dovetail.inference.posterior.weights import INDEPENDENT
from dovetail.problem.least_squares import Linearisation

GRID = np.linspace(-5.0, 5.0, 601)


class Threshold:
    """A measurement that only shows whether the first coordinate is above a threshold, on which the second depends."""

    def residuals(self, z):
        of_first = 1.0 + np.tanh(4.0 * (z[:, :1] - 0.4))
        return np.concatenate([z, of_first + 0.0 * z[:, 1:], 2.0 * (z[:, 1:] - of_first / 2.0)], axis=1)

    def linearise(self, z):
        jacobian = np.zeros((len(z), 2, 4))
        jacobian[:, 0, 0] = jacobian[:, 1, 1] = 1.0
        slope = 4.0 / np.cosh(4.0 * (z[:, 0] - 0.4)) ** 2
        jacobian[:, 0, 2], jacobian[:, 0, 3], jacobian[:, 1, 3] = slope, -slope, 2.0
        return Linearisation(self.residuals(z), jacobian)


def exact(problem, count, random):
    """Draws of the posterior from a fine grid, each scattered within its cell."""
    points = np.stack(np.meshgrid(GRID, GRID, indexing="ij"), axis=-1).reshape(-1, 2)
    density = np.exp(-np.sum(problem.residuals(points) ** 2, axis=1) / 2.0)
    chosen = points[random.choice(len(points), count, p=density / density.sum())]
    return chosen + (GRID[1] - GRID[0]) * random.uniform(-0.5, 0.5, chosen.shape)


def shares(z):
    """Fractions of the points in some regions."""
    regions = [z[:, 0] < -1.0, z[:, 0] < 0.0, z[:, 0] > 0.6, z[:, 1] > 0.5, (z[:, 0] > 0.2) & (z[:, 1] > 0.8)]
    return np.mean(regions, axis=1)


@pytest.mark.sweep(keep=1)
@pytest.mark.parametrize("kind", ["tangent_steps", "difference_steps", "prior_steps"])
def test_steps_keep_the_distribution_of_exact_draws(kind):
    problem, random = Threshold(), np.random.default_rng(1)
    points = exact(problem, 6000, random)
    chains = Chains(Density.of(problem), points, random)
    for _ in range(12):
        assert getattr(chains, kind)() > 0.0
    assert np.mean(chains.z[:, 0] != points[:, 0]) > 0.5
    np.testing.assert_allclose(shares(chains.z), shares(exact(problem, 60_000, random)), atol=0.022)  # 3.5 st. errors
    expected = -np.sum(problem.residuals(chains.z) ** 2, axis=1) / 2.0
    np.testing.assert_allclose(chains.log_posterior, expected)


def test_steps_that_ignore_the_density_of_proposals_would_be_seen():
    """A check of the test above: without the ratio of the prior's densities, prior steps favour the middle."""
    problem, random = Threshold(), np.random.default_rng(1)
    chains = Chains(Density.of(problem), exact(problem, 6000, random), random)
    propose = chains._propose
    chains._propose = lambda rows, proposed, log_ratio: propose(rows, proposed, 0.0)
    for _ in range(12):
        chains.prior_steps()
    assert np.abs(shares(chains.z) - shares(exact(problem, 60_000, random))).max() > 0.05


def test_points_that_start_elsewhere_reach_the_posterior():
    problem, random = Threshold(), np.random.default_rng(2)
    start = np.array([-0.5, 0.0]) + 0.3 * random.standard_normal((3000, 2))
    chains = decorrelate(Density.of(problem), start, random)
    correlation = [np.corrcoef(start[:, column], chains.z[:, column])[0, 1] for column in range(2)]
    assert np.abs(correlation).max() < INDEPENDENT + 0.06
    np.testing.assert_allclose(shares(chains.z), shares(exact(problem, 60_000, random)), atol=0.06)


def test_the_same_seed_gives_the_same_samples():
    problem = Threshold()
    start = exact(problem, 50, np.random.default_rng(3))
    first, second = (decorrelate(Density.of(problem), start, np.random.default_rng(4)).z for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_few_points_move_too(count):
    problem = Threshold()
    start = exact(problem, count, np.random.default_rng(5))
    chains = decorrelate(Density.of(problem), start, np.random.default_rng(6))
    assert np.isfinite(chains.z).all()
    assert (chains.z != start).any()


class TwoGroups:
    """A normal posterior, but for one point in a hundred in another group, from which no short step leads."""

    width, distance, drop = 0.1, 6.0, 2.0 * np.log(100.0)

    def __init__(self):
        self.computed = 0

    def residuals(self, z):
        self.computed += len(z)
        near = (z[:, 0] / self.width) ** 2
        far = ((z[:, 0] - self.distance) / self.width) ** 2 + self.drop
        return np.stack([np.sqrt(np.minimum(near, far)), z[:, 1]], axis=1)

    def linearise(self, z):
        jacobian = np.zeros((len(z), 2, 2))
        jacobian[:, 0, 0], jacobian[:, 1, 1] = 1.0 / self.width, 1.0
        return Linearisation(self.residuals(z), jacobian)


def test_a_few_points_in_another_group_do_not_cost_all_others_more_steps():
    problem, random = TwoGroups(), np.random.default_rng(7)
    start = problem.width * random.standard_normal((300, 2)) * [1.0, 1.0 / problem.width]
    start[:3, 0] += problem.distance
    chains = decorrelate(Density.of(problem), start, random)
    most = start[:, 0] < problem.distance / 2.0
    assert abs(np.corrcoef(start[most, 0], chains.z[most, 0])[0, 1]) < INDEPENDENT + 0.06
    assert problem.computed < 150 * len(start)
