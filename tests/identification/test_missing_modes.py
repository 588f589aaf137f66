"""A result without natural frequencies gives the true reason, and one with them lists all."""

from __future__ import annotations

import json

import numpy as np
import pytest

import dovetail
from dovetail.identification.reconstruction import reconstruct
from dovetail.problem import Problem

OUTSIDE = "The identified model has no natural frequency within the assembly's frequencies."


class Creeping(dovetail.JointModel):
    """A spring that depends on frequency."""

    name = "creeping"
    summary = "A spring that depends on frequency"
    parameters = (dovetail.Parameter("k", "N/m", 1e5, 1e7),)
    ports = (dovetail.JointPort("a", 1), dovetail.JointPort("b", 1))

    def matrices(self, theta):
        joint = dovetail.StructuralMatrices.zeros(len(theta), 4)
        joint.K[:] = theta[:, 0, None, None] * np.outer([1, 0, -1, 0], [1, 0, -1, 0])
        return joint

    def dynamic_stiffness(self, frequency, theta):
        return super().dynamic_stiffness(frequency, theta) * (1 + 0.01j)


class Plugin:
    @dovetail.hookimpl
    def dovetail_components(self):
        return [Creeping]


def warnings_of(assembly, theta):
    measured = dovetail.Frf(assembly.frequency, assembly.frf(theta), "accelerance")
    result = reconstruct(Problem.of(assembly, measured), np.array(theta), method="network", provenance={})
    return result.modes, result.warnings


def test_a_joint_that_depends_on_frequency_has_natural_frequencies_too(sdof):
    """One mass of 1 kg on k (1 + 0.01 i)."""
    from dovetail.description import read_description
    from dovetail.registry import Registry

    registry = Registry()
    registry.load_entry_points()
    registry.add(Plugin(), "here")
    description = json.loads(sdof.description.text)
    mount = description["joints"]["mount"]
    description["joints"]["mount"] = {"model": "creeping", "connect": mount["connect"]}
    modes, warnings = warnings_of(dovetail.Assembly(read_description(description, registry)), [1e6])
    (mode,) = modes
    pole = 1j * np.sqrt(1e6 * (1 + 0.01j))
    assert mode.natural_frequency == pytest.approx(abs(pole) / (2 * np.pi), rel=1e-9)
    assert mode.damping_ratio == pytest.approx(-pole.real / abs(pole), rel=1e-9)
    assert warnings == ()


def test_a_natural_frequency_outside_the_axis_gives_a_warning(sdof):
    modes, warnings = warnings_of(sdof, [1e8, 10.0])
    assert modes == ()
    assert OUTSIDE in warnings
    modes, warnings = warnings_of(sdof, [1e6, 10.0])
    assert len(modes) == 1
    assert warnings == ()


@pytest.mark.parametrize("start", ["100 Hz", "1000 Hz"])
def test_every_natural_frequency_of_the_band_is_listed_with_many_modes_below_its_end(start):
    bar = {
        "model": "timoshenko_beam",
        "material": {"young": "210 GPa", "density": "7850 kg/m^3", "poisson": 0.3},
        "sections": [{"length": "1.5 m", "outer": "20 mm", "elements": 60}],
    }
    foot = {
        "model": "spring_damper",
        "direction": "x",
        "connect": {"a": {"to": "bar", "at": 0}, "b": {"to": "ground", "at": 0}},
    }
    assembly = dovetail.load(
        {
            "dovetail": 1,
            "name": "free bar",
            "frequency": {"start": start, "stop": "3000 Hz", "lines": 400},
            "substructures": {"bar": bar, "ground": {"model": "ground"}},
            "joints": {"foot": {**foot, "parameters": {"k": {"range": [1e2, 1e4]}, "c": {"value": 1.0}}}},
            "response": {"at": "bar", "position": 0},
        }
    )
    theta = assembly.from_unit(np.array([0.5]))
    every = assembly.natural_frequencies(theta, count=40)
    expected = every[(every >= assembly.frequency[0]) & (every <= 3000.0)]
    assert np.count_nonzero(every < 3000.0) > 10
    modes, warnings = warnings_of(assembly, theta)
    np.testing.assert_allclose([mode.natural_frequency for mode in modes], expected, rtol=1e-6)
    assert OUTSIDE not in warnings
