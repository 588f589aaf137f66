"""The study of model errors runs, and its structures are wrong by the size that was asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model_errors import caused, drawn, foreign, judged, row
from wrong_structures import Poles, altered, pole_errors, wrong_structure


@pytest.mark.parametrize(("kind", "wanted"), [("young", 2e-3), ("spring", 1e-2)])
def test_a_structure_is_wrong_by_as_much_as_is_wanted(kind, wanted):
    rng = np.random.default_rng(5)
    assembly, theta = drawn(10, 1, rng)
    truth = wrong_structure(assembly, theta, kind, wanted, rng)
    size, _ = pole_errors(Poles.of(truth, theta), Poles.of(assembly, theta))
    assert abs(size / wanted - 1.0) < 0.12
    assert np.array_equal(truth.frequency, assembly.frequency)


def test_a_delay_turns_the_phase_and_nothing_else():
    rng = np.random.default_rng(5)
    assembly, theta = drawn(10, 1, rng)
    ratio = altered(assembly, theta, "delay", rng).frf(theta) / assembly.frf(theta)
    assert np.allclose(ratio, np.exp(-2j * np.pi * 20e-6 * assembly.frequency))


@pytest.fixture(scope="module")
def case():
    return judged((10, "young", 2e-3), 1, "refined")


def test_a_case_has_a_row(case):
    assert abs(case.known / 2e-3 - 1.0) < 0.12
    assert case.resonances >= 2
    assert row("all", [case]).startswith("| all | 1 |")


@pytest.mark.parametrize("method", ["laplace", pytest.param("posterior", marks=pytest.mark.slow)])
def test_intervals_of_a_case_are_compared_with_the_truth(method):
    assert len(judged((5, "mesh", 0.0), 7601, method).held) == 7


def test_joints_damped_by_another_law_are_judged_by_damping(case):
    case = replace(case, kind="law", known_damping=0.2, left_damping=0.1)
    assert replace(case, reported=1e9, reported_damping=0.06).between
    assert not replace(case, reported=case.known, reported_damping=0.04).between


@pytest.mark.parametrize("number", [3, pytest.param(6, marks=pytest.mark.slow)])
def test_another_structure_does_not_fit(number):
    assert foreign(number, seed=88) == "does not fit"


@pytest.mark.slow
@pytest.mark.parametrize(("number", "size", "seed"), [(2, 3e-3, 612), (0, 5e-2, 871)])
def test_a_mistake_of_units_is_named_where_the_model_errs(number, size, seed):
    named = caused((number, "thousand", size), seed, limit=200.0)
    assert named.words == "all values divided by 1000 (mm and m, or N and kN confused?)"


def test_another_quantity_is_named_of_an_exact_model():
    named = caused((7, "quantity", 0.0), seed=612, limit=200.0)
    assert named.words == "the values read as mobility, not as accelerance"
