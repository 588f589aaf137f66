"""Points of NASTRAN's bulk data, and the coordinate systems in which they are given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail_plugins.matrix_readers.bulk_data import Card, real, whole

Dof = tuple[int, int]
"""A grid point and one of its components 1 to 6, or a scalar point and 0."""
MOST_POINTS = 1_000_000
"""In a list such as 1 THRU 9, which bounds the memory."""


@dataclass(frozen=True, eq=False)
class _System:
    """A coordinate system: its origin, its axes as rows, and whether it is cylindrical."""

    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    is_cylindrical: bool = False

    def to_basic(self, coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a point in the basic system."""
        first, second, third = coordinates
        if self.is_cylindrical:
            angle = np.deg2rad(second)
            first, second = first * np.cos(angle), first * np.sin(angle)
        return np.asarray(self.origin + np.array([first, second, third]) @ self.axes)

    def axes_at(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the directions 1, 2 and 3 of a point, as rows."""
        if not self.is_cylindrical:
            return self.axes
        x, y, _ = self.axes @ (point - self.origin)
        angle = np.arctan2(y, x)
        turn = np.array([[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(turn @ self.axes)


_BASIC = _System(np.zeros(3), np.eye(3))


class Grids:
    """Grid points, scalar points and coordinate systems of a file."""

    def __init__(self) -> None:
        self._grids: dict[int, tuple[Card, tuple[str, ...]]] = {}
        self._scalars: set[int] = set()
        self._systems: dict[int, Card] = {}
        self._known = {0: _BASIC}

    def add(self, card: Card) -> None:
        """Take note of an entry, if it is about points.

        Raises
        ------
        ValueError
            A point is given twice with different coordinates, or the file numbers its points anew.
        """
        if card.name == "GRID":
            number, fields = whole(card[0], card), tuple(card[at] for at in range(1, 6))
            if self._grids.setdefault(number, (card, fields))[1] != fields:
                raise ValueError(f"line {card.line}: point {number} is given twice, with different coordinates.")
        elif card.name == "SPOINT":
            self._scalars.update(_scalar_points(card))
        elif card.name.startswith("CORD"):
            self._systems[whole(card[0], card)] = card
        elif card.name in ("GRDSET", "SEQGP"):
            raise ValueError(f"line {card.line}: {card.name} is not read; give each GRID its own fields and number.")

    def dofs(self) -> list[Dof]:
        """Return the DOFs of all points, in the order of the rows of matrices of the g-set."""
        dofs = [(point, component) for point in self._grids for component in range(1, 7)]
        return sorted(dofs + [(point, 0) for point in self._scalars])

    def coordinates(self) -> dict[int, tuple[float, float, float]]:
        """Return the points in the basic coordinate system."""
        points = {}
        for number, (card, fields) in self._grids.items():
            given = np.array([real(each, card) for each in fields[1:4]])
            x, y, z = self._system(whole(fields[0], card, 0), card, set()).to_basic(given).tolist()
            points[number] = (x, y, z)
        return points

    def frames(self, points: Mapping[int, tuple[float, float, float]]) -> dict[int, NDArray[np.float64]]:
        """Return the directions of the points, given in the basic system, whose components are not along it."""
        frames = {}
        for number, (card, fields) in self._grids.items():
            if (system := whole(fields[4], card, 0)) > 0:
                frames[number] = self._system(system, card, set()).axes_at(np.array(points[number]))
        return frames

    def _system(self, number: int, user: Card, above: set[int]) -> _System:
        """Return a coordinate system.

        Raises
        ------
        ValueError
            It is missing, of another kind, or defined by itself.
        """
        if number in self._known:
            return self._known[number]
        card = self._systems.get(number)
        if card is None or number in above:
            raise ValueError(
                f"line {user.line}: {user.name} refers to the coordinate system {number}, which is missing."
            )
        if card.name not in ("CORD2R", "CORD2C"):
            problem = f"{card.name} {number} is not read; CORD2R and CORD2C are"
            raise ValueError(f"line {card.line}: the coordinate system {problem}.")
        reference = self._system(whole(card[1], card, 0), card, above | {number})
        a, b, c = (reference.to_basic(np.array([real(card[at + axis], card) for axis in range(3)])) for at in (2, 5, 8))
        z, across = b - a, np.cross(b - a, c - a)
        if not np.linalg.norm(z) or not np.linalg.norm(across):
            raise ValueError(f"line {card.line}: the points of the coordinate system {number} are on one line.")
        z, y = z / np.linalg.norm(z), across / np.linalg.norm(across)
        self._known[number] = _System(a, np.stack([np.cross(y, z), y, z]), card.name == "CORD2C")
        return self._known[number]


def _scalar_points(card: Card) -> list[int]:
    if len(card.fields) > 2 and card[1].upper() == "THRU":
        first, last = whole(card[0], card), whole(card[2], card)
        if last - first > MOST_POINTS:
            raise ValueError(f"line {card.line}: SPOINT names {last - first} points.")
        return [*range(first, last + 1)]
    return [whole(each, card) for each in card.fields if each]
