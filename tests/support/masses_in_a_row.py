"""Masses of 1 kg in a row with joints between them, and a joint that depends on frequency."""

from __future__ import annotations

import numpy as np

from dovetail import ComponentConfig, JointModel, JointPort, Parameter
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection, Graph

SIGN = np.array([1.0, 0.0, -1.0, 0.0])
"""What the two ends of a spring feel when it is stretched by one."""


class Viscoelastic(JointModel):
    """A layer with a fractional derivative: k + c (i omega)^alpha between the ports (Bagley and Torvik 1983)."""

    name, summary = "viscoelastic", "Test joint"
    parameters = (
        Parameter("k", "N/m", 1e5, 1e7, "log"),
        Parameter("c", "N s^alpha/m", 1e2, 1e4, "log"),
        Parameter("alpha", "1", 0.2, 0.8),
    )
    ports = (JointPort("a", 1), JointPort("b", 1))

    class Config(ComponentConfig):
        """No options."""

    def matrices(self, theta):
        raise AssertionError("the dynamic stiffness says all")

    def dynamic_stiffness(self, frequency, theta):
        k, c, alpha = (column[:, None] for column in theta.T)
        spring = k + c * (2j * np.pi * frequency) ** alpha
        return spring[..., None, None] * np.outer(SIGN, SIGN)


def chain(*joints: JointModel) -> tuple[Graph, list]:
    """Masses of 1 kg in a row with the joints between them; force and response at the first."""
    registry = Registry()
    registry.load_entry_points()
    lumped = registry.find("substructure", "lumped").component
    parts = {f"m{i}": lumped(lumped.Config(masses=[{"mass": 1.0}])) for i in range(len(joints) + 1)}
    connections = {
        f"j{i}": Connection(joint, (Attachment(f"m{i}", (0,)), Attachment(f"m{i + 1}", (0,))))
        for i, joint in enumerate(joints)
    }
    return Graph(parts, connections), [("m0", 0)]


def spring() -> JointModel:
    registry = Registry()
    registry.load_entry_points()
    model = registry.find("joint", "spring_damper").component
    return model(model.Config(direction="x"))
