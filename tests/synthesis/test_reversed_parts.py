"""A part that is described from its other end and reversed on purpose gives the FRFs of the part described forwards.

Forwards or backwards, the structure is the same, so that the engine has to agree with itself; the direct and the
literal solve of the backwards one agree with it too. `test_random_assemblies` compares reversed parts of all models
with a dense solve that mirrors them by hand.
"""

from __future__ import annotations

import copy
import json
from dataclasses import replace

import numpy as np
import pytest

import dovetail
from dovetail.report.drawing import assembly_figure, mode_shapes
from dovetail.synthesis.reference import LiteralSynthesis, direct_receptance

SAME = 1e-9
"""Largest relative difference of two FRFs of one structure."""
LENGTH = 150
"""Of the part that is described both ways [mm]."""
MATERIAL = {"young": "206 GPa", "density": "7850 kg/m^3", "poisson": 0.3, "loss_factor": 0.003}
LEFT = [
    {"length": "90 mm", "width": "40 mm", "height": "8 mm", "elements": 18},
    {"length": "60 mm", "outer": "30 mm", "elements": 12},
]
RIGHT = [
    {"length": "40 mm", "outer": "32 mm", "inner": "20 mm", "elements": 8},
    {"length": "60 mm", "outer": "28 mm", "outer_end": "18 mm", "elements": 12},
    {"length": "50 mm", "width": "40 mm", "height": "12 mm", "elements": 10},
]
JOINTS = {
    "bolted": ({"model": "bolted", "nodes": 5, "bolt_mass": True}, ("a", "b"), (0, 10, 20, 30, 40)),
    "collet": ({"model": "collet", "material": MATERIAL}, ("tool", "holder"), (0, 10, 20)),
    "interference_fit": (
        {"model": "interference_fit", "length": "40 mm", "nodes": 3, "pressure": "linear"},
        ("shaft", "hub"),
        (0, 20, 40),
    ),
    "spring_damper": ({"model": "spring_damper", "nodes": 2}, ("a", "b"), (0, 30)),
    "rigid": ({"model": "rigid"}, ("a", "b"), (0,)),
    "bearing": ({"model": "bearing"}, ("shaft", "housing"), (0,)),
    "hinge": ({"model": "rigid", "direction": "x"}, ("a", "b"), (0,)),
}


def bar(sections):
    return {"model": "timoshenko_beam", "material": MATERIAL, "sections": copy.deepcopy(sections)}


def turned(part):
    """The same bar from its other end: sections in the other order, tapers the other way."""
    sections = copy.deepcopy(part["sections"])[::-1]
    for section in sections:
        if "outer_end" in section:
            section["outer"], section["outer_end"] = section["outer_end"], section["outer"]
    return {**part, "sections": sections, "reversed": True}


def assembly(joint, backwards=(), parts=None, **others):
    """Two bars and a joint; the positions of a part that is described backwards are counted from its other end."""
    section, ports, distances = JOINTS[joint]
    parts = parts or {"left": bar(LEFT), "right": bar(RIGHT)}
    at = {"left": [LENGTH - distances[-1] + place for place in distances], "right": list(distances)}
    response = {"at": "left", "position": 0, "force": {"at": "right", "position": LENGTH}}
    for name in backwards:
        parts[name] = turned(parts[name])
        at[name] = [LENGTH - place for place in at[name]]
    response["position"] = f"{LENGTH if 'left' in backwards else 0} mm"
    response["force"]["position"] = f"{0 if 'right' in backwards else LENGTH} mm"
    connect = {
        port: {"to": name, "at": [f"{place} mm" for place in at[name]]}
        for port, name in zip(ports, ("left", "right"), strict=True)
    }
    return dovetail.load(
        {
            "dovetail": 1,
            "name": "either way",
            "frequency": {"start": 100.0, "stop": 4000.0, "lines": 60},
            "substructures": parts,
            "joints": {"joint": {**section, "connect": connect}},
            "response": {**response, **others.pop("response", {})},
            **others,
        }
    )


def point(name, place, direction, backwards):
    return name, (LENGTH - place if name in backwards else place) * 1e-3, direction


WAYS = [("right",), ("left",)]


def ways(joint):
    """Both parts reversed mirror the whole assembly, and with it the axis of the collet and of the gradient g."""
    return [*WAYS, ("left", "right")] if joint not in ("collet", "interference_fit") else WAYS


@pytest.mark.sweep(keep=7)
@pytest.mark.parametrize(("joint", "backwards"), [(joint, way) for joint in JOINTS for way in WAYS])
def test_a_part_described_backwards_and_reversed_gives_the_same_frfs(joint, backwards):
    forwards, other = assembly(joint), assembly(joint, backwards)
    theta = forwards.from_unit(np.random.default_rng(3).random((4, len(forwards.parameters))))
    np.testing.assert_allclose(other.frf(theta), forwards.frf(theta), rtol=SAME)
    natural = forwards.natural_frequencies(theta[0], count=5)
    np.testing.assert_allclose(other.natural_frequencies(theta[0], count=5), natural, rtol=SAME)
    points = [("left", 0), ("left", 30), ("right", 100), ("right", 150)]
    forwards_at = [point(name, place, axis, ()) for name, place in points for axis in ("x", "rz")]
    other_at = [point(name, place, axis, backwards) for name, place in points for axis in ("x", "rz")]
    expected = forwards.receptance(theta[1], forwards_at, forwards_at)
    found = other.receptance(theta[1], other_at, other_at)
    size = np.abs(expected).max(axis=0)
    assert np.max(np.abs(found - expected) / size) < SAME


@pytest.mark.parametrize("joint", ["bolted", "spring_damper", "rigid", "bearing", "hinge"])
def test_the_whole_assembly_seen_from_its_other_end_gives_the_same_translations(joint):
    forwards, other = assembly(joint), assembly(joint, ("left", "right"))
    np.testing.assert_allclose(other.frf(), forwards.frf(), rtol=SAME)


@pytest.mark.parametrize("backwards", WAYS)
def test_the_jacobian_is_the_same(backwards):
    forwards, other = assembly("bolted"), assembly("bolted", backwards)
    expected, found = (one.frf_jacobian()[1] for one in (forwards, other))
    assert np.max(np.abs(found - expected) / np.abs(expected).max(axis=0)) < SAME


@pytest.mark.parametrize(("direction", "moment"), [("rz", "x"), ("x", "rz"), ("rz", "rz")])
@pytest.mark.parametrize("backwards", WAYS)
def test_rotations_of_a_reversed_part_are_counted_along_the_assembly(backwards, direction, moment):
    rotation = {"direction": direction}
    forwards = assembly(
        "bolted", response={**rotation, "force": {"at": "right", "position": "150 mm", "direction": moment}}
    )
    place = "0 mm" if "right" in backwards else "150 mm"
    response = {**rotation, "force": {"at": "right", "position": place, "direction": moment}}
    other = assembly("bolted", backwards, response=response)
    np.testing.assert_allclose(other.frf(), forwards.frf(), rtol=SAME)


@pytest.mark.parametrize("backwards", WAYS)
def test_the_direct_solve_agrees(backwards):
    other = assembly("bolted", backwards)
    graph, response = other.graph, other.description.response
    ends = [graph.substructure_dofs(name)[dof] for name, dof in (response.point, response.force_point)]
    direct = direct_receptance(graph, other.frequency, other.by_joint(), ends[:1], ends[1:])[:, 0, 0]
    omega = 2 * np.pi * other.frequency
    np.testing.assert_allclose(-(omega**2) * direct, other.frf(), rtol=1e-8)


@pytest.mark.parametrize("backwards", WAYS)
def test_the_literal_equations_agree(backwards):
    """They need inertia at every DOF of the joint."""
    other = assembly("spring_damper", backwards)
    graph, (name, dof) = with_inertia(other), other.description.response.point
    literal = LiteralSynthesis(graph, other.frequency, name, dof).receptance(other.by_joint())
    number = int(graph.substructure_dofs(name)[dof])
    direct = direct_receptance(graph, other.frequency, other.by_joint(), [number], [number])[:, 0, 0]
    forwards = with_inertia(assembly("spring_damper"))
    there = int(forwards.substructure_dofs("left")[0])
    expected = direct_receptance(forwards, other.frequency, other.by_joint(), [there], [there])[:, 0, 0]
    np.testing.assert_allclose(direct, expected, rtol=1e-8)
    np.testing.assert_allclose(literal, expected, rtol=1e-6)


def with_inertia(one):
    """The graph with a mass of 1 g and 1 g m^2 on each DOF of the joint, so that the joint has a receptance."""

    class Heavy(type(one.graph.connections["joint"].model)):
        def matrices(self, theta):
            matrices = super().matrices(theta)
            matrices.M[...] += 1e-3 * np.eye(self.size)
            return matrices

    connection = one.graph.connections["joint"]
    heavy = replace(connection, model=Heavy(connection.model.config))
    return replace(one.graph, connections={"joint": heavy})


@pytest.mark.sweep(keep=2)
@pytest.mark.parametrize("backwards", WAYS)
@pytest.mark.parametrize("part", ["left", "right"])
def test_unknown_options_of_a_reversed_part_give_the_same_frfs_and_derivatives(part, backwards):
    parts = {"left": bar(LEFT), "right": bar(RIGHT)}
    parts[part]["material"] = {**MATERIAL, "young": {"range": ["190 GPa", "215 GPa"]}}
    forwards, other = assembly("bolted", parts=copy.deepcopy(parts)), assembly("bolted", backwards, parts=parts)
    theta = forwards.from_unit(np.full(len(forwards.parameters), 0.3))
    for expected, found in zip(forwards.frf_jacobian(theta), other.frf_jacobian(theta), strict=True):
        assert np.max(np.abs(found - expected) / np.abs(expected).max(axis=0)) < SAME


@pytest.mark.parametrize("backwards", WAYS)
def test_a_window_and_a_sensor_see_the_same_structure(backwards):
    calibration = {"window": "12 1/s", "mass": "5 g"}
    forwards, other = (assembly("bolted", way, response={"calibration": calibration}) for way in ((), backwards))
    np.testing.assert_allclose(other.frf(), forwards.frf(), rtol=SAME)


def exported(folder, name, sections, kind):
    """Matrices or receptances of a bar at its joint's nodes and its end, seen in the bar's own axis."""
    part = dovetail.load(
        {
            "dovetail": 1,
            "name": "part",
            "frequency": {"start": 100.0, "stop": 4000.0, "lines": 60},
            "substructures": {"bar": bar(sections)},
            "response": {"at": "bar", "position": "0 mm"},
        }
    ).description.substructures["bar"]
    nodes = [f"{1e3 * node.position:.4g}" for node in part.nodes]
    table = {
        "nodes": [node for node in nodes for _ in "xr"],
        "directions": ["x", "rz"] * len(nodes),
        "positions": [node.position for node in part.nodes for _ in "xr"],
    }
    file = str(folder / f"{name}.npz")
    if kind == "measured":
        kept = [i for i, node in enumerate(part.nodes) if round(1e3 * node.position) in (0, 30, 120, 150)]
        dofs = [2 * i + axis for i in kept for axis in (0, 1)]
        frequency = np.linspace(100.0, 4000.0, 60)
        rows = {key: [values[dof] for dof in dofs] for key, values in table.items()}
        np.savez(file, frequency=frequency, receptance=part.receptance(frequency, dofs), **rows)
        return {"model": "measured", "file": file}
    matrices = part.matrices()
    np.savez(file, M=matrices.M, K=matrices.K, D=matrices.D, **table)
    return {"model": "matrices", "file": file, "tolerance": 0.0}


@pytest.mark.parametrize("reversed_part", ["left", "right"])
@pytest.mark.parametrize("kind", ["matrices", "measured"])
def test_imported_and_measured_parts_are_reversed_too(kind, reversed_part, tmp_path):
    """Each in files of its own axis: the bar as it is, and the bar seen from its other end."""
    other_end = turned(bar({"left": LEFT, "right": RIGHT}[reversed_part]))["sections"]
    frfs = []
    for backwards in ((), (reversed_part,)):
        parts = {"left": bar(LEFT), "right": bar(RIGHT)}
        sections = other_end if backwards else parts[reversed_part]["sections"]
        file = exported(tmp_path, f"{len(frfs)}", sections, kind)
        frfs.append(imported(backwards, parts, reversed_part, file).frf())
    tolerance = SAME if kind == "matrices" else 1e-6  # a receptance is inverted, which costs six digits
    np.testing.assert_allclose(frfs[1], frfs[0], rtol=tolerance)


def imported(backwards, parts, name, file):
    """The assembly of springs at two pairs of nodes, with one part from a file."""
    plain = assembly("spring_damper", backwards, parts=copy.deepcopy(parts))
    description = json.loads(plain.description.text)
    description["substructures"][name] = {**file, **({"reversed": True} if backwards else {})}
    return dovetail.load(description)


def test_a_sparse_part_of_many_dofs_is_reversed_too(tmp_path):
    fine = [{**section, "elements": 3 * section["elements"]} for section in RIGHT]
    frfs = []
    for number, backwards in enumerate(((), ("right",))):
        sections = turned(bar(fine))["sections"] if backwards else fine
        file = {**exported(tmp_path, str(number), sections, "matrices"), "tolerance": 1e-10}
        frfs.append(imported(backwards, {"left": bar(LEFT), "right": bar(RIGHT)}, "right", file).frf())
    assert len(sections) == 3
    np.testing.assert_allclose(frfs[1], frfs[0], rtol=1e-8)


def test_reversing_a_part_without_turning_its_description_is_another_structure():
    parts = {"left": bar(LEFT), "right": {**bar(RIGHT), "reversed": True}}
    plain, other = assembly("rigid"), assembly("rigid", parts=parts)
    assert np.max(np.abs(other.frf() / plain.frf() - 1)) > 0.1


def test_a_lumped_mass_has_no_ends_and_stays_the_same():
    frfs = []
    for orientation in ({}, {"reversed": True}):
        parts = {
            "left": bar(LEFT),
            "right": {"model": "lumped", "masses": [{"mass": "1 kg", "inertia": "1e-3 kg m^2"}]},
        }
        parts["right"] |= orientation
        connect = {"a": {"to": "left", "at": "150 mm"}, "b": {"to": "right", "at": "0 mm"}}
        description = {
            "dovetail": 1,
            "name": "mass",
            "frequency": {"start": 100.0, "stop": 2000.0, "lines": 20},
            "substructures": parts,
            "joints": {"joint": {"model": "spring_damper", "connect": connect}},
            "response": {"at": "left", "position": "0 mm"},
        }
        frfs.append(dovetail.load(description).frf())
    np.testing.assert_allclose(frfs[1], frfs[0], rtol=SAME)


@pytest.mark.parametrize("backwards", WAYS)
def test_mode_shapes_and_drawing_are_those_of_the_same_structure(backwards):
    forwards, other = assembly("bolted"), assembly("bolted", backwards)
    middle = forwards.from_unit(np.full(len(forwards.parameters), 0.5))
    for expected, found in zip(mode_shapes(forwards, middle, 3), mode_shapes(other, middle, 3), strict=True):
        assert found["frequency"] == pytest.approx(expected["frequency"], abs=0.02)
        shapes = []
        for mode in (expected, found):
            places = {part["name"]: dict(zip(part["along"], part["across"], strict=True)) for part in mode["parts"]}
            origin = min(min(places[name]) for name in places)
            shapes.append({n: {round(x - origin, 1): y for x, y in at.items()} for n, at in places.items()})
        for name in ("left", "right"):
            assert shapes[1][name].keys() == shapes[0][name].keys()
            ratio = [shapes[1][name][x] - shapes[0][name][x] for x in shapes[0][name]]
            opposite = [shapes[1][name][x] + shapes[0][name][x] for x in shapes[0][name]]
            assert min(np.abs(ratio).max(), np.abs(opposite).max()) < 2e-3
    widths = [
        sorted(np.diff(path.get_path().get_extents().intervalx)[0] for path in assembly_figure(one).axes[0].patches)
        for one in (forwards, other)
    ]
    np.testing.assert_allclose(widths[1], widths[0], rtol=1e-6)


def test_the_description_of_one_response_keeps_its_reversed_parts():
    other = assembly("bolted", ("right",))
    again = dovetail.load(json.loads(other.description.text))
    assert set(again.description.placements) == {"right"}
    np.testing.assert_array_equal(again.frf(), other.frf())
    assert other.on(other.frequency[::2]).description.placements.keys() == {"right"}
