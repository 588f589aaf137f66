"""The batched search against SciPy's, and against a slow version of itself that takes one start after the other."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

import dovetail
from dovetail.problem import Problem
from dovetail.problem.least_squares import _AT_BOUND, _LARGEST_BEND, Linearisation, Minima, SumOfSquares, minimise


def searched_slowly(problem: SumOfSquares, start: np.ndarray, tolerance: float, most_steps: int) -> np.ndarray:
    """Return the end of one search, by the formulas of `minimise` with loops, a root finder and a dense solve."""
    x, radius, sizes = np.clip(start, 1e-10, 1.0 - 1e-10), None, np.zeros_like(start)
    here = problem.linearise(x[np.newaxis])
    for _ in range(most_steps - 1):
        residuals, jacobian = here.residuals[0], here.jacobian[0].T
        gradient, cost = jacobian.T @ residuals, residuals @ residuals
        sizes = np.maximum(sizes, np.linalg.norm(jacobian, axis=0))
        distance = np.where(gradient > 0.0, x, 1.0 - x)
        scale = np.sqrt(distance) / sizes
        radius = np.linalg.norm(x / scale) if radius is None else radius
        barrier = np.abs(gradient) * scale**2 / distance
        curvature = np.diag(scale) @ (jacobian.T @ jacobian) @ np.diag(scale) + np.diag(barrier)

        def length_with(damping, of=gradient, curvature=curvature, scale=scale):
            return np.linalg.norm(np.linalg.solve(curvature + damping * np.eye(len(scale)), -scale * of))

        damping = 1e-14 * np.linalg.eigvalsh(curvature).max()
        if length_with(damping) > radius:
            highest = np.linalg.norm(scale * gradient) / radius
            damping = scipy.optimize.brentq(lambda d: length_with(d) - radius, damping, highest)  # noqa: B023
        matrix = curvature + damping * np.eye(len(x))
        room = 0.995 * np.stack([x, 1.0 - x])
        velocity, free = np.linalg.solve(matrix, -scale * gradient), np.arange(len(x))
        while np.any(outside := np.maximum(-room[0] - scale * velocity, scale * velocity - room[1])[free] > 0.0):
            stopped = np.setdiff1d(np.arange(len(x)), free[~outside])
            free = free[~outside]
            velocity[stopped] = np.clip(
                velocity[stopped], -room[0][stopped] / scale[stopped], (room[1] / scale)[stopped]
            )
            given = (scale * gradient)[free] + matrix[np.ix_(free, stopped)] @ velocity[stopped]
            velocity[free] = np.linalg.solve(matrix[np.ix_(free, free)], -given)
        step = scale * velocity
        ahead = problem.residuals((x + 0.1 * step)[np.newaxis])[0]
        second = 2.0 / 0.1**2 * (ahead - residuals - 0.1 * jacobian @ step)
        acceleration = np.zeros_like(x)
        acceleration[free] = np.linalg.solve(matrix[np.ix_(free, free)], -(scale * (jacobian.T @ second))[free])
        trusted = np.linalg.norm(acceleration) <= _LARGEST_BEND * np.linalg.norm(velocity)
        moved = np.clip(step + trusted * scale * acceleration / 2.0, -room[0], room[1])
        there = problem.linearise((x + moved)[np.newaxis])
        decrease, predicted = cost - there.cost[0], -velocity @ (2.0 * scale * gradient + curvature @ velocity)
        ratio = (decrease - barrier @ (moved / scale) ** 2) / predicted
        length = np.linalg.norm(velocity)
        if ratio < 0.25:
            radius = 0.25 * length
        elif not trusted:
            radius = min(radius, 0.5 * length)
        elif ratio > 0.75 and length > 0.95 * radius:
            radius *= 2.0
        if decrease > 0.0:
            x, here = x + moved, there
        if decrease > 0.0 and trusted and ratio > 0.25 and decrease < tolerance / len(residuals) * cost:
            break
    return x


def searched_by_scipy(problem: SumOfSquares, start: np.ndarray, tolerance: float) -> float:
    """Return the sum of squares at which SciPy's trust-region reflective method ends."""
    end = scipy.optimize.least_squares(
        lambda x: problem.residuals(x[np.newaxis])[0],
        start,
        lambda x: problem.linearise(x[np.newaxis]).jacobian[0].T,
        bounds=(0.0, 1.0),
        x_scale="jac",
        ftol=tolerance,
        max_nfev=400,
    )
    return 2.0 * float(end.cost)


@pytest.fixture(scope="module")
def lap(assemblies) -> SumOfSquares:
    """Weighted residuals of a noisy measurement of the bolted lap."""
    assembly = dovetail.load(assemblies / "bolted_lap_beam.yaml")
    theta = assembly.from_unit(np.linspace(0.3, 0.7, len(assembly.parameters)))
    problem = Problem.of(assembly, dovetail.noisy_frf(assembly.simulate(theta), 0.01, 1))
    return problem.weighted(problem.variance)


@pytest.fixture(scope="module")
def starts(lap) -> np.ndarray:
    return np.random.default_rng(7).random((16, 4))


def test_searches_end_in_the_same_minima_as_those_of_scipy(lap, starts):
    found = minimise(lap, starts, tolerance=1e-3, most_steps=200).cost
    others = np.array([searched_by_scipy(lap, start, 1e-3 / lap.residuals(starts[:1]).size) for start in starts])
    lowest = min(found.min(), others.min())
    assert found.min() == pytest.approx(others.min(), abs=0.01)
    reached, reached_by_scipy = (np.count_nonzero(costs < lowest + 0.1) for costs in (found, others))
    assert reached >= reached_by_scipy - 1
    assert reached >= 12


def test_searches_take_the_steps_of_a_slow_version(lap, starts, monkeypatch):
    monkeypatch.setattr("dovetail.problem.trust_region._RADIUS_ERROR", 1e-12)
    monkeypatch.setattr("dovetail.problem.trust_region._RADIUS_STEPS", 100)
    together = minimise(lap, starts[:6], tolerance=1e-3, most_steps=8)
    alone = [searched_slowly(lap, start, 1e-3, 8) for start in starts[:6]]
    np.testing.assert_allclose(together.position, alone, atol=_AT_BOUND)  # within which a search is moved onto a bound


def test_searches_end_where_the_slow_version_ends(lap, starts):
    near = np.clip(minimise(lap, starts[:6], tolerance=1e-2, most_steps=60).position + 0.02, 0.0, 1.0)
    together = minimise(lap, near, tolerance=1e-6, most_steps=60)
    alone = np.array([searched_slowly(lap, start, 1e-6, 60) for start in near])
    costs = np.sum(lap.residuals(alone) ** 2, axis=1)
    np.testing.assert_allclose(together.cost, costs, atol=1e-2)


def test_more_searches_than_fit_into_memory_are_divided_with_the_same_result(lap, starts, monkeypatch):
    together = minimise(lap, starts, tolerance=1e-2, most_steps=40)
    monkeypatch.setattr("dovetail.problem.least_squares._MOST_BYTES", 1.0)
    divided = minimise(lap, starts, tolerance=1e-2, most_steps=40)
    np.testing.assert_array_equal(divided.position, together.position)


class Unused(SumOfSquares):
    """Must not be computed: a model need not take no parameter vectors at all."""

    def residuals(self, position):
        raise AssertionError

    linearise = residuals


def test_without_starts_nothing_is_computed_and_there_are_no_minima():
    found = minimise(Unused(), np.empty((0, 3)), tolerance=1e-2, most_steps=40)
    assert found.position.shape == (0, 3)
    assert found.curvature.shape == (0, 3, 3)
    assert len(Minima.joined([found, found]).cost) == 0


def test_each_search_is_reported_once_when_it_ends(lap, starts):
    reported = []
    minimise(lap, starts, tolerance=1e-2, most_steps=9, callback=lambda: reported.append(1))
    assert len(reported) == len(starts)


class Valley(SumOfSquares):
    """Linear residuals whose minimum is outside of the cube; their valley is a thousand times as long as wide."""

    A = np.array([[1.0, 1.0, 0.0], [1e-3, -1e-3, 0.0], [0.0, 1.0, 1.0], [0.0, 1e-3, -1e-3]])
    b = A @ np.array([-0.4, 0.9, 0.3])

    def residuals(self, position):
        return 1e4 * (position @ self.A.T - self.b)

    def linearise(self, position):
        return Linearisation(self.residuals(position), np.tile(1e4 * self.A.T, (len(position), 1, 1)))


def test_a_search_follows_a_valley_along_a_face():
    """A coordinate that stops at the face while the others went on would climb the side of the valley."""
    right = scipy.optimize.lsq_linear(Valley.A, Valley.b, (0.0, 1.0), tol=1e-14)
    found = minimise(Valley(), np.random.default_rng(3).random((20, 3)), tolerance=1e-3, most_steps=60)
    np.testing.assert_allclose(found.position, np.tile(right.x, (20, 1)), atol=1e-3)
    assert np.mean(found.steps) < 12.0


class Wall(SumOfSquares):
    """A parabola about a place, by default 0.7, without finite residuals below 0.2."""

    def __init__(self, lowest=0.7):
        self._lowest = lowest

    def residuals(self, position):
        return np.where(position < 0.2, np.inf, position - self._lowest)

    def linearise(self, position):
        return Linearisation(self.residuals(position), np.ones((len(position), 1, 1)))


def test_a_search_that_begins_where_nothing_is_finite_ends_there_and_others_go_on():
    found = minimise(Wall(), np.array([[0.1], [0.9], [0.3]]), tolerance=1e-6, most_steps=40)
    np.testing.assert_allclose(found.position[:, 0], [0.1, 0.7, 0.7], atol=1e-3)
    assert found.cost[0] == np.inf


def test_searches_that_are_superfluous_end_and_the_others_go_on(lap, starts):
    seen, reported = [], []

    def superfluous(places, steps_left):
        seen.append((len(places.cost), steps_left))
        return np.arange(len(places.cost)) % 2 == (0 if len(seen) == 2 else 2)

    ends = minimise(
        lap,
        starts[:6],
        tolerance=1e-3,
        most_steps=60,
        superfluous=superfluous,
        callback=lambda: reported.append(1),
    )
    full = minimise(lap, starts[:6], tolerance=1e-3, most_steps=60)
    assert seen[:3] == [(6, 58), (6, 57), (6, 56)]
    np.testing.assert_array_equal(ends.steps[::2], 3)
    np.testing.assert_array_equal(ends.position[1::2], full.position[1::2])
    assert len(reported) == 6


def test_a_search_that_is_driven_to_where_nothing_is_finite_ends_close_to_it():
    found = minimise(Wall(-3.0), np.array([[0.9], [0.21]]), tolerance=1e-6, most_steps=60)
    np.testing.assert_allclose(found.position[:, 0], 0.2, atol=2e-3)
    assert np.isfinite(found.cost).all()
