"""The frequencies at which a user asks for an assembly."""

import numpy as np
import pytest

import dovetail
from dovetail.errors import ParameterError


@pytest.mark.parametrize(
    ("axis", "message"),
    [
        ([3.0, 2.0, 4.0], "line 2 is 2 Hz, after 3 Hz"),
        ([1.0, 1.0, 2.0], "line 2 is 1 Hz, after 1 Hz"),
        ([-1.0, 2.0], "line 1 is -1 Hz"),
        ([0.0, 2.0], "line 1 is 0 Hz"),
        ([1.0, np.nan, 2.0], "line 2 is nan Hz"),
        ([1.0, np.inf], "line 2 is inf Hz"),
        ([[1.0, 2.0]], r"its shape is \(1, 2\)"),
        (5.0, r"its shape is \(\)"),
    ],
)
def test_frequencies_that_do_not_increase_from_above_zero_are_refused(assemblies, axis, message):
    with pytest.raises(ParameterError, match=message):
        dovetail.load(assemblies / "sdof.yaml").on(np.array(axis))
