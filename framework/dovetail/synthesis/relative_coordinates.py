"""Relative displacements across stiff springs as coordinates, in which softer stiffness keeps its digits.

Where a spring of 1e20 N/m acts between two DOFs, their diagonal entries of the dynamic stiffness have no digits left
for anything softer. With the displacement of one DOF relative to the other as a coordinate, the spring has a single
entry, and the entries of everything else are sums without it, since k - k - k + k is exactly zero.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_NOTICED = 1e-6
"""Relative error from which lost digits are reported."""

_PART = 1e-3
"""Share of a spring's stiffness above which another stiffness loses at most three digits to it."""


def stiff_springs(
    stiffness: NDArray[Any], numbers: NDArray[np.intp], others: NDArray[np.float64]
) -> Iterator[tuple[float, int, int]]:
    """Yield size and DOFs of the springs of a joint that hide other stiffness.

    Parameters
    ----------
    stiffness : (j, j) array
        Stiffness matrix of the joint.
    numbers : (j,) array
        The number of each of the joint's DOFs; negative where it does not move.
    others : (d,) array
        Diagonal entries of everything except joints, such as the inertia of masses; 0 for a joint's inner DOFs.
    """
    size, softness = np.abs(stiffness), np.append(np.where(others != 0.0, np.abs(others), np.inf), np.inf)
    for one, other in zip(*np.triu_indices(len(size), 1), strict=True):
        near = [abs(stiffness[dof, dof] + stiffness[one, other]) <= _PART * size[dof, dof] for dof in (one, other)]
        ends = max(int(numbers[one]), -1), max(int(numbers[other]), -1)
        hides = size[one, other] * _PART > min(softness[ends[0]], softness[ends[1]])
        if ends[0] != ends[1] and hides and any(near):
            yield float(size[one, other]), *ends


def rounded(stiffness: NDArray[Any]) -> NDArray[np.float64]:
    """Return the rounding (j,) of the diagonal entries of a joint's matrix that are sums of stiff and soft stiffness.

    It is zero for rows with springs only, whose entries cancel exactly.
    """
    size = np.abs(stiffness)
    springs = size.sum(axis=1) == 2.0 * np.diagonal(size)
    return np.where(springs, 0.0, np.finfo(np.float64).eps * np.diagonal(size))


def warn_of_lost_digits(what: str, relative: float) -> None:
    """Warn if rounding in joints changes something by more than a millionth of it."""
    if relative > _NOTICED:
        digits = max(0, int(-np.log10(min(relative, 1.0))))
        message = f"a joint is so stiff that rounding in its matrices leaves {digits} digits of {what}."
        warnings.warn(f"{message} Use less stiffness, or a rigid joint.", stacklevel=2)


def relative_coordinates(size: int, springs: Iterable[tuple[float, int, int]]) -> NDArray[np.float64]:
    """Return T of u = T q, with displacements relative to one another across springs, the stiffest ones first.

    Parameters
    ----------
    size : int
        Number of DOFs.
    springs : iterable of (float, int, int)
        Size and DOFs of each; -1 for a fixed end, to which the displacement is then relative.

    Returns
    -------
    (size, size) array
        Zeros and ones. Each row has a one for its DOF, and for the DOFs on the path to the reference of its group.
    """
    neighbours: list[list[int]] = [[] for _ in range(size + 1)]
    group = list(range(size + 1))

    def root(dof: int) -> int:
        while group[dof] != dof:
            dof = group[dof]
        return dof

    for _, one, other in sorted(springs, reverse=True):
        if root(one % (size + 1)) != root(other % (size + 1)):
            group[root(one % (size + 1))] = root(other % (size + 1))
            neighbours[one].append(other % (size + 1))
            neighbours[other].append(one % (size + 1))
    T = np.eye(size + 1, size)
    seen = [False] * (size + 1)
    for first in (size, *range(size)):
        waiting: Sequence[int] = [] if seen[first] else [first]
        seen[first] = True
        while waiting:
            dof, *rest = waiting
            below = [other for other in neighbours[dof] if not seen[other]]
            for other in below:
                seen[other] = True
                T[other] += T[dof]
            waiting = [*rest, *below]
    return T[:size]


def in_coordinates(Z: NDArray[Any], rows: NDArray[np.float64]) -> NDArray[Any]:
    """Return R^T Z R of a joint's matrices (n_lines, j, j), with rows R (j, d) of zeros and ones.

    The entries of each coordinate are summed separately, so that opposite ones cancel exactly.
    """
    used = np.flatnonzero(rows.any(axis=0))
    if not len(used):
        return np.zeros((len(Z), rows.shape[1], rows.shape[1]), dtype=Z.dtype)
    R = rows[:, used]
    reduced = np.stack([Z[:, :, R[:, column] != 0.0].sum(axis=2) for column in range(len(used))], axis=2)
    reduced = np.stack([reduced[:, R[:, column] != 0.0].sum(axis=1) for column in range(len(used))], axis=1)
    whole = np.zeros((len(Z), rows.shape[1], rows.shape[1]), dtype=Z.dtype)
    whole[:, used[:, None], used] = reduced
    return whole
