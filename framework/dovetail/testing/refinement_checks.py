"""Checks of substructures with a mesh: a finer one is the same part, and its results converge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import SubstructureModel
from dovetail.testing.linear_algebra import dense, relative_difference
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimens import FREQUENCY, SubstructureSpecimen
from dovetail.testing.substructure_checks import only_with_receptance, part_matrices

_ROUNDING = 1e-9
"""Relative difference by rounding at most."""
_SOLVED = 1e-6
"""Relative difference that a solved system of equations may have."""
_FACTORS = (2, 4)
_ORDER = 64.0
"""Largest reduction of an error with a mesh twice as fine, that of order six; with more it is a different part."""


def check_refinement_converges(specimen: SubstructureSpecimen) -> None:
    """The receptance converges with meshes twice and four times as fine."""
    part_matrices(specimen)
    only_with_receptance(specimen)
    finer = [specimen.component.refined(factor) for factor in _FACTORS]
    if finer == [None, None]:
        raise NotApplicable("the part has no mesh to refine.")
    if not all(isinstance(part, SubstructureModel) for part in finer):
        raise Nonconformity("refined returned no substructure.", "Return the same part with a finer mesh.")
    parts = [specimen.component, *(part for part in finer if part is not None)]
    if not len(parts[0].nodes) < len(parts[1].nodes) < len(parts[2].nodes):
        raise Nonconformity("refined returned a part without more nodes.", "Multiply its elements by the factor.")
    coarse, fine, finest = (_at_the_ends(part) for part in parts)
    first, second = relative_difference(coarse, finest), relative_difference(fine, finest)
    if not second < 0.5 * first + _SOLVED:
        problem = (
            f"twice as fine its receptance is off by {second:.2g} of that four times as fine; unrefined by {first:.2g}."
        )
        raise Nonconformity(problem, "Check how the matrices depend on the length of an element.")


def check_refinement_keeps_the_mass(specimen: SubstructureSpecimen) -> None:
    """A finer mesh has the same ends and, up to convergence, the same mass; refining twice equals refining once."""
    part_matrices(specimen)
    finer = [specimen.component.refined(factor) for factor in (1, *_FACTORS)]
    if any(part is None for part in finer):
        raise NotApplicable("the part has no mesh to refine.")
    twice = finer[1].refined(2)  # type: ignore[union-attr]
    same = {"refined(1) is": (specimen.component, finer[0]), "refined(2).refined(2) is": (finer[2], twice)}
    for phrase, (part, other) in same.items():
        if not np.isclose(_mass(part), _mass(other), rtol=_ROUNDING, atol=0.0):
            raise Nonconformity(
                f"{phrase} a part of another mass.", "Multiply only the number of elements by the factor."
            )
    ends = [sorted(node.position for node in part.nodes) for part in (specimen.component, *finer[1:])]  # type: ignore[union-attr]
    if not all(np.allclose([each[0], each[-1]], [ends[0][0], ends[0][-1]]) for each in ends):
        raise Nonconformity("with a finer mesh its ends move.", "Keep the length.")
    masses = [_mass(part) for part in (specimen.component, *finer[1:])]
    first, second = abs(masses[1] - masses[0]), abs(masses[2] - masses[1])
    if not second <= 0.5 * first + _SOLVED * masses[0] or first > _ORDER * second + _SOLVED * masses[0]:
        refined = " and ".join(f"{mass:.6g}" for mass in masses[1:])
        problem = f"its mass is {masses[0]:.6g} kg, but {refined} kg with meshes twice and four times as fine."
        raise Nonconformity(problem, "Give each element the mass of its own length, and keep all masses.")


def _mass(part: SubstructureModel | None) -> float:
    """Return the mass [kg] in translation, with all nodes displaced equally and inner DOFs following."""
    assert part is not None
    matrices = part.matrices()
    assert matrices is not None
    M, K, outer = dense(matrices.M), dense(matrices.K), part.node_dofs.size
    motion = np.zeros(len(M))
    motion[:outer] = _along_first(part)
    motion[outer:] = -np.linalg.pinv(K[outer:, outer:], hermitian=True) @ K[outer:, :outer] @ motion[:outer]
    return float(motion @ M @ motion)


def _along_first(part: SubstructureModel) -> NDArray[np.float64]:
    """Return the rigid motion (n_dofs,) along the first of the part's directions."""
    _, first = part.node_dofs[0]
    return np.array([direction == first for _, direction in part.node_dofs], dtype=np.float64)


def _at_the_ends(part: SubstructureModel) -> NDArray[np.complex128]:
    positions = [node.position for node in part.nodes]
    ends = [part.node_dofs.at_node(int(choose(positions)))[0] for choose in (np.argmin, np.argmax)]
    return part.receptance(FREQUENCY.copy(), ends)
