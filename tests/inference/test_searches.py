"""Where searches begin: differential evolution on functions with many minima. Which of their ends differ."""

import numpy as np
import pytest

from dovetail.inference.fitting.searches import Similar, Starts, different, evolved
from dovetail.interfaces import NO_LIMIT, TimeLimit
from dovetail.problem.definition import latin_hypercube
from dovetail.problem.least_squares import Minima


def rastrigin(points: np.ndarray) -> np.ndarray:
    """A bowl about 0.3 with a local minimum at every tenth of each coordinate, and a bent valley in the first two."""
    away = 10.0 * (points - 0.3)
    return (
        np.sum(away**2 + 4.0 * (1.0 - np.cos(2.0 * np.pi * away)), axis=1) + 50.0 * (away[:, 1] - away[:, 0] ** 2) ** 2
    )


def start(seed: int, count: int = 64, width: int = 5) -> np.ndarray:
    """The best of eight times as many random points."""
    points = latin_hypercube(8 * count, width, np.random.default_rng(seed))
    return points[np.argsort(rastrigin(points))[:count]] if width > 1 else points[:count]


def test_points_find_the_lowest_of_many_minima():
    found = 0
    for seed in range(20):
        best = evolved(rastrigin, start(seed), np.random.default_rng(seed), 200)[0]
        found += bool(np.all(np.abs(best - 0.3) < 0.05))
    assert found >= 15  # of 10^5 minima; the best of as many random points is in none of the cases
    random = latin_hypercube(8 * 64 + 64 * 200, 5, np.random.default_rng(0))
    assert np.abs(random[np.argmin(rastrigin(random))] - 0.3).max() > 0.05


def test_no_point_gets_worse_and_all_stay_in_the_cube():
    points = start(1)
    before, after = np.sort(rastrigin(points)), rastrigin(evolved(rastrigin, points, np.random.default_rng(1), 20))
    assert (np.diff(after) >= 0.0).all()
    assert (after <= before[: len(after)]).all()
    many = evolved(lambda points: -points.sum(axis=1), points, np.random.default_rng(2), 50)  # driven to a corner
    assert many.min() >= 0.0
    assert many.max() <= 1.0


class Rastrigin:
    """A misfit whose sum of squares is the function."""

    limit = NO_LIMIT

    def residuals(self, points):
        return np.sqrt(rastrigin(points))[:, np.newaxis]


def test_starts_are_random_points_and_those_that_differ_after_few_and_many_generations():
    wanted = Similar(candidates=512, random=8, evolved=((0, 3), (10, 12), (200, 4)))
    points = Starts(5, seed=3).similar(Rastrigin(), wanted)
    few, last = points[11:-1], points[-1:]  # all points have come together after many
    assert np.array_equal(points[:3], points[8:11])  # after none they are the most similar random points
    assert 4 <= len(few) <= 12
    apart = np.abs(few[:, np.newaxis] - few).max(axis=2) + np.eye(len(few))
    assert apart.min() > 0.1
    assert (np.diff(rastrigin(few)) >= 0.0).all()
    assert rastrigin(last)[0] < rastrigin(few)[0] < rastrigin(points)[0]


def test_the_same_seed_gives_the_same_points():
    one, other = (evolved(rastrigin, start(4), np.random.default_rng(4), 10) for _ in range(2))
    np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("count", "width"), [(1, 3), (2, 1), (3, 12)])
def test_few_points_and_few_coordinates_suffice(count, width):
    points = evolved(lambda points: np.sum(points**2, axis=1), start(5, count, width), np.random.default_rng(5), 5)
    assert points.shape[1] == width
    assert 1 <= len(points) <= count


def test_a_time_limit_ends_the_generations():
    calls = 0

    def counted(points: np.ndarray) -> np.ndarray:
        nonlocal calls
        calls += 1
        return rastrigin(points)

    points = start(6)
    evolved(counted, points, np.random.default_rng(6), 1000, TimeLimit(0.0))
    assert calls == 1


def test_costs_that_are_not_finite_are_left_behind():
    def holed(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] > 0.5, np.nan, rastrigin(points))

    best = evolved(holed, start(7), np.random.default_rng(7), 30)[0]
    assert best[0] <= 0.5


def test_minima_near_a_lower_one_count_with_it():
    """The standard deviation about each is 0.01; one of the four stands for two searches already."""
    position, cost, searches = [0.1, 0.5, 0.12, 0.52], [2.0, 3.0, 1.0, 4.0], np.array([1, 1, 1, 2])
    ends = Minima(np.array(position)[:, None], np.array(cost), np.full((4, 1, 1), 1e4), np.arange(4), searches)
    apart = different(ends, 3.0)
    np.testing.assert_array_equal(apart.position[:, 0], [0.12, 0.5])
    np.testing.assert_array_equal(apart.searches, [2, 3])
    np.testing.assert_array_equal(apart.steps, [2, 4])
    assert len(different(ends, 1.0).cost) == 4


def minima_at(*positions: tuple[float, ...]) -> Minima:
    position = np.array(positions)
    count, width = position.shape
    ones = np.ones(count, dtype=np.int64)
    return Minima(position, np.arange(count, dtype=float), np.tile(np.eye(width), (count, 1, 1)), ones, ones)


def test_parameters_that_ran_away_to_ends_of_their_ranges_are_drawn_anew():
    minima = minima_at((0.4, 1.0, 0.001, 0.6), (0.2, 0.3, 0.5, 0.98), (0.995, 0.5, 0.5, 0.5))
    points = Starts(4, seed=0).released(minima)
    first, third = np.split(points, 2)  # none from the second
    assert (first[:, [0, 3]] == (0.4, 0.6)).all()
    assert (third[:, 1:] == 0.5).all()
    for drawn in (first[:, 1], first[:, 2], third[:, 0]):  # all over the range
        assert drawn.min() < 0.1
        assert drawn.max() > 0.9
    again = Starts(4, seed=0)
    again.released(minima)
    assert not np.array_equal(again.released(minima), points)  # of the next batch


def test_nothing_is_drawn_anew_where_no_parameter_is_at_an_end():
    assert Starts(2, seed=0).released(minima_at((0.4, 0.6), (0.011, 0.989))).shape == (0, 2)
