"""Stiff springs next to soft ones, and fine meshes at low frequencies: right digits, or a word that they are lost."""

from __future__ import annotations

import copy
from contextlib import nullcontext
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.assembly import find_warnings
from dovetail.synthesis.pivoting import _solve_refined

FREQUENCIES = np.array([0.1, 1.0, 30.0, 112.0, 500.0, 1e4])
C = 100.0


def description(masses: int) -> dict[str, Any]:
    """Masses of 1 kg in a row, the last one on the ground; force and response at the first."""
    spring = {"model": "spring_damper", "direction": "x"}
    unknown = {"k": {"range": [1.0, 1e23], "scale": "log"}, "c": {"range": [0.0, 1e6], "scale": "linear"}}
    names = [*(f"m{i}" for i in range(masses)), "base"]
    parts: dict[str, Any] = {name: {"model": "lumped", "masses": [{"mass": 1.0}]} for name in names[:-1]}
    return {
        "dovetail": 1,
        "name": "row",
        "frequency": {"start": 1.0, "stop": 2.0, "lines": 2},
        "substructures": {**parts, "base": {"model": "ground"}},
        "joints": {
            f"j{i}": {
                **spring,
                "connect": {"a": {"to": names[i], "at": 0.0}, "b": {"to": names[i + 1], "at": 0.0}},
                "parameters": copy.deepcopy(unknown),
            }
            for i in range(masses)
        },
        "response": {"at": "m0", "position": 0.0, "quantity": "receptance"},
    }


class Exact:
    """A complex number of fractions."""

    def __init__(self, real: Any, imaginary: Any = 0) -> None:
        self.real, self.imaginary = Fraction(real), Fraction(imaginary)

    def __add__(self, other: Exact) -> Exact:
        return Exact(self.real + other.real, self.imaginary + other.imaginary)

    def __mul__(self, other: Exact) -> Exact:
        return Exact(
            self.real * other.real - self.imaginary * other.imaginary,
            self.real * other.imaginary + self.imaginary * other.real,
        )

    def inverse(self) -> Exact:
        square = self.real**2 + self.imaginary**2
        return Exact(self.real / square, -self.imaginary / square)

    def __complex__(self) -> complex:
        return complex(float(self.real), float(self.imaginary))


def exact(springs: list[float], dampers: list[float], frequency: float) -> tuple[complex, list[complex]]:
    """Receptance and derivatives by the springs, by adding mass after mass from the ground, in fractions.

    Z of what follows a mass, in series with its spring z, is z Z / (z + Z); the force in each spring follows forwards.
    """
    omega = 2.0 * np.pi * frequency
    inertia = Exact(-(Fraction(omega) ** 2))
    z = [Exact(k, Fraction(omega) * Fraction(c)) for k, c in zip(springs, dampers, strict=True)]
    behind = [z[-1]]  # stiffness that each mass feels from behind
    for own in reversed(z[:-1]):
        whole = behind[0] + inertia
        behind.insert(0, own * whole * (own + whole).inverse())
    motion = (behind[0] + inertia).inverse()
    receptance, derivatives = motion, []
    for own, stiffness in zip(z, behind, strict=True):
        force = stiffness * motion
        stretched = force * own.inverse()
        derivatives.append(complex(Exact(-1) * stretched * stretched))
        motion = motion + Exact(-1) * stretched
    return complex(receptance), derivatives


STIFF = 10.0 ** np.arange(10, 23)


@pytest.mark.sweep(keep=3)
@pytest.mark.parametrize("masses", [1, 2, 4])
@pytest.mark.parametrize("soft", [1e3, 1e6])
def test_springs_up_to_1e22_leave_the_frf_and_its_derivatives_right(masses, soft):
    """13 stiffnesses in each place at 6 frequencies; derivatives relative to the FRF over the parameter at least."""
    assembly = dovetail.load(description(masses)).on(FREQUENCIES)
    for place in range(masses):
        for stiff in STIFF:
            springs = [soft * (1 + i) for i in range(masses)]
            springs[place] = float(stiff)
            theta = np.ravel([[k, C] for k in springs])
            frf, jacobian = assembly.frf_jacobian(theta)
            again, receptance = assembly.frf(theta), assembly.receptance(theta, [("m0", 0, "x")], [("m0", 0, "x")])
            for line, frequency in enumerate(FREQUENCIES):
                value, slopes = exact(springs, [C] * masses, frequency)
                for computed in (frf[line], again[line], receptance[line, 0, 0]):
                    assert abs(computed - value) <= 1e-6 * abs(value)
                size = np.maximum(np.abs(slopes), abs(value) / np.array(springs))
                assert (np.abs(jacobian[line, ::2] - slopes) <= 1e-6 * size).all()


@pytest.mark.parametrize("stiff", STIFF)
def test_masses_that_a_stiff_spring_makes_one_have_their_common_resonance(stiff):
    assembly = dovetail.load(description(2))
    theta = [stiff, 0.0, 1e6, 0.0]
    common = np.sqrt(1e6 / 2.0) / (2.0 * np.pi)
    mode, *_ = assembly.modes(theta)
    expected = common * (1.0 - 1e6 / stiff / 8.0)
    assert mode.natural_frequency == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("stiff", [1e16, 1e18, 1e20, 1e22])
def test_beams_that_a_stiff_layer_joins_move_as_one_beam(stiff):
    material = {"young": 2e11, "density": 7800.0, "loss_factor": 0.01}
    beam = {"model": "timoshenko_beam", "material": material}
    layer = {"k": {"value": stiff}, "c": {"value": 0.0}, "kr": {"value": stiff}, "cr": {"value": 0.0}}
    halves = {
        "dovetail": 1,
        "name": "halves",
        "frequency": {"start": 20.0, "stop": 2000.0, "lines": 40},
        "substructures": {
            "one": {**beam, "sections": [{"length": 0.2, "outer": 0.02, "elements": 4}]},
            "other": {**beam, "sections": [{"length": 0.2, "outer": 0.02, "elements": 4}]},
        },
        "joints": {
            "layer": {
                "model": "spring_damper",
                "connect": {"a": {"to": "one", "at": 0.2}, "b": {"to": "other", "at": 0.0}},
                "parameters": layer,
            }
        },
        "response": {"at": "one", "position": 0.0, "quantity": "receptance"},
    }
    whole = copy.deepcopy(halves)
    whole["joints"]["layer"] = {"model": "rigid", "connect": halves["joints"]["layer"]["connect"]}
    joined, rigid = dovetail.load(halves), dovetail.load(whole)
    np.testing.assert_allclose(joined.frf(), rigid.frf(), rtol=1e-6)
    np.testing.assert_allclose(joined.natural_frequencies(count=3), rigid.natural_frequencies(count=3), rtol=1e-6)


@pytest.mark.parametrize(
    ("elements", "start", "lines", "lost"),
    [(10, 1.0, 5, False), (100, 1.0, 5, False), (500, 0.1, 5, True), (500, 0.1, 20_000, True)],
)
def test_a_mesh_too_fine_for_the_first_frequency_is_reported(elements, start, lines, lost):
    material = {"young": 2.1e11, "density": 7850.0, "poisson": 0.3}
    section = {"length": 1.0, "outer": 0.02, "elements": elements}
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "beam",
            "frequency": {"start": start, "stop": 1e4, "lines": lines},
            "substructures": {"beam": {"model": "timoshenko_beam", "material": material, "sections": [section]}},
            "response": {"at": "beam", "position": 0.0, "quantity": "receptance"},
        }
    )
    said = [warning for warning in find_warnings(assembly) if "rounding in its matrices changes the FRF" in warning]
    assert bool(said) is lost


@pytest.mark.parametrize(("softest", "singular"), [(0.0, True), (1e-17, True), (1e-12, False), (1e-6, False)])
def test_a_system_of_which_a_pivot_is_only_rounding_is_refused(softest, singular):
    """LAPACK divides by what rounding leaves of it."""
    random = np.random.default_rng(3)
    shapes, _ = np.linalg.qr(random.standard_normal((6, 6)))
    Z = (shapes * np.array([1.0, 2.0, 3.0, 4.0, 5.0, softest])) @ shapes.T + 0j
    with pytest.raises(np.linalg.LinAlgError) if singular else nullcontext():
        solution = _solve_refined(Z[np.newaxis], np.eye(6))
        np.testing.assert_allclose(Z @ solution[0], np.eye(6), atol=1e-2)
