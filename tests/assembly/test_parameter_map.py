"""The map from the identified parameters to the values of all components, and FRFs by a map of another kind."""

from __future__ import annotations

import numpy as np
import pytest

import dovetail
from dovetail.assembly.measurement_chain import chain_rule
from dovetail.assembly.parameters import AffineMap, ParameterMap, ResponseFrfs
from dovetail.description import ParameterEntry, Tie
from dovetail.interfaces import Parameter

K, C = Parameter("k", "N/m", 1e5, 1e7, "log"), Parameter("c", "N s/m", 1.0, 100.0, "log")
ENTRIES = {
    "first": ParameterEntry(parameters=(K, C)),
    "second": ParameterEntry(parameters=(K, C), fixed={"c": 7.0}, ties={"k": Tie("first", "k", 2.0)}),
    "third": ParameterEntry(parameters=(K, C), ties={"k": Tie("second", "k", 0.5), "c": Tie("second", "c", 3.0)}),
}
IDENTIFIED = [("first", "k"), ("first", "c")]


def test_values_are_known_or_multiples_of_identified_parameters():
    values = AffineMap(ENTRIES, IDENTIFIED).by_component(np.array([[1e6, 10.0], [2e6, 20.0]]))
    assert values["first"].tolist() == [[1e6, 10.0], [2e6, 20.0]]
    assert values["second"].tolist() == [[2e6, 7.0], [4e6, 7.0]]
    assert values["third"].tolist() == [[1e6, 21.0], [2e6, 21.0]]


def test_the_jacobian_of_a_map_is_that_of_its_values():
    affine, theta = AffineMap(ENTRIES, IDENTIFIED), np.array([[1e6, 10.0]])
    ahead = np.concatenate([affine.values(theta + step) - affine.values(theta) for step in np.diag([1.0, 1.0])])
    assert affine.jacobian(theta)[0].T.tolist() == ahead.tolist()
    assert affine.varying.tolist() == [True, True, True, False, True, False]
    assert affine.varying_columns("third") == [0]


def test_known_parameters_alone_need_no_theta():
    entries = {"joint": ParameterEntry(parameters=(K,), fixed={"k": 1e6})}
    affine = AffineMap(entries, [])
    assert affine.values(np.empty((3, 0))).tolist() == [[1e6]] * 3
    assert affine.jacobian(np.empty((3, 0))).shape == (1, 1, 0)


def test_derivatives_by_some_values_are_summed_for_each_parameter():
    derivatives = np.array([[[1.0], [10.0], [100.0]], [[2.0], [20.0], [np.inf]]])
    slopes = np.array([[[1.0, 0.0], [2.0, 0.0], [0.0, 3.0]]] * 2)
    assert chain_rule(derivatives, slopes).tolist() == [[[21.0], [300.0]], [[42.0], [np.inf]]]


class _StiffnessByTorque(ParameterMap):
    """A law in place of a parameter: the stiffness a t^b of a joint at a torque t; its damping is the third parameter.

    The joint has further parameters, which are known: the values are k, c, kr and cr.
    """

    def __init__(self, torque: float) -> None:
        self._torque = torque
        self.columns, self.varying = {"foot": slice(0, 4)}, np.array([True, True, False, False])

    def values(self, theta):
        known = np.broadcast_to([1e4, 0.1], (len(theta), 2))
        return np.column_stack([theta[:, 0] * self._torque ** theta[:, 1], theta[:, 2], known])

    def jacobian(self, theta):
        power = self._torque ** theta[:, 1]
        slopes = np.zeros((len(theta), 4, 3))
        slopes[:, 0, 0], slopes[:, 0, 1] = power, theta[:, 0] * power * np.log(self._torque)
        slopes[:, 1, 2] = 1.0
        return slopes


@pytest.mark.parametrize("count", [1, 3])
def test_frfs_and_derivatives_of_a_law_are_those_of_the_values_that_it_gives(count):
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "foot",
            "frequency": {"start": 50, "stop": 250, "step": 10},
            "substructures": {"m": {"model": "lumped", "masses": [{"mass": 1.0}]}, "wall": {"model": "ground"}},
            "joints": {
                "foot": {
                    "model": "spring_damper",
                    "connect": {"a": {"to": "m", "at": 0}, "b": {"to": "wall", "at": 0}},
                    "parameters": {"kr": 1e4, "cr": 0.1},
                }
            },
            "response": {"at": "m", "position": 0},
        }
    )
    torque, theta = 20.0, np.array([[2e5, 0.4, 30.0], [3e5, 0.3, 20.0], [1e5, 0.5, 40.0]])[:count]
    engine, law, responses = assembly.engine, _StiffnessByTorque(torque), assembly.description.responses
    frfs = ResponseFrfs(engine, engine, law, responses, assembly.description.calibrations)
    values, jacobian = frfs.jacobian(theta)
    k, c = theta[:, 0] * torque ** theta[:, 1], theta[:, 2]
    np.testing.assert_array_equal(values[:, 0], assembly.frf(np.stack([k, c], axis=1)))
    np.testing.assert_array_equal(frfs.frfs(theta), values)
    for column in range(3):
        step = np.zeros(3)
        step[column] = 1e-6
        change = frfs.frfs(theta * (1 + step)) - frfs.frfs(theta * (1 - step))
        expected = change / (2e-6 * theta[:, column])[:, np.newaxis, np.newaxis]
        np.testing.assert_allclose(jacobian[:, :, column], expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("places", [([2, 0, 4], [0, 1, 2]), ([2, 0, 4, 1], [0, 1, 2, 0]), ([3], [1])])
@pytest.mark.parametrize("shape", [(4, 5, 6), (4, 2, 5, 6)])
def test_the_chain_rule_sums_over_the_values_that_depend_on_a_parameter(places, shape):
    """One value for each parameter, two of them tied to one, and parameters on which nothing depends."""
    random = np.random.default_rng(0)
    derivatives, slopes = random.standard_normal(shape), np.zeros((4, 5, 3))
    slopes[:, *places] = random.standard_normal((4, len(places[0])))
    expected = np.einsum("n...vf,nvp->n...pf", derivatives, slopes)
    np.testing.assert_allclose(chain_rule(derivatives, slopes), expected, rtol=1e-13)
