"""The Timoshenko beam against the exact solution of its differential equation."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import dovetail
from dovetail_plugins.timoshenko import Remembered

YOUNG, DENSITY, POISSON, LENGTH = 210e9, 7800.0, 0.3, 0.3


def beam_description(outer: float, inner: float, elements: int, *, clamped: bool = False) -> dict:
    beam = {
        "model": "timoshenko_beam",
        "material": {"young": YOUNG, "density": DENSITY, "poisson": POISSON},
        "sections": [{"length": LENGTH, "outer": outer, "inner": inner, "elements": elements}],
    }
    parts: dict = {"beam": beam}
    joints = {}
    if clamped:
        parts["wall"] = {"model": "ground"}
        joints["clamp"] = {"model": "rigid", "connect": {"a": {"to": "beam", "at": 0}, "b": {"to": "wall", "at": 0}}}
    return {
        "dovetail": 1,
        "name": "beam",
        "frequency": {"start": 10, "stop": 20, "step": 5},
        "substructures": parts,
        "joints": joints,
        "response": {"at": "beam", "position": LENGTH},
    }


def transfer_matrix(frequency: float, outer: float, inner: float) -> np.ndarray:
    """State (x, rz, M, V) from one end of a round beam to the other, exactly."""
    m2 = (inner / outer) ** 2
    kappa = 6 * (1 + POISSON) * (1 + m2) ** 2 / ((7 + 6 * POISSON) * (1 + m2) ** 2 + (20 + 12 * POISSON) * m2)
    return propagation(frequency, np.pi / 4 * (outer**2 - inner**2), np.pi / 64 * (outer**4 - inner**4), kappa)


def propagation(frequency: float, area: float, inertia: float, kappa: float) -> np.ndarray:
    omega2 = (2 * np.pi * frequency) ** 2
    shear = kappa * YOUNG / (2 * (1 + POISSON)) * area
    slope = np.array(
        [
            [0, 1, 0, 1 / shear],
            [0, 0, 1 / (YOUNG * inertia), 0],
            [0, -DENSITY * inertia * omega2, 0, -1],
            [-DENSITY * area * omega2, 0, 0, 0],
        ]
    )
    scale = np.diag([1.0, 1 / LENGTH, YOUNG * inertia / LENGTH**2, YOUNG * inertia / LENGTH**3])
    return np.linalg.inv(scale) @ expm(slope * LENGTH) @ scale


def exact_frequency(near: float, free: Callable[[np.ndarray], np.ndarray], outer: float, inner: float) -> float:
    def condition(frequency: float) -> float:
        return float(np.linalg.det(free(transfer_matrix(frequency, outer, inner))))

    return float(brentq(condition, 0.97 * near, 1.03 * near, xtol=1e-10, rtol=1e-14))


def errors_of(counts: list[int], outer: float, inner: float, clamped: bool, mode: int) -> np.ndarray:
    """Relative errors of one natural frequency against the exact one, for several numbers of elements."""
    columns = slice(2, 4) if clamped else slice(0, 2)
    found = [
        dovetail.load(beam_description(outer, inner, count, clamped=clamped)).natural_frequencies(count=3)[mode]
        for count in counts
    ]
    return np.array(found) / exact_frequency(found[-1], lambda T: T[2:4, columns], outer, inner) - 1


@pytest.mark.parametrize(("outer", "inner"), [(0.03, 0.0), (0.04, 0.025)], ids=["solid", "hollow"])
@pytest.mark.parametrize("clamped", [False, True], ids=["free", "clamped"])
@pytest.mark.parametrize("mode", [0, 1, 2])
def test_a_stocky_beam_converges_with_the_square_of_the_element_length(outer, inner, clamped, mode):
    """The element's shear force is constant where the exact one is not: an energy error of second order."""
    errors = errors_of([16, 32, 64], outer, inner, clamped, mode)
    assert 0 < errors[-1] < 6e-4
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2, atol=0.05)


@pytest.mark.parametrize("clamped", [False, True], ids=["free", "clamped"])
def test_a_slender_beam_converges_with_the_fourth_power(clamped):
    """Where bending rules, the cubic displacement gives the fourth order of an Euler-Bernoulli element."""
    errors = errors_of([8, 16, 32], 0.001, 0.0, clamped, 0)
    assert 0 < errors[-1] < 1e-6
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 4, atol=0.25)


@pytest.mark.parametrize(("part", "expected", "loss"), [("tool", 5515.39, 0.005), ("holder", 9881.66, 0.003)])
def test_first_free_free_bending_of_the_reference_parts(collet, part, expected, loss):
    """With the stiffness E (1 + i loss), the pole is that without damping times the square root of 1 + i loss."""
    description = {
        **beam_description(0.01, 0, 1),
        "substructures": {part: json.loads(collet.description.text)["substructures"][part]},
        "response": {"at": part, "position": 0},
    }
    (mode,) = dovetail.load(description).modes(count=1)
    assert mode.natural_frequency == pytest.approx(expected * (1 + loss**2) ** 0.25, abs=0.005)
    assert mode.damping_ratio == pytest.approx(loss / 2, rel=1e-4)


def test_a_tapered_section_takes_the_diameters_at_the_middle_of_its_elements():
    whole = beam_description(0.04, 0.0, 4)
    whole["substructures"]["beam"]["sections"] = [{"length": 0.3, "outer": 0.04, "outer_end": 0.02, "elements": 4}]
    steps = beam_description(0.04, 0.0, 4)
    steps["substructures"]["beam"]["sections"] = [
        {"length": 0.075, "outer": outer} for outer in (0.0375, 0.0325, 0.0275, 0.0225)
    ]
    np.testing.assert_allclose(
        dovetail.load(whole).natural_frequencies(), dovetail.load(steps).natural_frequencies(), rtol=1e-12
    )


@pytest.mark.parametrize(("width", "height"), [(0.05, 0.02), (0.02, 0.05)], ids=["flat", "upright"])
@pytest.mark.parametrize("mode", [0, 1])
def test_a_rectangular_beam_bends_along_its_height(width, height, mode):
    description = beam_description(0.01, 0.0, 1)
    section = {"length": LENGTH, "width": width, "height": height, "elements": 200}
    description["substructures"]["beam"]["sections"] = [section]
    found = dovetail.load(description).natural_frequencies(count=2)[mode]
    kappa = 10 * (1 + POISSON) / (12 + 11 * POISSON)

    def ends(frequency: float) -> float:
        T = propagation(frequency, width * height, width * height**3 / 12, kappa)
        return float(np.linalg.det(T[2:4, 0:2]))

    assert found == pytest.approx(brentq(ends, 0.97 * found, 1.03 * found, xtol=1e-9), rel=1e-4)


def test_rigid_body_motion_costs_nothing_and_carries_the_whole_mass():
    beam = dovetail.load(beam_description(0.04, 0.025, 5)).description.substructures["beam"]
    matrices, positions = beam.matrices(), np.array([node.position for node in beam.nodes])
    shift, turn = np.tile([1.0, 0.0], 6), np.column_stack([positions, np.ones(6)]).ravel()
    mass = DENSITY * np.pi / 4 * (0.04**2 - 0.025**2) * LENGTH
    rotary = DENSITY * np.pi / 64 * (0.04**4 - 0.025**4) * LENGTH
    scale = np.abs(matrices.K).max()
    assert np.abs(matrices.K @ shift).max() < 1e-12 * scale
    assert np.abs(matrices.K @ turn).max() < 1e-12 * scale
    assert shift @ matrices.M @ shift == pytest.approx(mass, rel=1e-12)
    assert turn @ matrices.M @ turn == pytest.approx(mass * LENGTH**2 / 3 + rotary, rel=1e-12)


def test_the_latest_value_is_kept_for_the_same_points_only():
    asked = []

    def squares(points):
        asked.append(len(points))
        return points**2

    remembered, points = Remembered(squares), np.array([[1.0, 2.0], [3.0, 4.0]])
    assert remembered(points) is remembered(points.copy())
    assert asked == [2]
    np.testing.assert_array_equal(remembered(points[:1]), [[1.0, 4.0]])
    np.testing.assert_array_equal(remembered(points.reshape(1, 4)), [[1.0, 4.0, 9.0, 16.0]])
    points[0, 0] = 5.0
    np.testing.assert_array_equal(remembered(points), [[25.0, 4.0], [9.0, 16.0]])
