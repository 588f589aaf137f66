"""The DOFs that a pattern connects with some others, against SciPy's sparse graphs."""

from __future__ import annotations

import numpy as np
import pytest
import scipy

from dovetail.synthesis.graph import connected_with


def by_scipy(some, pattern):
    _, group = scipy.sparse.csgraph.connected_components(pattern, directed=False)
    return np.isin(group, group[some])


@pytest.mark.parametrize("form", [np.asarray, scipy.sparse.csr_array])
@pytest.mark.parametrize("seed", range(10))
def test_random_patterns_connect_what_scipy_says(form, seed):
    random = np.random.default_rng(seed)
    half = random.random((40, 40)) < random.choice([0.005, 0.02, 0.1])
    some, pattern = random.random(40) < 0.1, half | half.T
    np.testing.assert_array_equal(connected_with(some, form(pattern)), by_scipy(some, pattern))


def test_a_long_chain_is_followed_to_its_ends_and_no_further():
    pattern = np.eye(500, k=1, dtype=np.bool_) | np.eye(500, k=-1, dtype=np.bool_)
    pattern[399, 400] = pattern[400, 399] = False
    connected = connected_with(np.arange(500) == 200, pattern)
    np.testing.assert_array_equal(connected, np.arange(500) < 400)


def test_nothing_is_connected_with_nothing():
    assert not connected_with(np.zeros(3, dtype=np.bool_), np.ones((3, 3), dtype=np.bool_)).any()
