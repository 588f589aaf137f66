"""The searches for modes: which of them end early, and which ends are different."""

import numpy as np
import pytest

from dovetail.inference.fitting.fit import PACE_STEPS
from dovetail.inference.fitting.searches import are_different
from dovetail.inference.posterior.mode_search import _Race
from dovetail.problem.least_squares import Minima

PACE = PACE_STEPS


def places(cost, position=None):
    """Searches at 0, 1, 2 ... of one coordinate, ten standard deviations apart, or elsewhere."""
    position = np.arange(len(cost)) if position is None else position
    many = len(cost)
    at, ones = np.array(position, dtype=float)[:, np.newaxis], np.ones(many)
    return Minima(at, np.array(cost), np.full((many, 1, 1), 100.0), ones, ones)


def ended(course, worth, steps_left, position=None):
    """Which searches end when the costs of several steps are shown one after the other."""
    return raced(_Race(worth), course, steps_left, position)


def raced(race, course, steps_left, position=None):
    """The same for a race that may have seen other searches; so many steps are left at the end."""
    left = range(steps_left + len(course) - 1, steps_left - 1, -1)
    return [race(places(cost, position), steps).tolist() for cost, steps in zip(course, left, strict=True)]


@pytest.mark.parametrize(
    ("after", "steps_left", "ends"),
    [
        (9000.0, 10, True),  # at this pace 8100 after ten more
        (9000.0, 300, False),  # 10,000 * 0.9^31 = 380
        (9000.0, 200, True),  # 1,094
        (4000.0, 40, False),  # 102
        (4000.0, 10, True),  # 1,600
        (11000.0, 1000, True),  # it does not come down
    ],
)
def test_a_search_ends_if_it_would_not_come_near_enough_at_its_pace(after, steps_left, ends):
    course = [[5.0, 10_005.0]] * (PACE - 1) + [[5.0, after + 5.0]]
    shown = ended(course, 400.0, steps_left)
    assert shown[:-1] == [[False, False]] * (PACE - 1)
    assert shown[-1] == [False, ends]


def test_a_search_that_is_at_the_place_of_a_lower_one_ends():
    course = [[5.0, 6.0, 7.0]] * PACE
    assert ended(course, 400.0, 50, [0.5, 0.59, 0.61])[-1] == [False, True, False]


def test_costs_that_are_not_finite_do_not_hide_the_lowest():
    course = [[np.nan, 5.0, 5000.0, np.inf]] * PACE
    assert ended(course, 400.0, 50)[-1][1:3] == [False, True]


def test_ends_are_compared_with_the_lowest_at_their_place():
    minima = places([3.0, 1.0, 2.0, 9.0], [0.0, 0.09, 0.18, 0.5])
    assert are_different(minima, 1.0).tolist() == [False, True, False, True]
    assert are_different(places([3.0, 1.0, 2.0], [0.0, 0.09, 0.2]), 1.0).tolist() == [False, True, True]


def test_the_pace_of_a_group_of_searches_is_not_measured_from_the_group_before():
    race, slow = _Race(400.0), [[5.0, 5.1]] * (PACE - 3)
    raced(race, slow, 3, [0.0, 1.0])
    course = [[5.0, 10_005.0]] * (PACE - 1) + [[5.0, 4005.0]]
    assert raced(race, course, 40) == [[False, False]] * PACE
