"""The declarations and the computed results of a joint or a substructure, for comparison between processes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import JointModel, SparseMatrices, StructuralMatrices, SubstructureModel
from dovetail.testing.linear_algebra import dense, has_idle_motion

PARTS = {"M": "mass", "K": "stiffness", "C": "viscous damping", "D": "structural damping"}
_VECTORS = 6
"""Random parameter vectors of each answer."""
_LINES = np.array([400.0, 30.0, 1500.0])
_JOINT = ("parameters", "ports", "internal_dofs", "merged_dofs", "contact_dofs", "config")
_SUBSTRUCTURE = ("nodes", "held", "grounded", "condensation_tolerance", "config")


def answers(component: Any, question: int = 0) -> dict[str, Any]:
    """Return everything that a joint or a substructure computes.

    Parameters
    ----------
    component : JointModel or SubstructureModel
    question : int
        Selects the parameter vectors, or the lines; the shapes of the arrays are always the same.

    Returns
    -------
    dict of str to array
        The arrays that it returned, not copies.
    """
    lines = _LINES * (1.0 + 0.1 * question)
    if isinstance(component, JointModel):
        return _joint_answers(component, lines, question)
    return _substructure_answers(component, lines)


def declarations(component: Any) -> dict[str, str]:
    """Return the declarations of a component as texts that can be compared."""
    if isinstance(component, JointModel):
        values = {name: _read(component, name) for name in _JOINT}
        ends = ({each.name: getattr(each, end) for each in component.parameters} for end in ("lower", "upper"))
        values["range_objections"] = repr(dict(component.range_objections(*ends)))
        return values
    values = {name: _read(component, name) for name in _SUBSTRUCTURE}
    values["absent_dofs"] = repr(sorted(component.absent_dofs))
    values["constraints"] = repr(np.asarray(component.constraints).tolist())
    values["dof_label"] = repr([component.dof_label(dof) for dof in range(component.node_dofs.size)])
    return values


def has_receptance(part: SubstructureModel, matrices: StructuralMatrices | SparseMatrices | None) -> bool:
    """Return whether forces should move a part with these matrices by finite amounts: no ground, nor free without mass.

    Inner DOFs that move without a force while the nodes are fixed do not count.
    """
    if part.grounded or matrices is None:
        return not part.grounded
    whole = [dense(getattr(matrices, name)) for name in "KMCD"]
    count = part.node_dofs.size
    return not has_idle_motion(*whole) or has_idle_motion(*(matrix[count:, count:] for matrix in whole))


def copied(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return copies of arrays."""
    return {name: np.array(array) for name, array in arrays.items()}


def difference(some: Mapping[str, NDArray[Any]], others: Mapping[str, NDArray[Any]], limit: float = 0.0) -> str:
    """Return the name of the first array that differs between two sets, or an empty text.

    Parameters
    ----------
    some, others : mapping of str to array
    limit : float
        Allowed difference, relative to the largest entry.
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
    """Return a component of the same class with all float options a tenth larger, or None if that is impossible."""
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
        return "not defined"


def _joint_answers(joint: JointModel, lines: NDArray[np.float64], question: int) -> dict[str, Any]:
    fractions = np.random.default_rng(question).random((_VECTORS, len(joint.parameters)))
    columns = [parameter.from_unit(fractions[:, index]) for index, parameter in enumerate(joint.parameters)]
    theta = np.stack(columns, axis=1) if columns else np.empty((_VECTORS, 0))
    matrices = joint.matrices(theta.copy())
    values = {f"the {noun} matrix": getattr(matrices, part) for part, noun in PARTS.items()}
    values["the dynamic stiffness"] = joint.dynamic_stiffness(lines.copy(), theta.copy())
    for parameter, derivative in zip(joint.parameters, joint.matrices_jacobian(theta.copy()), strict=True):
        values |= {f"the derivative of {part} by {parameter.name}": getattr(derivative, part) for part in PARTS}
    return values


def _substructure_answers(substructure: SubstructureModel, lines: NDArray[np.float64]) -> dict[str, Any]:
    matrices, values = substructure.matrices(), {}
    for part, noun in PARTS.items() if matrices is not None else ():
        matrix = getattr(matrices, part)
        values[f"the {noun} matrix"] = matrix if isinstance(matrices, StructuralMatrices) else matrix.data
    if has_receptance(substructure, matrices):
        absent = {*substructure.absent_dofs, *_empty(matrices, substructure.node_dofs.size)}
        dofs = [dof for dof in range(substructure.node_dofs.size) if dof not in absent]
        values["the receptance"] = substructure.receptance(lines.copy(), dofs[:4])
    return values


def _empty(matrices: Any, count: int) -> list[int]:
    """Return the DOFs of the nodes for which no matrix has an entry."""
    if matrices is None:
        return []
    filled = sum(np.asarray(abs(getattr(matrices, part)).sum(axis=0)).ravel() for part in PARTS)
    return [int(dof) for dof in np.flatnonzero(np.asarray(filled)[:count] == 0)]
