"""The drawing of an assembly: positions, scale, and no overlapping text."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import StepPatch

import dovetail
from dovetail.report.drawing import assembly_figure, drawing_text, mode_shapes
from dovetail.report.pages import web_text
from dovetail.report.svg import page_figure

ASSEMBLIES = Path(__file__).resolve().parents[2] / "assemblies"
UNLIKE = ("h0", "h2_t3", "sf_h2_t1", "spindle", "t1")
"""Of the campaign; the others differ from these in dimensions."""
SHIPPED = sorted([*ASSEMBLIES.glob("*.yaml"), *(ASSEMBLIES / "campaign" / f"{name}.yaml" for name in UNLIKE)])


def texts(figure):
    """The labels in the drawing with their boxes on the page."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    written = [text for text in figure.axes[0].texts if text.get_text()]
    return [(text.get_text(), super(type(text), text).get_window_extent(renderer)) for text in written]


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: str(file.relative_to(ASSEMBLIES)))
def test_every_shipped_assembly_is_drawn_with_each_name_once_and_no_text_over_another(file):
    assembly = dovetail.load(file)
    figure = dovetail.plot_assembly(assembly)
    labels = texts(figure)
    names = [*assembly.description.substructures, *assembly.description.joints]
    responses = [text for text, _ in labels if text not in names]
    assert sorted(text for text, _ in labels if text in names) == sorted(names)
    assert len(responses) == 2 * len(assembly.description.responses)
    page = figure.get_window_extent()
    below = figure.axes[0].xaxis.label
    for text, box in [*labels, (below.get_text(), below.get_window_extent())]:
        assert page.x0 <= box.x0 <= box.x1 <= page.x1, text
        assert page.y0 <= box.y0 <= box.y1 <= page.y1, text
    for (one, box), (other, further) in itertools.combinations(labels, 2):
        assert not box.shrunk(0.97, 0.9).overlaps(further), (one, other)
    for name in names:
        assert name in drawing_text(assembly)


def shapes(figure):
    """Ends [mm] along and across the axis of what is drawn of the outlines."""
    boxes = [patch.get_path().get_extents() for patch in figure.axes[0].patches if isinstance(patch, StepPatch)]
    return [tuple(np.round([box.x0, box.x1, box.height], 3)) for box in boxes]


def test_parts_are_to_scale_and_where_the_joint_puts_them(collet):
    figure = assembly_figure(collet)
    tool, upper, lower = shapes(figure)
    assert tool == (0.0, 100.0, 10.0)
    assert upper[:2] == lower[:2] == (80.0, 225.4)  # the nose is 20 mm before the end of the tool
    assert figure.axes[0].get_aspect() == pytest.approx(1.0)
    assert "True proportions." in figure.get_suptitle()


def test_overlapping_parts_are_drawn_side_by_side_with_a_note_on_stretching():
    figure = dovetail.plot_assembly(ASSEMBLIES / "bolted_lap_beam.yaml")
    boxes = [patch.get_path().get_extents() for patch in figure.axes[0].patches]
    left, right = sorted(boxes, key=lambda box: box.x0)
    assert (left.x1, right.x0) == pytest.approx((190.0, 150.0))
    assert left.y0 > right.y1
    assert (
        "Stretched 3 times across the axis. What would overlap is drawn side by side."
        in figure.get_suptitle().replace("\n", " ")
    )
    assert figure.axes[0].get_aspect() == pytest.approx(3.0)


def test_parts_without_an_outline_are_boxes_and_the_ground_is_hatched(sdof):
    figure = assembly_figure(sdof)
    mass, ground = figure.axes[0].patches
    assert (mass.get_hatch(), ground.get_hatch()) == (None, "////")
    assert "not to scale" in figure.get_suptitle()


def test_the_command_writes_the_drawing_with_its_text(tmp_path):
    from typer.testing import CliRunner

    from dovetail.cli.app import app

    files = [tmp_path / "a.svg", tmp_path / "a.png"]
    words = ["check", str(ASSEMBLIES / "sdof.yaml"), *(word for file in files for word in ("-o", str(file)))]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert 'aria-label="Drawing of sdof. Parts: mass (lumped), base (ground)' in files[0].read_text()
    assert files[1].read_bytes().startswith(b"\x89PNG")
    again = CliRunner().invoke(app, words)
    assert again.exit_code == 1
    assert "a file of this name already exists" in again.stderr


def test_the_report_draws_the_assembly_it_is_given(result, collet, tmp_path):
    from dovetail.report.html_report import write_report

    text = write_report(result, tmp_path / "with.html", assembly=collet).read_text(encoding="utf-8")
    assert 'role="img" aria-label="Drawing of bt40-er32-t0. Parts: tool (timoshenko_beam), holder' in text
    assert "Drawing of" not in write_report(result, tmp_path / "without.html").read_text(encoding="utf-8")


def test_the_outline_of_a_plugin_that_is_wrong_is_its_fault(collet, monkeypatch):
    part = collet.description.substructures["tool"]
    monkeypatch.setattr(type(part), "outline", [(0.0, 0.1)])
    with pytest.raises(dovetail.PluginError, match="timoshenko_beam"):
        assembly_figure(collet)


def test_mode_shapes_are_the_motion_of_the_nodes(assemblies: Path) -> None:
    assembly = dovetail.load(assemblies / "bt40_er32.yaml")
    theta = assembly.vector(None)
    shapes = mode_shapes(assembly, theta, 3)
    assert [mode["frequency"] for mode in shapes] == pytest.approx(assembly.natural_frequencies(theta), rel=1e-5)
    tool, holder = shapes[0]["parts"]
    assert (tool["name"], holder["name"]) == ("tool", "holder")
    assert max(abs(u) for u in tool["across"] + holder["across"]) == 1.0
    assert np.abs(tool["across"]).argmax() == 0  # the tip of a slender tool in a stiff holder
    assert len(tool["along"]) == len(tool["across"]) == len(assembly.description.substructures["tool"].nodes)
    oscillator = dovetail.load(assemblies / "sdof.yaml")
    (mode,) = mode_shapes(oscillator, oscillator.vector(None), 3)
    assert [(part["name"], part["across"]) for part in mode["parts"]] == [("mass", [1.0])]


BRACKET = {
    "dovetail": 1,
    "name": "bracket",
    "frequency": {"start": 50.0, "stop": 2000.0, "lines": 400},
    "substructures": {
        "post": {
            "model": "spatial_beam",
            "material": {"young": 210e9, "density": 7850.0, "loss_factor": 0.003},
            "sections": [{"length": 0.15, "width": 0.04, "height": 0.03, "elements": 3}],
            "place": {"along": "z"},
        },
        "arm": {
            "model": "rigid_body",
            "mass": 2.0,
            "inertia": [2e-3, 2e-3, 2e-3],
            "nodes": {"root": [0.0, 0.0, 0.0], "tip": [0.1, 0.0, 0.0]},
            "place": {"origin": [0.0, 0.0, 0.15]},
        },
        "floor": {"model": "ground"},
    },
    "joints": {
        "foot": {
            "model": "rigid",
            "direction": "all",
            "connect": {"a": {"to": "post", "at": 0.0}, "b": {"to": "floor", "at": 0.0}},
        },
        "corner": {
            "model": "bushing",
            "connect": {"a": {"to": "post", "at": 0.15}, "b": {"to": "arm", "at": "root"}},
        },
    },
    "responses": [
        {"at": "arm", "position": "tip", "direction": "z"},
        {"at": "arm", "position": "tip", "direction": [0, 1, 0]},
    ],
}


def test_an_assembly_in_space_is_drawn_with_its_parts_joints_and_directions():
    figure = dovetail.plot_assembly(dovetail.load(BRACKET))
    (axes,) = figure.axes
    words = [text.get_text() for text in axes.texts]
    assert {"post", "arm", "foot", "corner", "x", "y", "z"} <= {*words}
    assert any("accelerance (response_2) along (0, 1, 0)" in text for text in words)
    lines = [line for line in axes.lines if line.get_linewidth() == 3.5]
    assert len(lines) == 3 + 1  # three elements, and from the root to the tip
    post, arm = lines[0].get_xydata(), lines[-1].get_xydata()
    assert post[1, 1] > post[0, 1]  # upwards
    assert post[0, 0] == pytest.approx(post[1, 0])
    assert arm[1, 0] > arm[0, 0]  # along x, to the right


def test_mode_shapes_in_space_are_the_motion_of_all_nodes_in_three_directions():
    assembly = dovetail.load(BRACKET)
    shapes = mode_shapes(assembly, assembly.vector(None), 3)
    modes = assembly.modes(None, 3)
    for shape, mode in zip(shapes, modes, strict=True):
        by_name = {part["name"]: part for part in shape["parts"]}
        assert set(by_name) == {"post", "arm"}
        moved = np.array([row for part in by_name.values() for row in part["motion"]])
        assert np.linalg.norm(moved, axis=1).max() == pytest.approx(1.0, abs=1e-3)
        root, tip = np.array(by_name["arm"]["motion"])
        six = mode.shapes["arm"].ravel()
        turn = np.exp(-1j * np.angle(six[np.argmax(np.abs(six[:3]))]))
        rotation = (turn * six[3:]).real
        expected = (turn * six[:3]).real + np.cross(rotation, [0.1, 0.0, 0.0])
        assert abs(np.dot(tip, expected)) == pytest.approx(np.linalg.norm(tip) * np.linalg.norm(expected), rel=1e-2)
        assert by_name["arm"]["lines"] == [(0, 1)]
        assert by_name["post"]["points"][-1] == [0.0, 0.0, 150.0]
        assert np.linalg.norm(root) <= 1.0


@pytest.mark.parametrize("file", ["bt40_er32.yaml", "spindle_bt40_er32.yaml", "campaign/sf_h2_t1.yaml"])
def test_a_drawing_in_a_page_has_only_colours_that_the_page_has_for_light_and_dark(file):
    drawn = str(page_figure(assembly_figure(dovetail.load(ASSEMBLIES / file)), "assembly", "Assembly"))
    assert re.findall(r"#[0-9a-f]{3,8}\b(?=[;\"])", drawn) == []
    styles = web_text("charts.css")
    for name in set(re.findall(r"var\((--[\w-]+)\)", drawn)):
        assert styles.count(f"{name}:") == 2
