"""Fits of a model that is wrong: which minimum is found hardly depends on the seed of the searches."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from dovetail.inference.fitting import refine
from dovetail.problem import Problem
from support.end_mill import measured_with_another_tool


def chi_squared_by_seed(case: int, seeds: Iterable[int] = range(3)) -> np.ndarray:
    """Return chi-squared of fits of the machine to a measurement with another tool."""
    problem = Problem.of(*measured_with_another_tool(case))
    return np.array([refine(problem, seed=seed).chi_squared for seed in seeds])


def test_another_seed_finds_the_same_minimum_of_a_wrong_model():
    """Three of these seeds end in a minimum that is 1.6 % higher where ends that fall together are not merged, and two
    where no start evolves."""
    found = chi_squared_by_seed(5, (0, 1, 4, 7))
    assert found.min() > 100.0
    np.testing.assert_allclose(found, found.min(), rtol=0.005)


@pytest.mark.slow
def test_most_seeds_find_the_best_minimum_of_wrong_models():
    found = np.array([chi_squared_by_seed(case) for case in range(10, 30)])
    assert np.mean(found < 1.01 * found.min(axis=1, keepdims=True)) >= 0.8
