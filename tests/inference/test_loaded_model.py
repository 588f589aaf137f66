"""The model of a mass that is moved from response to response."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.inference.adequacy.perturbations import LoadedModel, list_perturbations
from dovetail.problem.residuals import ModelFrfs

ROD = {"model": "timoshenko_beam", "material": {"young": "200 GPa", "density": 7850}}
RESPONSES = {
    "one": [{"at": "rod", "position": "node n4"}],
    "two": [
        {"at": "rod", "position": "node n4"},
        {"at": "rod", "position": "node n3", "force": {"position": "node n4"}},
    ],
}


@pytest.fixture(params=RESPONSES)
def loaded(request) -> LoadedModel:
    wall = {"to": "wall", "at": 0}
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "rod",
            "frequency": {"start": 50, "stop": 950, "step": 50},
            "substructures": {
                "rod": {**ROD, "sections": [{"length": "300 mm", "outer": "20 mm", "elements": 3}]},
                "wall": {"model": "ground"},
            },
            "joints": {"foot": {"model": "spring_damper", "connect": {"a": {"to": "rod", "at": 0}, "b": wall}}},
            "responses": RESPONSES[request.param],
        }
    )
    mass = next(entry for entry in list_perturbations(assembly) if entry.kind == "mass")
    model = mass.apply(0.5 * mass.upper)
    assert isinstance(model, LoadedModel)
    return model


def test_some_lines_of_the_loaded_model_are_those_of_all(loaded):
    theta = loaded.from_unit(np.full((1, len(loaded.parameters)), 0.4))
    whole, lines = ModelFrfs.of(loaded), np.arange(0, sum(ModelFrfs.of(loaded).counts), 3)
    frf, jacobian = whole.frf_jacobian(theta)
    some, some_jacobian = whole.at(lines).frf_jacobian(theta)
    np.testing.assert_allclose(some, frf[:, lines], rtol=1e-9)
    np.testing.assert_allclose(some_jacobian, jacobian[:, lines], rtol=1e-9)


def test_the_jacobian_of_the_loaded_model_is_that_of_its_frf(loaded):
    theta = loaded.from_unit(np.full(len(loaded.parameters), 0.4))
    _, jacobian = loaded.frf_jacobian(theta)
    for column, value in enumerate(theta):
        step = np.zeros(len(theta))
        step[column] = 1e-5 * value
        expected = (loaded.frf(theta + step) - loaded.frf(theta - step)) / (2 * step[column])
        scale = np.abs(expected).max()
        np.testing.assert_allclose(jacobian[:, column], expected, atol=1e-5 * scale)
