"""Axes that files give for their FRFs, compared with the directions of a model in space."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import dovetail
from dovetail.identification.measured_lines import check_measured, roles_of

NODES = {"foot": [0.0, 0.0, 0.0], "top": [0.0, 0.0, 0.05]}
BODY = {"model": "rigid_body", "mass": 1.0, "inertia": [1e-3] * 3, "nodes": NODES, "place": {}}


def description_of(pairs, at=("foot", "top")):
    """Return the description of a free body with responses at one node along directions, by forces along others."""
    responses = [
        {"at": "body", "name": f"r{n}", "position": at[0], "direction": one}
        | {"force": {"position": at[1], "direction": by}}
        for n, (one, by) in enumerate(pairs)
    ]
    whole = {
        "dovetail": 1,
        "name": "body",
        "frequency": {"start": 10.0, "stop": 100.0, "lines": 10},
        "substructures": {"body": BODY},
        "joints": {},
        "responses": responses,
    }
    return dovetail.load(whole).description


def measured(*dofs):
    rng, frfs = np.random.default_rng(0), []
    for response, force in dofs:
        values = rng.normal(size=10) + 1j * rng.normal(size=10)
        points = {"response": response, "force": force, "label": f"{response}/{force}"}
        frfs.append(dovetail.Frf(np.linspace(10.0, 100.0, 10), values, "accelerance", **points))
    return frfs


def remarks(pairs, *dofs, **at):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_measured(description_of(pairs, **at), measured(*dofs))
    return [str(one.message) for one in caught]


ALL = [("x", "x"), ("y", "x"), ("z", "x")]
GIVEN = [("11+x", "12+x"), ("11+y", "12+x"), ("11+z", "12+x")]


def test_axes_with_the_names_of_the_model_are_not_remarked():
    assert remarks(ALL, *GIVEN) == []
    assert remarks([("-y", "x")], ("11+y", "12+x")) == []


def test_exchanged_axes_are_remarked_once():
    (remark,) = remarks(ALL, GIVEN[0], GIVEN[2], GIVEN[1])
    assert "(y is used as z, z is used as y). Are the axes of the files other ones?" in remark


def test_axes_with_other_names_are_remarked():
    (remark,) = remarks([("z", "x")], ("11+y", "12+x"))
    assert remark.startswith("11+y/12+x: its response is 11+y, and it is used along z at body, node foot")


def test_a_direction_against_an_axis_is_along_it():
    """A response along -y and a force along a skew direction were taken for one direction."""
    assert remarks([("-y", [1, 1, 0])], ("11+y", "12+x")) == []
    with pytest.raises(dovetail.MeasurementError, match="one direction"):
        check_measured(description_of([("-y", "x")]), measured(("11+x", "12+x")))


def test_two_skew_directions_at_a_node_are_no_drive_point():
    """They were one point, so that an FRF that delivers power was refused."""
    assert remarks([([1, 1, 0], [1, -1, 0])], ("11+x", "11+y"), at=("top", "top")) == []
    description = description_of([([1, 1, 0], [1, -1, 0])], at=("top", "top"))
    (role,) = roles_of(description, measured(("", "")))
    assert not role.is_drive_point
