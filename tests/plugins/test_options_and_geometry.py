"""The meaning of the options of parts and joints: nodes, DOFs, meshes; and their limits."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from dovetail.interfaces import KINDS
from dovetail.registry import components

STEEL = {"young": 200e9, "density": 8000.0, "poisson": 0.25, "loss_factor": 0.01}


def component(kind, model, **options):
    made = components().find(kind, model).component
    return made(made.Config(**options))


def beam(*sections):
    return component("substructure", "timoshenko_beam", material=STEEL, sections=sections)


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in KINDS for name in components().names(kind)])
def test_every_example_that_a_component_offers_can_be_built(kind, name, tmp_path):
    model = components().find(kind, name).component
    made = [model(model.Config(**options)) for options in model.examples(tmp_path)]
    assert made
    for example in made:
        if kind == "joint":
            theta = np.array([[0.5 * (p.lower + p.upper) for p in example.parameters]])
            matrices = example.matrices(theta)
            assert matrices.K.shape == (1, example.size, example.size)
            assert (np.diagonal(matrices.K[0]) >= 0).all()
        if kind == "substructure":
            assert len(example.nodes) >= 1


def test_the_nodes_of_a_beam_are_the_ends_of_its_elements():
    stepped = beam({"length": 0.06, "outer": 0.04, "elements": 3}, {"length": 0.05, "outer": 0.02, "elements": 2})
    assert [node.label for node in stepped.nodes] == ["n1", "n2", "n3", "n4", "n5", "n6"]
    np.testing.assert_allclose([node.position for node in stepped.nodes], [0, 0.02, 0.04, 0.06, 0.085, 0.11])
    fine = stepped.refined(2)
    assert [section.elements for section in fine.config.sections] == [6, 4]
    np.testing.assert_allclose([node.position for node in fine.nodes][::2], [node.position for node in stepped.nodes])
    assert [section.elements for section in stepped.config.sections] == [3, 2]


def test_sections_stand_one_behind_the_other():
    """The matrices of a stepped beam are those of its two elements, with the node between them in common."""
    first, second = {"length": 0.03, "outer": 0.04}, {"length": 0.02, "width": 0.01, "height": 0.03}
    whole = beam(first, second).matrices()
    for name in "MKD":
        joined = np.zeros((6, 6))
        joined[:4, :4] += getattr(beam(first).matrices(), name)
        joined[2:, 2:] += getattr(beam(second).matrices(), name)
        np.testing.assert_allclose(getattr(whole, name), joined, rtol=1e-14)
    np.testing.assert_allclose(whole.D, 0.01 * whole.K, rtol=1e-14)
    assert not whole.C.any()


def test_a_taper_of_both_diameters_equals_the_steps_calculated_by_hand():
    """Two elements: a quarter and three quarters of the way from 40 and 20 mm to 32 and 8 mm."""
    tapered = beam({"length": 0.1, "outer": 0.04, "outer_end": 0.032, "inner": 0.02, "inner_end": 0.008, "elements": 2})
    steps = beam({"length": 0.05, "outer": 0.038, "inner": 0.017}, {"length": 0.05, "outer": 0.034, "inner": 0.011})
    np.testing.assert_allclose(tapered.matrices().K, steps.matrices().K, rtol=1e-12)
    np.testing.assert_allclose(tapered.matrices().M, steps.matrices().M, rtol=1e-12)
    opening = beam({"length": 0.1, "outer": 0.04, "inner_end": 0.02, "elements": 1})
    np.testing.assert_allclose(
        opening.matrices().M, beam({"length": 0.1, "outer": 0.04, "inner": 0.01}).matrices().M, rtol=1e-12
    )


@pytest.mark.parametrize(
    ("section", "fault"),
    [
        ({"outer": 0.02, "inner": 0.02}, "the inner diameter must be smaller"),
        ({"outer": 0.02, "inner": 0.01, "outer_end": 0.01}, "the inner diameter must be smaller"),
        ({"outer": 0.02, "inner_end": 0.02}, "the inner diameter must be smaller"),
        ({"outer": 0.02, "width": 0.02, "height": 0.02}, "a section is either round"),
        ({}, "a section is either round"),
        ({"width": 0.02}, "a rectangular section has a width and a height"),
        ({"outer": 0.02, "height": 0.02}, "a rectangular section has a width and a height"),
        ({"width": 0.02, "height": 0.02, "inner": 0.01}, "a rectangular section has no diameters"),
        ({"width": 0.02, "height": 0.02, "outer_end": 0.01}, "a rectangular section has no diameters"),
        ({"width": 0.02, "height": 0.02, "inner_end": 0.0}, "a rectangular section has no diameters"),
    ],
)
def test_an_impossible_section_is_refused(section, fault):
    with pytest.raises(ValidationError, match=fault):
        beam({"length": 0.1, **section})


def test_masses_and_points_of_the_ground_have_a_node_each():
    lumped = component("substructure", "lumped", masses=[{"mass": 1.0}, {"mass": 2.0, "position": 0.1}])
    ground = component("substructure", "ground", positions=[0.0, 0.25])
    assert [(node.label, node.position) for node in lumped.nodes] == [("m1", 0.0), ("m2", 0.1)]
    assert [(node.label, node.position) for node in ground.nodes] == [("g1", 0.0), ("g2", 0.25)]
    assert not lumped.matrices().K.any()
    assert ground.matrices().K.shape == (12, 12)
    assert not ground.matrices().K.any()
    with pytest.raises(ValidationError, match="two masses have the same position"):
        component("substructure", "lumped", masses=[{"mass": 1.0}, {"mass": 2.0}])


@pytest.mark.parametrize(
    ("direction", "pairs"),
    [("x", ((0, 4), (2, 6))), ("rz", ((1, 5), (3, 7))), ("both", ((0, 4), (1, 5), (2, 6), (3, 7)))],
)
def test_facing_nodes_share_or_connect_their_dofs(direction, pairs):
    rigid = component("joint", "rigid", nodes=2, direction=direction)
    assert set(rigid.merged_dofs) == set(pairs)
    layer = component("joint", "spring_damper", nodes=2, direction=direction)
    assert set(layer.contact_dofs) == set(pairs)
    for joint in (rigid, layer):
        assert [(port.name, port.nodes) for port in joint.ports] == [("a", 2), ("b", 2)]
    assert rigid.matrices(np.empty((3, 0))).K.shape == (3, 8, 8)
    assert not rigid.matrices(np.empty((3, 0))).K.any()
    names = {"x": ["k", "c"], "rz": ["kr", "cr"], "both": ["k", "c", "kr", "cr"]}[direction]
    assert [parameter.name for parameter in layer.parameters] == names


@pytest.mark.parametrize(("elements", "internal", "first_holder"), [(1, 10, 16), (3, 26, 24)])
def test_the_nodes_of_the_collet(elements, internal, first_holder):
    """Its DOFs follow the six of the tool and the six of the holder; the holder's first node meets its middle node."""
    collet = component("joint", "collet", material=STEEL, elements_per_segment=elements)
    assert collet.internal_dofs == internal
    assert collet.size == 12 + internal
    step = 2 * elements
    tool = tuple((2 * node + axis, 12 + step * node + axis) for node in range(3) for axis in (0, 1))
    holder = tuple((6 + 2 * node + axis, first_holder + step * node + axis) for node in range(3) for axis in (0, 1))
    assert collet.contact_dofs == tool + holder
    finer = collet.refined(2)
    assert finer.config.elements_per_segment == 2 * elements
    assert finer.config.segment == collet.config.segment


def test_a_finer_collet_is_the_same_collet():
    """A unit of length in a rigid shift, and the static stiffness between its ends, do not depend on the mesh."""
    theta = np.array([[0.033, 0.013, 0.08, 0.07, 6e8, 2e4, 0.0, 0.0, 1e9, 4e5, 0.0, 0.0]])
    masses, stiffness = [], []
    for elements in (1, 4):
        made = component("joint", "collet", material=STEEL, segment=0.008, elements_per_segment=elements)
        matrices = made.matrices(theta)
        shift = np.zeros(made.size)
        shift[12::2] = 1.0
        masses.append(shift @ matrices.M[0] @ shift)
        K, inner = matrices.K[0], np.arange(12, made.size)
        condensed = K[:12, :12] - K[:12, inner] @ np.linalg.solve(K[np.ix_(inner, inner)], K[inner, :12])
        stiffness.append(condensed)
    beam_mass = 8000.0 * np.pi / 4 * (0.033**2 - 0.013**2) * 4 * 0.008
    np.testing.assert_allclose(masses, beam_mass + 0.15, rtol=1e-12)
    np.testing.assert_allclose(stiffness[0], stiffness[1], rtol=1e-6, atol=1e-6 * np.abs(stiffness[0]).max())


@pytest.mark.parametrize(("widest", "objects"), [(0.0259, False), (0.026, True), (0.03, True)])
def test_the_hole_of_the_collet_is_narrower_than_the_collet(widest, objects):
    collet = component("joint", "collet", material=STEEL)
    lower = {parameter.name: parameter.lower for parameter in collet.parameters}
    upper = {parameter.name: parameter.upper for parameter in collet.parameters} | {"dc": widest}
    objections = collet.range_objections(lower, upper)
    assert ("dc" in objections) == objects
    if objects:
        assert f"may be {widest * 1e3:g} mm where the outer diameter Dc is 26 mm" in objections["dc"]


def test_parameters_that_only_some_options_have():
    assert [p.name for p in component("joint", "bolted").parameters] == ["kt", "kr", "ct", "cr"]
    assert [p.name for p in component("joint", "bolted", bolt_mass=True).parameters][4:] == ["mb"]
    uniform = component("joint", "interference_fit", length=0.04)
    linear = component("joint", "interference_fit", length=0.04, pressure="linear", nodes=5)
    assert [p.name for p in uniform.parameters] == ["k", "kr", "c", "cr"]
    assert [p.name for p in linear.parameters] == ["k", "kr", "c", "cr", "g"]
    assert [(port.name, port.nodes) for port in linear.ports] == [("shaft", 5), ("hub", 5)]
    assert [(port.name, port.nodes) for port in component("joint", "bolted", nodes=4).ports] == [("a", 4), ("b", 4)]
