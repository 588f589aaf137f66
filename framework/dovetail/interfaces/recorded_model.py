"""What a reader of matrices returns: the contents of a file as it has them, not yet checked, joined or converted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError, Fault
from dovetail.interfaces.matrices import Direction

MatrixMeaning = Literal["M", "K", "C", "D"]
"""Mass, stiffness, viscous damping, structural damping."""


@dataclass(frozen=True, eq=False)
class DofTable:
    """DOFs of the nodes.

    Parameters
    ----------
    nodes, directions : tuple of str
        Of each DOF.
    rows : (n_dofs,) array
        Row of the matrices, from 0.
    positions : (n_dofs,) array or None
        Of the node along the part, in the file's unit of length.
    where : str
        The file, for messages.
    points : (n_dofs, 3) array or None
        Coordinates of the node in space, in the file's unit of length.
    """

    nodes: tuple[str, ...]
    directions: tuple[str, ...]
    rows: NDArray[np.intp]
    positions: NDArray[np.float64] | None
    where: str
    points: NDArray[np.float64] | None = None

    def label(self, row: int) -> str:
        """Return a label for a row of the matrices, counted from 0."""
        named = np.flatnonzero(self.rows == row)
        if not named.size:
            return f"row {row + 1}"
        return f"{self.directions[named[0]]} of node '{self.nodes[named[0]]}' (row {row + 1})"

    def checked(self, size: int) -> DofTable:
        """Return the table after checking that it fits matrices with `size` rows.

        Raises
        ------
        DovetailError
            A DOF is repeated, a node has two positions, or a row is out of range or repeated.
        """
        seen: dict[tuple[str, str], int] = {}
        taken: dict[int, int] = {}
        for index, (node, direction, row) in enumerate(zip(self.nodes, self.directions, self.rows, strict=True)):
            if (node, direction) in seen:
                raise self._error(index, f"{direction} of node '{node}' is already DOF {seen[node, direction] + 1}.")
            if not 0 <= row < size:
                raise self._error(index, f"row {row + 1} is not in the matrices, which have {size} rows.")
            if row in taken:
                raise self._error(index, f"row {row + 1} already belongs to DOF {taken[row] + 1}.")
            seen[node, direction] = taken[int(row)] = index
        for places in (self.positions, *(() if self.points is None else self.points.T)):
            if places is not None:
                self._check_positions(places)
        return self

    def _check_positions(self, positions: NDArray[np.float64]) -> None:
        """Check that positions, or coordinates along one axis, are finite and one for each node."""
        position_of: dict[str, float] = {}
        for index, (node, position) in enumerate(zip(self.nodes, positions, strict=True)):
            if not np.isfinite(position):
                raise self._error(index, f"the position of node '{node}' is not finite.")
            if position_of.setdefault(node, float(position)) != position:
                raise self._error(index, f"node '{node}' is at {position_of[node]:g} and at {position:g}.")

    def _error(self, index: int, problem: str) -> DovetailError:
        return DovetailError(Fault(f"{self.where}  DOF {index + 1}", problem))


@dataclass(frozen=True, eq=False)
class RecordedMatrix:
    """A square matrix of a file.

    Parameters
    ----------
    values : (d, d) array or scipy.sparse array
        In the order of the rows of the file's table of DOFs.
    meaning : {"M", "K", "C", "D"}, optional
        Mass, stiffness, viscous or structural damping, if the file says what the matrix is.
    is_half : bool
        The matrix is symmetric, and one of two mirrored entries suffices.
    """

    values: Any
    meaning: MatrixMeaning | None = None
    is_half: bool = False


@dataclass(frozen=True, eq=False)
class RecordedModel:
    """What a file contains of a finite element model.

    Parameters
    ----------
    matrices : mapping of str to RecordedMatrix
        By their names in the file.
    table : DofTable, optional
        The DOFs of the rows.
    points : mapping of str to three floats
        Coordinates of nodes, in the file's unit of length.
    frames : mapping of str to (3, 3) array
        Unit vectors along the directions x, y and z of nodes whose DOFs are not along the axes of the coordinates, as
        rows.
    axes : mapping of str to str
        The format's words for the directions ``x y z rx ry rz``; none if the format defines no words.
    has_units : bool
        False for a format of numbers in the units of the model, which the description then has to give.
    texts : sequence of (str, str)
        Titles and comments with their places; texts about units are compared with the description.
    """

    matrices: Mapping[str, RecordedMatrix] = field(default_factory=dict)
    table: DofTable | None = None
    points: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    frames: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    axes: Mapping[Direction, str] = field(default_factory=dict)
    has_units: bool = True
    texts: Sequence[tuple[str, str]] = ()
