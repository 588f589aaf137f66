"""Valid but unusual parts, against formulas of their own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dovetail
from dovetail.synthesis import DampedModes
from dovetail_bench.evaluation.mesh_refinement import finer
from support import unusual_parts
from support.unusual_parts import Dashpots, receptance_of_few_modes

FREQUENCY = {"start": "5 Hz", "stop": "600 Hz", "step": "5 Hz"}


def load(parts: dict[str, Any], joints: dict[str, Any], **response: Any) -> dovetail.Assembly:
    described = {"dovetail": 1, "name": "unusual", "frequency": FREQUENCY, "substructures": parts, "joints": joints}
    return dovetail.load({**described, "response": response}, plugins=[Path(unusual_parts.__file__)])


def spring(one: str, other: str, at: Any = 0, **parameters: Any) -> dict[str, Any]:
    connect = {"a": {"to": one, "at": [at]}, "b": {"to": other, "at": [0]}}
    return {"model": "spring_damper", "direction": "x", "connect": connect, "parameters": parameters}


@pytest.mark.parametrize("damper_at_the_mass", [True, False])
def test_a_damper_in_series_with_a_spring_has_the_poles_of_its_polynomial(damper_at_the_mass):
    """m s^2 + k0 + 1 / (1 / k1 + 1 / (c s)) = 0, whichever of the two is at the mass."""
    first, second = ({"k": 0.0, "c": 1000.0}, {"k": 3e6, "c": 0.0})[:: 1 if damper_at_the_mass else -1]
    assembly = load(
        {
            "mass": {"model": "lumped", "masses": [{"mass": 1.0}]},
            "between": {"model": "lumped", "masses": [{"mass": 0.0}]},
            "base": {"model": "ground"},
        },
        {
            "parallel": spring("mass", "base", k={"range": [1e5, 1e7]}, c=0.0),
            "first": spring("mass", "between", **first),
            "second": spring("between", "base", **second),
        },
        at="mass",
        position=0,
    )
    expected = np.roots([1000.0 / 3e6, 1.0, 1000.0 * (1.0 + 1e6 / 3e6), 1e6])
    theta = assembly.by_joint(np.array([[1e6]]))
    (poles,) = DampedModes(assembly.graph).at(theta, 3)
    np.testing.assert_allclose(poles.values, expected[expected.imag > 0], rtol=1e-9)


def test_the_receptance_of_a_part_has_what_only_dampers_reach():
    frequency = np.array([50.0, 100.0, 200.0])
    omega = 2.0 * np.pi * frequency
    between = 1e6 + 1j * omega / (1.0 / 100.0 + 1.0 / 300.0)
    stiffness = np.array([[[k - w**2, -k], [-k, k - w**2]] for k, w in zip(between, omega, strict=True)])
    expected = np.linalg.inv(stiffness)
    np.testing.assert_allclose(Dashpots().receptance(frequency, [0, 4]), expected, rtol=1e-12)
    np.testing.assert_allclose(Dashpots().receptance(frequency, [0, 2])[:, 0, 0], expected[:, 0, 0], rtol=1e-12)


@pytest.mark.parametrize("first", [160.0, 230.0])
def test_a_part_of_few_modes_may_have_an_unknown_option(first):
    """Its receptance between all eight DOFs has rank three; between the two in use it is of full rank."""
    assembly = load(
        {
            "bar": {"model": "few_modes", "first": {"range": ["150 Hz", "250 Hz"]}},
            "base": {"model": "ground"},
        },
        {"foot": spring("bar", "base", "p0", k={"range": [1e5, 1e7]}, c=50.0)},
        at="bar",
        position="node p3",
        quantity="receptance",
    )
    axis = assembly.frequency
    part = receptance_of_few_modes(axis, [0, 6], first)
    foot = 1.0 / (8e5 + 2j * np.pi * axis * 50.0)
    expected = part[:, 1, 1] - part[:, 1, 0] * part[:, 0, 1] / (part[:, 0, 0] + foot)
    theta = assembly.vector({"foot.k": 8e5, "bar.first": first})
    frf, jacobian = assembly.frf_jacobian(theta)
    np.testing.assert_allclose(frf, expected, rtol=1e-8)
    part = receptance_of_few_modes(axis, [0, 6], first * (1.0 + 1e-6))
    ahead = part[:, 1, 1] - part[:, 1, 0] * part[:, 0, 1] / (part[:, 0, 0] + foot)
    column = [parameter.name for parameter in assembly.parameters].index("bar.first")
    slope = (ahead - expected) / (1e-6 * first)
    assert np.abs(jacobian[:, column] - slope).max() < 1e-4 * np.abs(slope).max()


def test_a_finer_mesh_keeps_which_of_two_nodes_in_one_place_is_meant():
    parts = {"twin": {"model": "twin"}, "base": {"model": "ground"}}
    for node in ("u2", "l2"):
        assembly = load(
            parts,
            {"foot": spring("twin", "base", "l0", k={"range": [1e5, 1e7]}, c=50.0)},
            at="twin",
            position=f"node {node}",
        )
        part = finer(assembly, 2).description
        response = part.response
        assert part.substructures["twin"].nodes[response.node].label == f"{node[0]}4"
        (there,) = part.joints["foot"].connection.attachments[0].nodes
        assert part.substructures["twin"].nodes[there].label == "l0"


def test_a_part_with_unknown_options_may_be_named_with_its_package():
    parts = {
        "bar": {"model": "unusual_parts:few_modes", "first": {"range": ["150 Hz", "250 Hz"]}},
        "base": {"model": "ground"},
    }
    joints = {"foot": spring("bar", "base", "p0", k=1e6, c=50.0)}
    assembly = load(parts, joints, at="bar", position="node p3")
    assert [parameter.name for parameter in assembly.parameters] == ["bar.first"]


@pytest.mark.parametrize(("given", "prior"), [({}, "normal"), ({"k": {"range": [2e5, 2e6]}}, "uniform")])
def test_a_given_range_is_uniform_for_any_prior_of_the_joint(given, prior):
    parts = {"mass": {"model": "lumped", "masses": [{"mass": 1.0}]}, "base": {"model": "ground"}}
    joint = {**spring("mass", "base"), "model": "known_before", "parameters": given}
    del joint["direction"]
    (parameter,) = load(parts, {"foot": joint}, at="mass", position=0).parameters
    assert parameter.prior == prior
