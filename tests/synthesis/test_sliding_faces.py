"""What joints that cannot slide would add: the lap of two bars against a solid bar, and joints around one axis."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import dovetail
from dovetail.cli.app import app
from dovetail.registry import components

STEEL = {"young": "193 GPa", "density": "7950 kg/m^3", "poisson": 0.29}
STIFF = {"kt": 1e10, "kr": 1e7, "ct": 1.0, "cr": 1e-3}


def described(parts, joints, at):
    return {
        "dovetail": 1,
        "name": "faces",
        "frequency": {"start": 5.0, "stop": 600.0, "lines": 3},
        "substructures": parts,
        "joints": joints,
        "response": {"at": at, "position": "0 mm"},
    }


def bar(*sections, material=STEEL):
    return {"model": "timoshenko_beam", "material": material, "sections": list(sections)}


def piece(length, height, elements, width=25.4):
    return {"length": f"{length} mm", "width": f"{width} mm", "height": f"{height} mm", "elements": elements}


def lap(heights=(6.35, 6.35), parameters=STIFF, reverse=False):
    """Bars of 300 mm with a lap of 120 mm at half the height between them."""
    total = sum(heights)
    left = bar(piece(300, total, 15), piece(120, heights[0], 6))
    right = [piece(120, heights[1], 6), piece(300, total, 15)]
    at = [20 * place for place in range(7)]
    if reverse:
        right, at = right[::-1], [420 - place for place in at]
    right = {**bar(*right), "reversed": reverse}
    connect = {
        "a": {"to": "left", "at": [f"{300 + 20 * place} mm" for place in range(7)]},
        "b": {"to": "right", "at": [f"{place} mm" for place in at]},
    }
    joint = {"model": "bolted", "nodes": 7, "connect": connect, "parameters": parameters}
    return dovetail.load(described({"left": left, "right": right}, {"lap": joint}, "left"))


def solid(height=12.7):
    return dovetail.load(described({"bar": bar(piece(720, height, 36))}, {}, "bar"))


def bound(assembly):
    """The natural frequencies that `check` shows for faces that do not slide."""
    from dataclasses import replace

    from dovetail.assembly.omissions import _Added, _omission
    from dovetail.assembly.vibration_modes import lowest_frequencies

    connection = assembly.description.joints["lap"].connection
    omission = _omission("lap", connection, assembly)
    added = replace(connection, model=_Added(connection.model.ports, omission.stiffness))
    graph = replace(assembly.graph, connections={**assembly.graph.connections, "more": added})
    theta = {**assembly.by_joint(assembly.vector(None)[np.newaxis]), "more": np.empty((1, 0))}
    return lowest_frequencies(graph, theta, 3)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("heights", [(6.35, 6.35), (4.0, 8.7), (9.0, 3.7)])
def test_a_stiff_lap_that_cannot_slide_is_the_solid_bar(heights, reverse):
    """Without sliding resistance it is far softer, however stiff its springs are."""
    assembly, whole = lap(heights, reverse=reverse), solid()
    expected = whole.natural_frequencies(count=3)
    np.testing.assert_allclose(bound(assembly), expected, rtol=0.005)
    assert assembly.natural_frequencies(count=1)[0] < 0.9 * expected[0]


def test_the_lap_of_two_equal_bars_has_a_quarter_of_the_bending_stiffness_of_a_solid_one():
    assembly = lap()
    K = (
        assembly.description.joints["lap"]
        .connection.model.omission(
            list(assembly.description.substructures.values()),
            [end.nodes for end in assembly.description.joints["lap"].connection.attachments],
        )
        .stiffness
    )
    turning = np.zeros(len(K))
    for node in range(7):  # both bars bent to a curvature of 1/m
        turning[[2 * node + 1, 2 * (7 + node) + 1]] = 0.02 * node
    width, height, young = 25.4e-3, 12.7e-3, 193e9
    whole = young * width * height**3 / 12
    assert turning @ K @ turning / 0.12 == pytest.approx(0.75 * whole, rel=1e-9)


def test_check_reports_the_change_of_frequencies(tmp_path):
    file = tmp_path / "lap.yaml"
    file.write_text(lap().description.text)
    printed = " ".join(CliRunner().invoke(app, ["check", str(file)]).output.split())
    assert "What the model leaves out" in printed
    assert "joints.lap: nothing in the model resists the sliding of the two faces" in printed
    assert "83.05, 318.6, 573.9 Hz; with all of it they would be 123.9, 340.4, 665.8 Hz, up to 49 % higher." in printed
    summary = json.loads(CliRunner().invoke(app, ["check", str(file), "--json"]).output)
    assert len(summary["omissions"]) == 1


def test_a_joint_at_one_point_leaves_nothing_out():
    joint = {"model": "bolted", "nodes": 1, "connect": {"a": {"to": "left", "at": 0}, "b": {"to": "right", "at": 0}}}
    parts = {"left": bar(piece(100, 10, 4)), "right": bar(piece(100, 10, 4))}
    assert dovetail.find_omissions(dovetail.load(described(parts, {"bolt": joint}, "left"))) == ()


def test_parts_without_cross_sections_leave_the_size_unknown(tmp_path):
    model = components().find("substructure", "timoshenko_beam").component
    part = model(model.Config(material=STEEL, sections=[piece(100, 10, 4)]))
    matrices, labels = part.matrices(), [node.label for node in part.nodes for _ in "xr"]
    positions = [node.position for node in part.nodes for _ in "xr"]
    np.savez(
        tmp_path / "part.npz",
        M=matrices.M, K=matrices.K, nodes=labels, directions=["x", "rz"] * 5, positions=positions,
    )  # fmt: skip
    at = ["0 mm", "25 mm", "50 mm"]
    joint = {"model": "bolted", "connect": {"a": {"to": "left", "at": at}, "b": {"to": "right", "at": at}}}
    parts = {"left": bar(piece(100, 10, 4)), "right": {"model": "matrices", "file": str(tmp_path / "part.npz")}}
    (text,) = dovetail.find_omissions(dovetail.load(described(parts, {"lap": joint}, "left")))
    assert "is not known: its parts do not give their cross-sections" in text


def around_one_axis(joint, inner, outer, connect):
    return dovetail.load(described({"inner": inner, "outer": outer}, {"joint": {**joint, "connect": connect}}, "inner"))


def round_piece(length, elements, outer, inner=0.0):
    return {"length": f"{length} mm", "outer": f"{outer} mm", "inner": f"{inner} mm", "elements": elements}


def test_a_stiff_interference_fit_is_the_solid_shaft_although_nothing_resists_sliding():
    """Around one axis no face is off the axis in which it bends: the stiffnesses add up to that of the solid."""
    shaft = bar(round_piece(200, 40, 30), round_piece(40, 16, 30))
    hub = bar(round_piece(40, 16, 60, 30), round_piece(120, 24, 60))
    joint = {"model": "interference_fit", "length": "40 mm", "nodes": 17}
    joint["parameters"] = {"k": 1e14, "kr": 1e10, "c": 10.0, "cr": 1e-3}
    connect = {
        "shaft": {"to": "inner", "at": [f"{200 + 2.5 * place} mm" for place in range(17)]},
        "hub": {"to": "outer", "at": [f"{2.5 * place} mm" for place in range(17)]},
    }
    fitted = around_one_axis(joint, shaft, hub, connect).natural_frequencies(count=3)
    whole = dovetail.load(described({"bar": bar(round_piece(200, 40, 30), round_piece(160, 40, 60))}, {}, "bar"))
    np.testing.assert_allclose(fitted, whole.natural_frequencies(count=3), rtol=0.01)


def test_a_stiff_collet_is_the_solid_body_although_nothing_resists_sliding():
    tool = bar(round_piece(60, 12, 10), round_piece(20, 2, 10))
    holder = bar(round_piece(20, 2, 50, 30), round_piece(80, 8, 50))
    values = {
        "Dc": 30e-3,
        "dc": 10e-3,
        "mn1": 1e-9,
        "mn2": 1e-9,
        "kt_tc": 1e14,
        "kr_tc": 1e10,
        "kt_hc": 1e14,
        "kr_hc": 1e10,
    }
    values |= {"ct_tc": 1.0, "cr_tc": 1e-3, "ct_hc": 1.0, "cr_hc": 1e-3}
    joint = {"model": "collet", "material": STEEL, "parameters": values}
    connect = {
        "tool": {"to": "inner", "at": ["60 mm", "70 mm", "80 mm"]},
        "holder": {"to": "outer", "at": ["0 mm", "10 mm", "20 mm"]},
    }
    clamped = around_one_axis(joint, tool, holder, connect).natural_frequencies(count=3)
    pieces = round_piece(60, 12, 10), round_piece(20, 2, 30), round_piece(20, 2, 50), round_piece(80, 8, 50)
    whole = dovetail.load(described({"bar": bar(*pieces)}, {}, "bar")).natural_frequencies(count=3)
    np.testing.assert_allclose(clamped, whole, rtol=0.011)
    for model in ("collet", "interference_fit"):
        assert "omission" not in vars(components().find("joint", model).component)
