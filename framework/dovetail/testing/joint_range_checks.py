"""Checks of joints: objections to ranges, and finer meshes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from dovetail.interfaces import JointModel, StructuralMatrices
from dovetail.testing.linear_algebra import least_eigenvalue
from dovetail.testing.outcomes import Nonconformity, NotApplicable
from dovetail.testing.specimen import SEED
from dovetail.testing.specimens import JointSpecimen

_PARTS_OF_RANGES = 40
"""Random parts of the ranges in which a component may be used."""
_ROUNDING = 1e-9
"""Relative difference by rounding at most."""
_FACTORS = (2, 4)
_STIFFNESS = 0.5
"""Largest relative change of the static stiffness with a mesh four times as fine, above which the mesh is useless."""
_LENGTHS = "Check how the matrices depend on the length of an element."
_MASS = 0.01
"""Largest relative change of the mass with a finer mesh, for a curved or tapered body of few elements."""


def check_default_ranges_are_accepted(specimen: JointSpecimen) -> None:
    """`range_objections` has no objection to the joint's default ranges."""
    parameters = specimen.component.parameters
    ends = (np.array([[getattr(each, end) for each in parameters]], dtype=float) for end in ("lower", "upper"))
    for name, objection in _objections(specimen, *ends).items():
        raise Nonconformity(
            f"it refuses its default range of {name}: {objection}", "Change the range of the parameter."
        )


def check_parts_of_default_ranges_are_accepted(specimen: JointSpecimen) -> None:
    """`range_objections` has no objection to a part of these ranges, or a known value within them."""
    ends = np.sort(np.random.default_rng(SEED).random((2, _PARTS_OF_RANGES, _count(specimen))), axis=0)
    ends[1, ::3] = ends[0, ::3]  # known values
    ends[:, 1::3, ::2] = np.array([0.0, 1.0])[:, None, None]  # some parameters over the whole range
    lower, upper = specimen.vectors(ends[0]), specimen.vectors(ends[1])
    for row in range(_PARTS_OF_RANGES):
        for name, objection in _objections(specimen, lower[row : row + 1], upper[row : row + 1]).items():
            problem = f"it refuses a part of its default range of {name}: {objection}"
            raise Nonconformity(problem, "Compare the ends with limits, not with each other; they may be equal.")


def check_impossible_ranges_are_refused(specimen: JointSpecimen) -> None:
    """`range_objections` returns a sentence for a negative range if the matrices there are not those of a joint."""
    names = [parameter.name for parameter in specimen.component.parameters]
    middle = specimen.theta[:1]
    for column, parameter in enumerate(specimen.component.parameters):
        if parameter.lower < 0:
            continue
        lower = middle.copy()
        lower[:, column] = -parameter.upper
        objections = _objections(specimen, lower, middle)
        for name, objection in objections.items():
            if name not in names or not isinstance(objection, str) or not objection.strip():
                problem = (
                    f"for negative {parameter.name} range_objections returned {{{name!r:.30}: {objection!r:.50}}}."
                )
                raise Nonconformity(problem, "Return a sentence by the name of the parameter at fault.")
        if not objections and not _is_a_joint(specimen, lower):
            problem = (
                f"it accepts {parameter.name} = {-parameter.upper:.4g}, but its matrices are then not those of a joint."
            )
            raise Nonconformity(problem, "Begin with objections = dict(super().range_objections(lower, upper)).")


def check_a_finer_mesh_is_the_same_joint(specimen: JointSpecimen) -> None:
    """`refined` keeps parameters, ports and mass, and the static stiffness converges."""
    finer = [specimen.component.refined(factor) for factor in _FACTORS]
    if None in finer:
        raise NotApplicable("the joint has no mesh to refine.")
    meshes = [mesh for mesh in (specimen.component, *finer) if isinstance(mesh, JointModel)]
    if len(meshes) <= len(_FACTORS):
        raise Nonconformity("refined returned no joint.", "Return the same joint with a finer mesh.")
    for name in ("parameters", "ports"):
        if any(getattr(mesh, name) != getattr(meshes[0], name) for mesh in meshes):
            raise Nonconformity(f"refined returned a joint with other {name}.", "Change the mesh only.")
    theta = specimen.some(16)
    on_ports = meshes[0].size - meshes[0].internal_dofs
    static, masses = zip(*(_at_rest(mesh.matrices(theta.copy()), on_ports) for mesh in meshes), strict=True)
    if (np.abs(masses[2] - masses[0]) > _MASS * np.abs(masses[0])).any():
        problem = f"with a mesh four times as fine its mass changes from {masses[0][0]:.4g} to {masses[2][0]:.4g} kg."
        raise Nonconformity(problem, "Give each element the mass of its own length.")
    stiffness = [np.diagonal(each, axis1=1, axis2=2) for each in static]
    if (np.abs(stiffness[2] - stiffness[0]) > _STIFFNESS * np.abs(stiffness[2])).any():
        raise Nonconformity("with a mesh four times as fine its static stiffness differs.", _LENGTHS)
    first, second = (np.abs(each - static[2]).max(axis=(1, 2)) for each in static[:2])
    if (second > 0.5 * first + _ROUNDING * np.abs(static[2]).max(axis=(1, 2))).any():
        problem = "with a finer mesh its stiffness at rest changes more and more."
        raise Nonconformity(problem, _LENGTHS)


def _at_rest(matrices: StructuralMatrices, on_ports: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the static stiffness (n, d, d) at the ports, with other DOFs free, and the mass (n,) in translation."""
    K, size = matrices.K, matrices.K.shape[-1]
    follow = -np.linalg.pinv(K[:, on_ports:, on_ports:], hermitian=True) @ K[:, on_ports:, :on_ports]
    motion = np.concatenate([np.broadcast_to(np.eye(on_ports), (len(K), on_ports, on_ports)), follow], axis=1)
    static = np.swapaxes(motion, 1, 2) @ K @ motion
    displaced = motion[:, :, 0::2].sum(axis=2)
    assert displaced.shape == (len(K), size)
    return static, np.einsum("ni,nij,nj->n", displaced, matrices.M, displaced)


def _is_a_joint(specimen: JointSpecimen, theta: NDArray[np.float64]) -> bool:
    try:
        with np.errstate(all="ignore"):
            matrices = specimen.component.matrices(theta.copy())
    except Exception:  # a plugin may raise anything
        return False
    values = [getattr(matrices, part) for part in "MKCD"]
    return all(np.isfinite(value).all() and least_eigenvalue(value).min() > -_ROUNDING for value in values)


def _objections(specimen: JointSpecimen, lower: NDArray[np.float64], upper: NDArray[np.float64]) -> Mapping[str, str]:
    """Return the objections to ranges from one parameter vector (1, n_params) to another."""
    names = [parameter.name for parameter in specimen.component.parameters]
    ends = (dict(zip(names, vector[0].tolist(), strict=True)) for vector in (lower, upper))
    objections = specimen.component.range_objections(*ends)
    if not isinstance(objections, Mapping):
        raise Nonconformity(f"range_objections returned {type(objections).__name__}.", "Return a dict, {} for none.")
    return objections


def _count(specimen: JointSpecimen) -> int:
    return len(specimen.component.parameters)
