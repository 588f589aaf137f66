"""Points of measured interfaces at which joints act, and which move by the interface's motions and deformations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy  # loads a part of it when that is first used
from numpy.typing import NDArray

from dovetail import DIRECTIONS, Direction, MeasuredDofs, PartNode, VirtualPoints, interface_modes

_INDEPENDENT = 1e-6
"""Share of the largest motion by a deformation from which a DOF of a contact shows one more deformation."""
_FAR = 2.0
"""Distance of a contact from its point, over that of the farthest channel, from which there is a warning."""

Place = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Virtual points, then the contacts of each: nodes whose DOFs are sums of the modes of the points.

    Parameters
    ----------
    points : VirtualPoints
        All of them with six directions if they have contacts.
    contacts : mapping of str to mapping of str to three floats
        By the name of the point: the names of its contacts and their coordinates [m].
    directions : mapping of str to tuple of directions
        By the name of the point: those of its contacts.
    """

    points: VirtualPoints
    contacts: Mapping[str, Mapping[str, Place]]
    directions: Mapping[str, tuple[Direction, ...]]

    @cached_property
    def _places(self) -> dict[str, tuple[str, Place]]:
        """The point and the place of each contact."""
        return {name: (point, at) for point, contacts in self.contacts.items() for name, at in contacts.items()}

    @cached_property
    def nodes(self) -> tuple[PartNode, ...]:
        """The points and the contacts."""
        points = [PartNode(name, 0.0, point.directions, point.point) for name, point in self.points.points.items()]
        contacts = [PartNode(name, 0.0, self.directions[owner], at) for name, (owner, at) in self._places.items()]
        return (*points, *contacts)

    @cached_property
    def by_modes(self) -> NDArray[np.float64]:
        """The motion (d, m) of all DOFs by the modes of the points, in the order of `VirtualPoints.modes`."""
        modes = self.points.modes
        rows = [
            [float((name, direction) == mode) for mode in modes]
            for name, point in self.points.points.items()
            for direction in point.directions
        ]
        for owner, at in self._places.values():
            point, moved = self.points.points[owner], np.zeros((6, len(modes)))
            dofs = MeasuredDofs(DIRECTIONS, np.tile(at, (6, 1)), np.tile(np.eye(3), (2, 1)), np.arange(6) >= 3)
            is_of_owner = [name == owner for name, _ in modes]
            moved[:, is_of_owner] = interface_modes(dofs, point.point, point.modes, turning=True)
            rows += moved[[DIRECTIONS.index(each) for each in self.directions[owner]]].tolist()
        return np.array(rows)

    @cached_property
    def leaders(self) -> tuple[int, ...]:
        """DOFs by which all move: those of the points, and of the contacts as many as show the deformations."""
        count = sum(len(point.directions) for point in self.points.points.values())
        deforms = [mode not in DIRECTIONS for _, mode in self.points.modes]
        shown = self.by_modes[count:, deforms] * self._lengths[count:, np.newaxis]
        size = np.abs(shown).max(axis=0, initial=0.0)
        shown = shown[:, size > 0.0] / size[size > 0.0]
        if not shown.size:
            return tuple(range(count))
        _, triangle, order = scipy.linalg.qr(shown.T, mode="economic", pivoting=True)
        left = np.abs(np.diagonal(triangle))
        return (*range(count), *(count + np.sort(order[: len(left)][left > _INDEPENDENT * left[0]])).tolist())

    @property
    def _lengths(self) -> NDArray[np.float64]:
        """For each rotation the distance of the farthest contact from its point [m], for each displacement 1."""
        ways = [np.subtract(at, self.points.points[owner].point) for owner, at in self._places.values()]
        farthest = float(np.linalg.norm(ways, axis=1).max()) or 1.0
        return np.array(
            [farthest if each in DIRECTIONS[3:] else 1.0 for node in self.nodes for each in node.directions]
        )

    @cached_property
    def by_leaders(self) -> NDArray[np.float64]:
        """The motion (d, n) of all DOFs by the leaders."""
        found, *_ = np.linalg.lstsq(self.by_modes[list(self.leaders)].T, self.by_modes.T)
        motion = np.where(np.abs(found.T) < 1e-13, 0.0, found.T)
        motion[list(self.leaders)] = np.eye(len(self.leaders))
        return np.asarray(motion)

    @property
    def constraints(self) -> NDArray[np.float64]:
        """The functions (k, d) of the DOFs that are zero: each other DOF minus its motion by the leaders."""
        others = np.setdiff1d(np.arange(len(self.by_leaders)), self.leaders)
        rows = np.eye(len(self.by_leaders))[others]
        rows[:, list(self.leaders)] -= self.by_leaders[others]
        return np.asarray(rows)

    def receptance(self, values: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """Return the receptance (n_freq, n, n) between the leaders for FRFs between channels and impacts."""
        motion = self.by_modes[list(self.leaders)]
        return np.asarray(motion @ self.points.transformed(values, deformations=True) @ motion.T)

    def distant(self) -> tuple[str, ...]:
        """Return warnings about contacts at which deformations are extrapolated."""
        said = []
        for name, (owner, at) in self._places.items():
            point = self.points.points[owner]
            ways = self.points.channels.positions[list(point.channels)] - np.asarray(point.point)
            farthest = float(np.linalg.norm(ways, axis=1).max())
            distance = float(np.linalg.norm(np.subtract(at, point.point)))
            if point.flexible and distance > _FAR * farthest:
                said.append(
                    f"the contact '{name}' is {1e3 * distance:.3g} mm from the point '{owner}', and the channels are "
                    f"at most {1e3 * farthest:.3g} mm from it, so that its deformations are extrapolated."
                )
        return tuple(said)
