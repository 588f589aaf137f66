"""The DOFs to which the mass of a sensor is attached."""

import numpy as np
import pytest

import dovetail
from dovetail.assembly.structure import entries_at_response, graph_of

SECTION = {"length": "100 mm", "outer": "20 mm", "elements": 2}
STEEL = {"young": "210 GPa", "density": "7850 kg/m^3", "poisson": 0.3, "loss_factor": 0.003}


@pytest.mark.parametrize(("model", "directions"), [("timoshenko_beam", ("x", "rz")), ("spatial_beam", ("x", "y", "z"))])
def test_a_sensor_is_attached_to_both_dofs_of_a_planar_node(model, directions):
    """The order of elimination, and with it each digit of a planar FRF, depends on the DOFs that joints keep."""
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "bar",
            "frequency": {"start": "100 Hz", "stop": "500 Hz", "step": "100 Hz"},
            "substructures": {"bar": {"model": model, "material": STEEL, "sections": [SECTION]}},
            "joints": {},
            "response": {"at": "bar", "position": "0 mm", "calibration": {"mass": {"range": ["0 g", "5 g"]}}},
        }
    )
    entries = entries_at_response(assembly.description)
    graph = graph_of(assembly.description, entries, rigid=False)
    sensor = next(name for name in entries if name.endswith("sensor"))
    nodes = assembly.description.substructures["bar"].node_dofs
    assert graph.attached_dofs(sensor) == (("bar", nodes.among((0,), directions)),)
    mass = entries[sensor].connection.model.matrices(np.array([[2.0]])).M[0]
    assert np.array_equal(np.diag(mass), [0.0 if each == "rz" else 2.0 for each in directions])
