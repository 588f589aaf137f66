"""An assembly at other frequencies than the description's, the same or different ones for its responses."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.errors import ParameterError

FIRST, SECOND = np.array([500.0, 1300.0, 6500.0]), np.array([700.0, 1301.0])


@pytest.fixture
def two(assemblies):
    return dovetail.load(assemblies / "bt40_er32_two_points.yaml")


def test_each_response_has_frequencies_of_its_own(two):
    there = two.on(FIRST, SECOND)
    np.testing.assert_array_equal(there.frequency, FIRST)
    for index, (axis, alone) in enumerate(zip((FIRST, SECOND), there.each_response, strict=True)):
        np.testing.assert_array_equal(alone.frequency, axis)
        expected = two.at(index).on(axis).frf()
        np.testing.assert_allclose(alone.frf(), expected, rtol=1e-12)
        np.testing.assert_array_equal(there.at(index).frequency, axis)
        np.testing.assert_allclose(there.at(index).frf(), expected, rtol=1e-12)
        np.testing.assert_array_equal(there.rigid().each_response[index].frequency, axis)
    amplitude = there.accelerance_amplitude()
    expected = [two.on(axis).at(index).accelerance_amplitude() for index, axis in enumerate((FIRST, SECOND))]
    np.testing.assert_allclose(amplitude, np.concatenate(expected), rtol=1e-6)


def test_frfs_on_different_frequencies_make_no_array(two):
    with pytest.raises(ParameterError, match=r"different frequencies(.|\n)*'each_response'"):
        two.on(FIRST, SECOND).frfs()
    with pytest.raises(ParameterError, match="different frequencies"):
        two.on(FIRST, FIRST + 1.0).frfs()
    assert two.on(FIRST, FIRST.copy()).frfs().shape == (2, 3)
    assert two.on(FIRST).frfs().shape == (2, 3)


def test_the_number_of_axes_is_one_or_that_of_the_responses(two, sdof):
    with pytest.raises(ParameterError, match="3 frequency axes were given for 2 responses"):
        two.on(FIRST, FIRST, FIRST)
    with pytest.raises(ParameterError, match=r"2 frequency axes were given for 1 response\."):
        sdof.on(FIRST, FIRST)


def test_the_same_frequencies_are_prepared_once(two):
    assert two.on(two.frequency) is two
    assert two.on(two.frequency.copy(), two.frequency.copy()) is two
    there, other = two.on(FIRST, SECOND), two.on(FIRST)
    assert two.on(FIRST.copy(), SECOND.copy()) is there
    assert two.on(FIRST, FIRST) is other
    assert there.on(FIRST, SECOND) is there
    assert two.on(SECOND) is two.on(SECOND.tolist())
    assert two.on(FIRST, SECOND) is not there  # of three, the last two are kept


def test_the_description_remains_the_same(two):
    there = two.on(FIRST, SECOND)
    assert there.description.text == two.description.text
    assert there.description.fingerprint == two.description.fingerprint
