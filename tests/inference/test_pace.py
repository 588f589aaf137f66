"""Searches that fall behind end after ten steps, if they would not come near the lowest one at their pace."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from dovetail.inference.fitting.fit import PACE_STEPS, Pace


def ended(pace, costs, steps_left=20):
    """Return which searches end after each step, given the sums of squares of all of them."""
    return [
        pace(SimpleNamespace(cost=np.array(cost)), steps_left - number).tolist() for number, cost in enumerate(costs)
    ]


@pytest.mark.parametrize(("after", "ends"), [(3_000.0, False), (9_900.0, True)])
def test_a_search_ends_if_it_would_not_reach_the_lowest_with_the_steps_left(after, ends):
    """From 10,000 to 3,000 in ten steps it is at 900 ten steps later; from 10,000 to 9,900 it is still at 9,800."""
    course = [[5.0, 10_005.0]] * (PACE_STEPS - 1) + [[5.0, after + 5.0]]
    shown = ended(Pace(lambda lowest: lowest + 1_500.0), course)
    assert shown[:-1] == [[False, False]] * (PACE_STEPS - 1)
    assert shown[-1] == [False, ends]


def test_the_lowest_search_never_ends_however_slow_it_is():
    course = [[100.0, 200.0]] * (2 * PACE_STEPS)
    assert not any(first for first, _ in ended(Pace(lambda lowest: lowest), course))


def test_a_new_group_of_searches_has_its_own_pace():
    pace = Pace(lambda lowest: lowest + 1.0)
    ended(pace, [[5.0, 5.1]] * (PACE_STEPS - 1))
    assert ended(pace, [[5.0, 10_005.0]] * (PACE_STEPS - 1), steps_left=40) == [[False, False]] * (PACE_STEPS - 1)
