"""Relative displacements across stiff springs as coordinates, in which their stiffness hides no other.

Where a spring of 1e20 N/m acts between two DOFs, their diagonal entries of the dynamic stiffness have no digits left
for anything softer. With the displacement of one DOF relative to the other as a coordinate, the spring has a single
entry, and the entries of everything else are sums without it, since k - k - k + k is exactly zero.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["in_coordinates", "relative_coordinates", "stiff_springs"]

_PART = 1e-3
"""Part of a diagonal entry that its spring need not explain: what is softer by less loses only three digits."""


def stiff_springs(stiffness: NDArray[Any], numbers: NDArray[np.intp]) -> Iterator[tuple[float, int, int]]:
    """Yield size and DOFs of the springs that dominate the diagonal entries of a joint's matrix.

    Parameters
    ----------
    stiffness : (j, j) array
    numbers : (j,) array
        The number of each of the joint's DOFs; negative where it does not move.
    """
    size = np.abs(stiffness)
    for one, other in zip(*np.triu_indices(len(size), 1), strict=True):
        near = [abs(stiffness[dof, dof] + stiffness[one, other]) <= _PART * size[dof, dof] for dof in (one, other)]
        moving = numbers[one] >= 0 and numbers[other] >= 0 and numbers[one] != numbers[other]
        if moving and size[one, other] > 0.0 and any(near):
            yield float(size[one, other]), int(numbers[one]), int(numbers[other])


def relative_coordinates(size: int, springs: Iterable[tuple[float, int, int]]) -> NDArray[np.float64]:
    """Return T of u = T q, with displacements relative to one another across springs, the stiffest ones first.

    Parameters
    ----------
    size : int
        Number of DOFs.
    springs : iterable of (float, int, int)
        Size and DOFs of each.

    Returns
    -------
    (size, size) array
        Zeros and ones. Each row has a one for its DOF, and for those on the way to the one that its group is relative
        to.
    """
    neighbours: list[list[int]] = [[] for _ in range(size)]
    group = list(range(size))

    def root(dof: int) -> int:
        while group[dof] != dof:
            dof = group[dof]
        return dof

    for _, one, other in sorted(springs, reverse=True):
        if root(one) != root(other):
            group[root(one)] = root(other)
            neighbours[one].append(other)
            neighbours[other].append(one)
    T = np.eye(size)
    seen = [False] * size
    for first in range(size):
        waiting: Sequence[int] = [] if seen[first] else [first]
        seen[first] = True
        while waiting:
            dof, *rest = waiting
            below = [other for other in neighbours[dof] if not seen[other]]
            for other in below:
                seen[other] = True
                T[other] += T[dof]
            waiting = [*rest, *below]
    return T


def in_coordinates(Z: NDArray[Any], rows: NDArray[np.float64]) -> NDArray[Any]:
    """Return R^T Z R of a joint's matrices (n_lines, j, j), with rows R (j, d) of zeros and ones.

    Entries of a coordinate are summed without others, so that equal and opposite ones cancel.
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
