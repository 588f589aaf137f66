"""Structural damping of joints instead of their viscous damping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dovetail.description.checked import Description, JointEntry
from dovetail.interfaces import ComponentConfig
from dovetail.synthesis.joint_evaluation import depends_on_frequency, joint_matrices
from dovetail.units import Frequency


class DampingSection(ComponentConfig):
    """How a joint is damped.

    Attributes
    ----------
    structural_damping : float
        Frequency at which dampers, as structural damping, are as strong as viscous ones; these by default.
    """

    structural_damping: Frequency | None = None


def has_dampers(joint: JointEntry) -> bool:
    """Return whether a joint has matrices with viscous damping, at the upper ends of its ranges."""
    model = joint.connection.model
    if depends_on_frequency(model):
        return False
    largest = [joint.fixed.get(parameter.name, parameter.upper) for parameter in joint.parameters]
    matrices = joint_matrices(model.name, model, np.array([largest], dtype=np.float64))
    return any(bool(np.any(each.C)) for each in matrices.sets)


def with_damping(description: Description, structural: float | None) -> Description:
    """Return the description with structural damping in all joints, equal at a frequency [Hz], or viscous in all.

    Its text is unchanged.
    """
    joints = description.joints.items()
    damped = {name for name, joint in joints if structural is None or has_dampers(joint)}
    changed = {name: replace(joint, structural_damping=structural) for name, joint in joints if name in damped}
    return replace(description, joints={**description.joints, **changed})
