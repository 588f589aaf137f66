"""A lap of two bars in space: with stiff contacts it is the solid bar, with soft ones the two bars slide."""

import numpy as np
import pytest

import dovetail

MATERIAL = {"young": 193e9, "density": 7950.0, "poisson": 0.29, "loss_factor": 1e-4}
VALUES = {"kt": 1e11, "kr": 1e7, "ct": 0.0, "cr": 0.0, "ks": 1e11, "cs": 0.0}
STIFF = {name: {"value": value} for name, value in VALUES.items()}


def piece(length, height, elements, offset=0.0):
    return {"length": length, "height": height, "width": 0.0254, "elements": elements, "offset": [offset, 0.0]}


def described(parts, joints, at):
    return {
        "dovetail": 1,
        "name": "lap",
        "frequency": {"start": 5.0, "stop": 600.0, "lines": 60},
        "substructures": parts,
        "joints": joints,
        "response": {"at": at, "position": 0.0, "quantity": "receptance"},
    }


def lap(per_20mm, parameters=STIFF, heights=(6.35e-3, 6.35e-3)):
    """Two bars of 300 mm with a lap of 120 mm, whose faces lie on the line of the nodes."""
    tongue, total = 6 * per_20mm, sum(heights)
    middle = (heights[0] - heights[1]) / 2.0  # of the whole bar, from the faces
    left = [piece(0.3, total, 15 * per_20mm, -middle), piece(0.12, heights[0], tongue, -heights[0] / 2)]
    right = [piece(0.12, heights[1], tongue, heights[1] / 2), piece(0.3, total, 15 * per_20mm, -middle)]
    parts = {
        "left": {"model": "spatial_beam", "material": MATERIAL, "sections": left, "place": {}},
        "right": {
            "model": "spatial_beam",
            "material": MATERIAL,
            "sections": right,
            "place": {"origin": [0.0, -0.3, 0.0]},
        },
    }
    places = np.linspace(0.0, 0.12, tongue + 1)
    joint = {
        "model": "bolted",
        "motion": "space",
        "nodes": tongue + 1,
        "connect": {"a": {"to": "left", "at": (0.3 + places).tolist()}, "b": {"to": "right", "at": places.tolist()}},
        "parameters": parameters,
    }
    return dovetail.load(described(parts, {"lap": joint}, "left"))


def solid():
    bar = {"model": "spatial_beam", "material": MATERIAL, "sections": [piece(0.72, 0.0127, 144)]}
    return dovetail.load(described({"bar": bar}, {}, "bar"))


def test_a_lap_with_stiff_contacts_converges_to_the_solid_bar():
    exact = solid().natural_frequencies(count=4)
    errors = [np.abs(lap(per).natural_frequencies(count=4) / exact - 1.0).max() for per in (1, 2)]
    print(f"errors with nodes every 20 and 10 mm: {', '.join(f'{error:.1e}' for error in errors)}")
    assert errors[0] > 2.0 * errors[1]
    assert errors[1] < 1e-3
    assert lap(2).natural_frequencies(count=1)[0] == pytest.approx(124.0, abs=1.0)


def test_a_lap_whose_faces_slide_is_much_softer():
    free = {**STIFF, "ks": {"value": 1.0}}
    assert lap(1, free).natural_frequencies(count=1)[0] < 0.8 * solid().natural_frequencies(count=1)[0]


def test_a_lap_between_bars_of_different_heights_is_the_solid_bar_too():
    found = lap(2, heights=(4e-3, 8.7e-3)).natural_frequencies(count=2)
    np.testing.assert_allclose(found, solid().natural_frequencies(count=2), rtol=5e-3)


def test_check_has_no_omission_to_report_for_a_lap_in_space():
    from dovetail.assembly.omissions import find_omissions

    assert find_omissions(lap(1)) == ()
