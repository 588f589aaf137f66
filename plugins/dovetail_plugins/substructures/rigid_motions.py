"""Whether coordinates and directions of nodes fit a stiffness matrix: a free part turns without strain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dovetail import DIRECTIONS, Direction, DofTable, DovetailError, Fault, is_rotation

_INEXACT, _WRONG = 1e-5, 1e-3
"""Strain energy of a rotation over that of a shear of the same size from which it is reported, and from which it is an
error. For coordinates that are off by 1 % it is 1e-4 and less."""
_NONE, _SOME = 1e-11, 1e-8
"""Relative strain energy that is none but for rounding, and one that is some."""
_ABOVE_ROUNDING = 100.0
"""Strain energy of a rotation over that of displacements, which is rounding in a free part, from which it counts."""
_SPEEDS = 10.0, 1e5
"""Speeds of waves [m/s] beyond which there is a warning. A wrong unit of length changes them by 1000."""
_UNEQUAL = 0.02
"""Relative difference of the masses along the axes from which it is reported."""
_FEW = 2000
"""DOFs without a known place up to which these are made to follow the others."""


class PlacedDofs(NamedTuple):
    """DOFs whose place and direction are known.

    Parameters
    ----------
    rows : (n,) int array
        Rows of the matrices.
    vectors : (n, 3) array
        Unit vectors along which, or about which, they move.
    turns : (n,) bool array
        Which are rotations.
    points : (n, 3) array
        Where they are, in the unit of length of the matrices.
    """

    rows: NDArray[np.intp]
    vectors: NDArray[np.float64]
    turns: NDArray[np.bool_]
    points: NDArray[np.float64]

    def can_turn(self, axis: int) -> bool:
        """Return whether the DOFs say how the part turns about an axis (0 to 2)."""
        moved, turned = (np.any(self.vectors[which], axis=0) for which in (~self.turns, self.turns))
        across = np.delete(moved, axis)
        return bool(across.all() or (turned[axis] and across.any()))


class StrainedRotation(NamedTuple):
    """A rotation that strains a free part: the axis (0 to 2), its relative strain energy, the row with most of it."""

    axis: int
    ratio: float
    row: int


class _Strain(NamedTuple):
    """Strain energy of a motion, the same relative to its terms without their signs, and the row with most of it."""

    energy: float
    relative: float
    row: int


def strained_rotation(K: Any, placed: PlacedDofs) -> StrainedRotation | None:
    """Return the rotation that strains a part most, if the part is free to move along all axes; otherwise None.

    Parameters
    ----------
    K : (d, d) sparse array
        Symmetric.
    placed : PlacedDofs

    Notes
    -----
    What nothing holds moves along and about any axis without strain. If it does so along the axes, but not about them,
    then coordinates and directions do not give a rotation.
    """
    inner = np.setdiff1d(np.arange(K.shape[0]), placed.rows)
    if not placed.rows.size or inner.size > _FEW:
        return None
    points, axes, strained = placed.points - placed.points.mean(axis=0), np.eye(3), list[StrainedRotation]()
    along = [_strain(K, placed, inner, np.broadcast_to(axis, points.shape), 0 * axis) for axis in axes]
    floor = _ABOVE_ROUNDING * max(np.finfo(float).eps, *(strain.relative for strain in along))
    for number, axis in enumerate(axes):
        if not placed.can_turn(number):
            continue
        motion = np.cross(axis, points)
        turned = _strain(K, placed, inner, motion, axis)
        shear = motion * np.where(np.arange(3) == (number + 1) % 3, -1.0, 1.0)
        reference = _strain(K, placed, inner, shear, 0 * axis).energy
        ratio = turned.energy / reference if reference else np.inf
        if turned.relative > floor and ratio > _INEXACT:
            strained.append(StrainedRotation(number, ratio, turned.row))
    return max(strained, key=lambda rotation: rotation.ratio, default=None)


def exchanged_axis(K: Any, placed: PlacedDofs) -> int | None:
    """Return the axis about which equal rotations, without displacements, strain nothing, as no body's do; or None.

    Parameters
    ----------
    K : (d, d) sparse array
        Symmetric.
    placed : PlacedDofs
    """
    inner = np.setdiff1d(np.arange(K.shape[0]), placed.rows)
    if not placed.turns.any() or placed.turns.all() or inner.size > _FEW:
        return None
    still, axes = np.zeros_like(placed.points), np.eye(3)
    along = [_strain(K, placed, inner, still + axis, 0 * axis).relative for axis in axes]
    for number, axis in enumerate(axes):
        coupled = (abs(K) @ np.abs(_moved(K, placed, inner, still, axis)))[placed.rows[~placed.turns]]
        turned = _strain(K, placed, inner, still, axis).relative
        if coupled.any() and turned < _NONE and max(along) > _SOME:
            return number
    return None


def wave_speed(M: Any, K: Any, placed: PlacedDofs) -> float | None:
    """Return the speed of waves that a uniform stretch of a part and its mass give, in the units of the matrices.

    The largest one along the three axes: about 5000 m/s for metals, less if the part is not straight or carries masses.
    None if it is not known.

    Parameters
    ----------
    M, K : (d, d) sparse array
        Symmetric.
    placed : PlacedDofs
    """
    inner = np.setdiff1d(np.arange(K.shape[0]), placed.rows)
    if not placed.rows.size or inner.size > _FEW:
        return None
    points, squares, still = placed.points - placed.points.mean(axis=0), list[float](), np.zeros(3)
    for axis in np.eye(3):
        moved = _moved(K, placed, inner, np.broadcast_to(axis, points.shape), still)
        stretched = _strain(K, placed, inner, points * axis, still)
        if (mass := float(moved @ (M @ moved))) > 0:
            squares.append(stretched.energy / mass)
    return float(np.sqrt(max(squares, default=0.0))) or None


def unlike_a_body(M: Any, K: Any, placed: PlacedDofs) -> str:
    """Return how the mass of a part differs from that of a body, which is the same along all axes, or ''.

    Parameters
    ----------
    M, K : (d, d) sparse array
        Symmetric.
    placed : PlacedDofs
    """
    inner = np.setdiff1d(np.arange(K.shape[0]), placed.rows)
    counts = np.abs(placed.vectors[~placed.turns]).sum(axis=0)
    if inner.size > _FEW or not counts.all() or np.ptp(counts):  # at some nodes displacements are held, or unknown
        return ""
    points, still = placed.points - placed.points.mean(axis=0), np.zeros(3)
    along = [_moved(K, placed, inner, np.broadcast_to(axis, points.shape), still) for axis in np.eye(3)]
    turns = [_moved(K, placed, inner, np.cross(axis, points), axis) for axis in np.eye(3)]
    masses, couplings = (
        np.array([[one @ (M @ other) for one in along] for other in motions]) for motions in (along, turns)
    )
    mass, size = float(np.trace(masses)) / 3.0, float(np.ptp(points, axis=0).max())
    if np.abs(masses - mass * np.eye(3)).max() > _UNEQUAL * mass:
        x, y, z = np.diag(masses) / mass
        return f"its masses along x, y and z are {x:.3g}, {y:.3g} and {z:.3g} of their mean"
    if np.abs(couplings + couplings.T).max() > _UNEQUAL * mass * size:
        return "its mass has no centre"
    return ""


def _strain(
    K: Any, placed: PlacedDofs, inner: NDArray[np.intp], motion: NDArray[np.float64], turn: NDArray[np.float64]
) -> _Strain:
    """Return the strain of displacements (n, 3) of the points and a rotation (3,), which inner DOFs follow."""
    moved = _moved(K, placed, inner, motion, turn)
    energies, terms = moved * (K @ moved), np.abs(moved) @ (abs(K) @ np.abs(moved))
    energy = abs(float(energies.sum()))
    return _Strain(energy, energy / terms if terms else 0.0, int(np.argmax(np.abs(energies))))


def _moved(
    K: Any, placed: PlacedDofs, inner: NDArray[np.intp], motion: NDArray[np.float64], turn: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return displacements (n, 3) of the points and a rotation (3,) as a motion (d,) of all DOFs."""
    moved = np.zeros(K.shape[0])
    moved[placed.rows] = np.where(placed.turns, placed.vectors @ turn, np.sum(placed.vectors * motion, axis=1))
    load = (K @ moved)[inner]
    if np.any(np.abs(load) > np.finfo(float).eps * (abs(K) @ np.abs(moved))[inner]):
        moved[inner] = -np.linalg.lstsq(K.tocsr()[inner][:, inner].toarray(), load, rcond=None)[0]
    return moved


def check_places(
    M: Any, K: Any, table: DofTable, words: Mapping[Direction, str], where: str, speed: float
) -> tuple[str, ...]:
    """Raise an error if places of nodes contradict the stiffness, and return warnings about places, mass and units.

    Parameters
    ----------
    M, K : (d, d) sparse array
    table : DofTable
    words : mapping of directions to str
        The table's words for the directions, after a minus if their sense is the opposite one.
    where : str
        The file of K.
    speed : float
        Unit of speed of the matrices [m/s].

    Raises
    ------
    DovetailError
    """
    placed, warnings = _placed(table, words), list[str]()
    if (axis := exchanged_axis(K, placed)) is not None:
        problem = f"the part moves freely if all rotations about {DIRECTIONS[axis]} are equal, and not along its axes."
        remedy = "Are rotations and displacements exchanged in the table of DOFs, or in the options?"
        raise DovetailError(Fault(where, problem, "a stiffness without strain in displacements", remedy))
    if (rotation := strained_rotation(K, placed)) is not None:
        about, most = DIRECTIONS[rotation.axis], table.label(rotation.row)
        problem = f"the part moves freely along all axes, but a rotation about {about} strains it, most at {most}"
        if rotation.ratio > _WRONG:
            remedy = "Are positions or coordinates those of this model, in its unit of length? Are directions right, "
            remedy += "with their signs?"
            raise DovetailError(Fault(where, f"{problem}.", "a stiffness without strain in rotations", remedy))
        share = 100 * np.sqrt(rotation.ratio)
        warnings.append(f"{problem}, by {share:.2g} % of a shear: positions or coordinates are inexact.")
    if table.points is not None and (waves := wave_speed(M, K, placed)):
        lowest, highest = _SPEEDS
        if not lowest < speed * waves < highest:
            text = f"its mass, stiffness and size give waves a speed of {speed * waves:.2g} m/s (about 5000 in metals)"
            warnings.append(f"{text}: are 'units' those of the file?")
    if problem := unlike_a_body(M, K, placed):
        warnings.append(f"{problem}, and a body has one mass: are the rows of M those of K?")
    return tuple(warnings)


def _placed(table: DofTable, words: Mapping[Direction, str]) -> PlacedDofs:
    """Return the DOFs of the nodes; those of a plane part lie on an axis along -y, so that rz is the slope of x."""
    points = table.points
    if points is None:
        along = np.zeros(len(table.rows)) if table.positions is None else -table.positions
        points = np.outer(along, [0.0, 1.0, 0.0])
    meaning = {word.lstrip("-"): (direction, word.startswith("-")) for direction, word in words.items()}
    known = np.flatnonzero([word in meaning for word in table.directions])
    if table.points is None and table.positions is None:
        known = known[:0]
    directions = [meaning[table.directions[index]] for index in known]
    axes = [(-1.0 if is_opposite else 1.0) * _axis(direction) for direction, is_opposite in directions]
    turns = np.array([is_rotation(direction) for direction, _ in directions], dtype=bool)
    return PlacedDofs(table.rows[known], np.array(axes).reshape(-1, 3), turns, points[known])


def _axis(direction: Direction) -> NDArray[np.float64]:
    return np.asarray(np.eye(3)[DIRECTIONS.index(direction) % 3])
