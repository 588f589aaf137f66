"""The study of single resonances holds what its page says: of intervals, and of the sizes that are reported."""

from __future__ import annotations

import numpy as np
import pytest
from single_resonances import KINDS, Case, drawn, rows, study


@pytest.mark.parametrize(
    ("cases", "seed"), [(9, 4712), pytest.param(150, 4713, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_intervals_hold_the_truth_and_reported_sizes_are_right(cases, seed):
    studied = study(range(cases), seed, report=lambda _: None)
    held = [flag for case in studied for flag in case.held.values()]
    assert np.mean(held) >= 0.85
    shown_values = [case.right(kind) for case in studied for kind in KINDS if np.isfinite(case.reported[kind])]
    assert np.mean(shown_values) >= 0.9
    assert len(shown_values) >= cases  # the phase of nearly all of them is a number
    for case in studied:
        assert np.isnan(case.reported["natural_frequency"])  # stiffness and damping follow these
        assert np.isnan(case.reported["damping"])


def test_a_case_has_the_errors_that_it_says():
    case = drawn(5, 1)
    assert "mass.masses.0.mass" not in case.truth  # every third is known
    assert case.measured.quantity == case.assembly.description.response.quantity == "receptance"
    model = case.assembly.on(case.measured.frequency).frf(case.truth)
    peak = np.argmax(np.abs(model))
    ratio = case.measured.values[peak] / model[peak]
    assert abs(np.log(np.abs(ratio))) == pytest.approx(case.errors["magnitude"], abs=0.1)
    assert abs(np.angle(ratio)) == pytest.approx(case.errors["phase"], abs=0.1)


def test_a_number_counts_within_a_factor_of_two():
    sizes = dict.fromkeys(KINDS, np.nan)
    case = Case(1, "good", {"k": True}, {"k": 0.1}, sizes | {"phase": 0.2}, sizes | {"phase": 0.11}, 50, 2.0, 1.0)
    assert case.right("phase")
    assert not Case(1, "good", {}, {}, sizes | {"phase": 0.3}, sizes | {"phase": 0.11}, 50, 2.0, 1.0).right("phase")
    assert "| size of phase, as a number | 1 | 1 of 1 (100.0%) | 0.2 |" in list(rows([case]))
