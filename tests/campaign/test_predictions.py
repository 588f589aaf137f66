"""The campaign end to end: joints identified on H0-J-T0 alone predict what was never measured with them."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
import dovetail_machining
from dovetail.measurement import on_grid
from dovetail_bench import read_cases, validate


def validated(campaign, file):
    cases = read_cases(campaign / "cases" / f"{file}.yaml")
    return validate(cases, dovetail.identify).cases


def all_errors(cases):
    rows = [row for one in cases for row in one.peaks]
    assert all(None not in (row.measured, row.compensated, row.predicted) for row in rows)
    return np.array([row.error for row in rows])


def test_the_models_of_the_parts_hold(campaign):
    errors = all_errors(validated(campaign, "parts"))
    assert errors.size == 6
    assert np.abs(errors).max() < 0.2


@pytest.mark.slow
def test_novel_tools_are_predicted_within_one_per_cent(campaign):
    cases = validated(campaign, "novel_tools")
    assert [len(one.peaks) for one in cases] == [2, 3, 4]
    assert np.abs(all_errors(cases)).max() < 1.0
    assert min(one.mean_coherence for one in cases) > 0.999


@pytest.mark.slow
def test_tool_modes_on_the_spindle_are_predicted_within_one_per_cent(campaign):
    cases = validated(campaign, "on_spindle")
    assert [len(one.peaks) for one in cases] == [6, 7, 8]
    assert np.abs(all_errors(cases)).max() < 1.0


@pytest.mark.slow
def test_the_series_is_reconstructed_within_a_tenth_of_a_per_cent(campaign):
    cases = validated(campaign, "torques")
    assert [len(one.peaks) for one in cases] == [3] * 5
    assert np.abs(all_errors(cases)).max() < 0.1
    assert min(one.mean_coherence for one in cases) > 0.999


def test_the_shipped_flange_is_what_the_three_tests_give(campaign):
    holder = dovetail.load(campaign / "h1.yaml")
    tests = tuple(
        on_grid(dovetail.read_frf(campaign / "measurements" / f"sf_h1_{name}.uff"), holder.frequency)
        for name in ("aa", "ab", "bb")
    )
    made = dovetail_machining.spindle_flange(holder, tests, (0.0, 0.02), 0.072, accelerometer_mass=1.2e-3)
    shipped = dovetail.read_receptance(campaign / "measurements" / "spindle_flange.npz")
    np.testing.assert_allclose(made.values, shipped.values, rtol=1e-6)
    assert "SYNTHETIC" in shipped.note
