"""What a joint or a substructure says of itself, and what it answers: the same questions in any process."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import DIRECTIONS, JointModel, StructuralMatrices, SubstructureModel

__all__ = ["PARTS", "answers", "copied", "declarations", "difference", "varied"]

PARTS = {"M": "mass", "K": "stiffness", "C": "viscous damping", "D": "structural damping"}
_VECTORS = 6
_LINES = np.array([400.0, 30.0, 1500.0])
_JOINT = ("parameters", "ports", "internal_dofs", "merged_dofs", "contact_dofs", "config")
_SUBSTRUCTURE = ("nodes", "held", "grounded", "condensation_tolerance", "config")


def answers(component: Any, question: int = 0) -> dict[str, Any]:
    """Ask a joint or a substructure for all that it computes.

    Parameters
    ----------
    component : JointModel or SubstructureModel
    question : int
        Another number asks for other parameter vectors, or lines, in arrays of the same shapes.

    Returns
    -------
    dict of str to array
        The very arrays that it returned.
    """
    lines = _LINES * (1.0 + 0.1 * question)
    if isinstance(component, JointModel):
        return _of_joint(component, lines, question)
    return _of_substructure(component, lines)


def declarations(component: Any) -> dict[str, str]:
    """Return what a component declares, in words that can be compared."""
    if isinstance(component, JointModel):
        said = {name: _read(component, name) for name in _JOINT}
        ends = ({each.name: getattr(each, end) for each in component.parameters} for end in ("lower", "upper"))
        said["range_objections"] = repr(dict(component.range_objections(*ends)))
        return said
    said = {name: _read(component, name) for name in _SUBSTRUCTURE}
    said["absent_dofs"] = repr(sorted(component.absent_dofs))
    said["dof_label"] = repr([component.dof_label(dof) for dof in range(len(DIRECTIONS) * len(component.nodes))])
    return said


def copied(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return arrays that nobody else holds."""
    return {name: np.array(array) for name, array in arrays.items()}


def difference(some: Mapping[str, NDArray[Any]], others: Mapping[str, NDArray[Any]], limit: float = 0.0) -> str:
    """Return what the first of two sets of arrays is that differ, an empty text where none does.

    Parameters
    ----------
    some, others : mapping of str to array
    limit : float
        Difference that is allowed, relative to the greatest entry.
    """
    for name in [*some, *others]:
        if name not in some or name not in others or some[name].shape != others[name].shape:
            return name
        first, second = some[name], others[name]
        greatest = np.abs(second[np.isfinite(second)]).max(initial=0.0)
        if not np.allclose(first, second, rtol=0.0, atol=limit * greatest, equal_nan=True):
            return name
    return ""


def varied(component: Any) -> Any:
    """Return a component of the same class with each number among its options a tenth larger, None where none is."""
    options = component.config.model_dump(mode="json", by_alias=True)
    larger = _larger(options)
    if larger == options:
        return None
    try:
        return type(component)(type(component.config).model_validate(larger))
    except Exception:  # options may depend on each other, and a constructor raises what it likes
        return None


def _larger(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _larger(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_larger(entry) for entry in value]
    return 1.1 * value if isinstance(value, float) else value


def _read(component: Any, name: str) -> str:
    try:
        return repr(getattr(component, name))
    except NotImplementedError:
        return "not said"


def _of_joint(joint: JointModel, lines: NDArray[np.float64], question: int) -> dict[str, Any]:
    fractions = np.random.default_rng(question).random((_VECTORS, len(joint.parameters)))
    columns = [parameter.from_unit(fractions[:, index]) for index, parameter in enumerate(joint.parameters)]
    theta = np.stack(columns, axis=1) if columns else np.empty((_VECTORS, 0))
    matrices = joint.matrices(theta.copy())
    said = {f"the {noun} matrix": getattr(matrices, part) for part, noun in PARTS.items()}
    said["the dynamic stiffness"] = joint.dynamic_stiffness(lines.copy(), theta.copy())
    for parameter, derivative in zip(joint.parameters, joint.matrices_jacobian(theta.copy()), strict=True):
        said |= {f"the derivative of {part} by {parameter.name}": getattr(derivative, part) for part in PARTS}
    return said


def _of_substructure(substructure: SubstructureModel, lines: NDArray[np.float64]) -> dict[str, Any]:
    matrices, said = substructure.matrices(), {}
    for part, noun in PARTS.items() if matrices is not None else ():
        matrix = getattr(matrices, part)
        said[f"the {noun} matrix"] = matrix if isinstance(matrices, StructuralMatrices) else matrix.data
    if not substructure.grounded:
        absent = {*substructure.absent_dofs, *_empty(matrices, len(DIRECTIONS) * len(substructure.nodes))}
        dofs = [dof for dof in range(len(DIRECTIONS) * len(substructure.nodes)) if dof not in absent]
        said["the receptance"] = substructure.receptance(lines.copy(), dofs[:4])
    return said


def _empty(matrices: Any, count: int) -> list[int]:
    """Return the DOFs of the nodes that no matrix has an entry for."""
    if matrices is None:
        return []
    filled = sum(np.asarray(abs(getattr(matrices, part)).sum(axis=0)).ravel() for part in PARTS)
    return [int(dof) for dof in np.flatnonzero(np.asarray(filled)[:count] == 0)]
