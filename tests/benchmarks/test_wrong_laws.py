"""A small version of the study of wrong laws, and of how it decides which of them can be noticed."""

import numpy as np
import pytest
import wrong_laws


def test_the_nearest_straight_line_is_at_no_distance_from_a_straight_line():
    k = np.exp(np.linspace(np.log(6e5), np.log(1.5e6), len(wrong_laws.LEVELS)))
    exact = np.stack([k, np.full(len(k), 50.0)], axis=1)
    bent = exact * [[1.0, 1.0], [1.05, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0]]
    assert wrong_laws.distance_from_lines(exact, 0.01) == pytest.approx(0.0, abs=1e-6)
    assert wrong_laws.distance_from_lines(bent, 0.01) > 1000.0 * wrong_laws.distance_from_lines(bent, 1.0) > 0.0


def test_a_straight_line_is_noticed_where_the_stiffness_saturates():
    wrong = wrong_laws.case("exponential_approach", 0, seed=10)
    right = wrong_laws.case("linear", 0, seed=10)
    assert wrong.probability > wrong_laws.CERTAIN
    assert wrong.noticed
    assert not right.noticed
    assert wrong.preferred(samples=40, seed=0) == "exponential_approach"
