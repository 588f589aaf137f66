"""Symbolic elimination: order, fill and steps of the LDL^T, determined once for all samples and frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Program:
    """The steps of a complex-symmetric elimination of all DOFs except the kept ones.

    Slots number the non-zeros of the lower triangle, including fill. Pivot p uses the slots
    ``column[start[p]:start[p + 1]]`` below its diagonal; its updates are

        slot[target] -= slot[row] * slot[other] / slot[diagonal[p]]

    for each of ``update[update_start[p]:update_start[p + 1]]``, where row and other count from ``start[p]``.

    Parameters
    ----------
    pivots : int
        Number of DOFs that are eliminated.
    order : (size,) array
        The DOFs in the order of elimination, the kept ones last.
    rows, columns : (n_slots,) arrays
        DOFs of each slot; the row follows the column in the order.
    diagonal : (size,) array
        Slot of each pivot.
    start : (pivots + 1,) array
    column : array
        Slots below the pivots.
    update_start : (pivots + 1,) array
    update : (n_updates, 3) array
        Target slot, and row and other as indices into the pivot's part of `column`.
    """

    pivots: int
    order: NDArray[np.int64]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    diagonal: NDArray[np.int64]
    start: NDArray[np.int64]
    column: NDArray[np.int64]
    update_start: NDArray[np.int64]
    update: NDArray[np.int64]

    @property
    def slots(self) -> int:
        """Number of non-zeros of the lower triangle, including fill."""
        return len(self.rows)

    @cached_property
    def multiplications(self) -> int:
        """Number of complex multiplications per frequency, including divisions by the pivots."""
        return len(self.update) + len(self.column) + self.pivots + 1

    @cached_property
    def _slot_of(self) -> NDArray[np.intp]:
        """Slot (size, size) of each entry, from either half; -1 for those that are zero."""
        slots = np.full((len(self.order),) * 2, -1, dtype=np.intp)
        slots[self.rows, self.columns] = slots[self.columns, self.rows] = np.arange(self.slots)
        return slots

    def entries(self, indices: NDArray[np.intp], filled: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
        """Return (row, column, slot) of the lower triangle, and of both halves if two local DOFs are merged.

        Parameters
        ----------
        indices : (n,) array of int
            DOFs of the system.
        filled : (n, n) bool array
            Which entries between them are wanted.
        """
        entries = []
        for row, column in zip(*np.nonzero(filled), strict=True):
            slot = int(self._slot_of[indices[row], indices[column]])
            if slot >= 0 and (column <= row or indices[row] == indices[column]):
                entries.append((int(row), int(column), slot))
        return entries


def plan_elimination(pattern: NDArray[np.bool_], keep: Sequence[int], order: Sequence[int] = ()) -> Program:
    """Order the DOFs by minimum degree, the kept ones last, and list the steps of their elimination.

    Parameters
    ----------
    pattern : (d, d) bool array
        Non-zero entries of the symmetric system.
    keep : sequence of int
        DOFs that are kept. After the elimination their slots contain the Schur complement; for a single DOF, its
        inverse is the receptance at this DOF.
    order : sequence of int, optional
        DOFs that are eliminated last, in this order; the others precede them, by minimum degree.

    Returns
    -------
    Program
        Cached by the pattern, so that a substructure that is changed and condensed again is ordered only once.
    """
    return _planned(np.asarray(pattern, dtype=np.bool_).tobytes(), len(pattern), tuple(keep), tuple(order))


@lru_cache(maxsize=64)
def _planned(entries: bytes, size: int, keep: tuple[int, ...], last: tuple[int, ...]) -> Program:
    pattern = np.frombuffer(entries, dtype=np.bool_).reshape(size, size)
    neighbours = [set(np.flatnonzero(row).tolist()) - {dof} for dof, row in enumerate(pattern)]
    eliminated, below, graph = _minimum_degree(neighbours, set(keep), last)
    order = [*eliminated, *keep]
    rank = {dof: position for position, dof in enumerate(order)}
    below = [sorted(rows, key=rank.__getitem__) for rows in below]
    below_kept = [[row for row in graph[dof] if rank[row] > rank[dof]] for dof in keep]
    slot: dict[tuple[int, int], int] = {}
    for dof, rows in zip(order, [*below, *below_kept], strict=True):
        for row in (dof, *rows):
            slot[row, dof] = len(slot)
    start, update_start = [0], [0]
    column: list[int] = []
    update: list[tuple[int, int, int]] = []
    for dof, rows in zip(eliminated, below, strict=True):
        column.extend(slot[row, dof] for row in rows)
        for other, later in enumerate(rows):
            update.extend((slot[rows[row], later], row, other) for row in range(other, len(rows)))
        start.append(len(column))
        update_start.append(len(update))
    positions = np.array(list(slot), dtype=np.int64)
    return Program(
        pivots=len(eliminated),
        order=np.array(order, dtype=np.int64),
        rows=positions[:, 0],
        columns=positions[:, 1],
        diagonal=np.array([slot[dof, dof] for dof in order], dtype=np.int64),
        start=np.array(start, dtype=np.int64),
        column=np.array(column, dtype=np.int64),
        update_start=np.array(update_start, dtype=np.int64),
        update=np.array(update, dtype=np.int64).reshape(-1, 3),
    )


def run_elimination(program: Program, slots: NDArray[np.complex128]) -> None:
    """Carry out the elimination in place for all frequencies at once, as the compiled kernel does.

    Parameters
    ----------
    program : Program
    slots : (n_slots, n_freq) complex array
        The system's lower triangle; afterwards the kept slots contain the Schur complement.
    """
    for pivot in range(program.pivots):
        column = program.column[program.start[pivot] : program.start[pivot + 1]]
        factors = slots[column] / slots[program.diagonal[pivot]]
        for target, row, other in program.update[program.update_start[pivot] : program.update_start[pivot + 1]]:
            slots[target] -= factors[row] * slots[column[other]]


def _minimum_degree(
    neighbours: list[set[int]], keep: set[int], prescribed: Sequence[int]
) -> tuple[list[int], list[list[int]], dict[int, set[int]]]:
    """Return the order, the neighbours of each pivot when it is eliminated, and the remaining graph of kept DOFs."""
    graph = {dof: set(adjacent) for dof, adjacent in enumerate(neighbours)}
    order: list[int] = []
    below: list[list[int]] = []
    rank = {dof: 1 + position for position, dof in enumerate(prescribed)}
    while candidates := [dof for dof in graph if dof not in keep]:
        pivot = min(candidates, key=lambda dof: (rank.get(dof, 0), len(graph[dof]), _fill(graph, dof), dof))
        adjacent = graph.pop(pivot)
        for dof in adjacent:
            graph[dof] |= adjacent - {dof}
            graph[dof].discard(pivot)
        order.append(pivot)
        below.append(sorted(adjacent))
    return order, below, graph


def _fill(graph: dict[int, set[int]], pivot: int) -> int:
    """Return twice the number of entries that the elimination of `pivot` adds."""
    adjacent = graph[pivot]
    return sum(len(adjacent - graph[dof]) - 1 for dof in adjacent)
