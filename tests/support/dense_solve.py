"""A whole assembly solved densely, from its description and the published formulas; no code of Dovetail is used.

Every node of every part has its own DOFs x and rz, every joint its own inner DOFs, whatever they are connected with.
Merged and held DOFs are constraints u = L q with a matrix L of zeros and ones, and Z of the assembly is L^T Z L, summed
over the elements.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from support.element_formulas import Element
from support.joint_formulas import JOINTS, inner_dofs, joint_parameters, merged
from support.part_formulas import part_of

Point = tuple[str, str, str]
"""Substructure, label of a node, 'x' or 'rz'."""
_COMPLEX_STEP = 1e-30
"""Relative; its square is lost against 1, so that a complex step differentiates to rounding."""
_SINGULAR = 1e15
"""Condition of the balanced Z beyond which no digit of its inverse is known."""


@dataclass(frozen=True, eq=False)
class Slope:
    """Derivative of Z by a parameter, the sum of its terms' magnitudes, and that of the joint's Z, (n_freq, d, d)."""

    derivative: np.ndarray
    magnitude: np.ndarray
    joint_magnitude: np.ndarray


@dataclass(frozen=True, eq=False)
class System:
    """Z over the reduced DOFs that take part, and how accurately any elimination can solve it.

    Parameters
    ----------
    Z : (n_freq, d, d) complex array
    magnitude : (n_freq, d, d) array
        Sum of the magnitudes of all elements' entries, to which their rounding is proportional.
    index : mapping of int to int
        Row of each reduced DOF that takes part.
    """

    Z: np.ndarray
    magnitude: np.ndarray
    index: dict[int, int]

    def motion(self, loads: np.ndarray) -> np.ndarray:
        """Z^-1 of loads (n_freq, d, n), balanced and refined once.

        Column by column, so that the errors of a column are those of one neighbouring Z: differences of its entries
        keep their digits where all of it moves along by a rigid-body motion.
        """
        balance = _balance(self.magnitude)
        scaled = self.Z * balance[:, :, np.newaxis] * balance[:, np.newaxis, :]
        x = np.zeros(loads.shape, dtype=complex)
        for _ in range(2):
            x += balance[..., np.newaxis] * np.linalg.solve(scaled, balance[..., np.newaxis] * (loads - self.Z @ x))
        return x

    def unit_motion(self, dof: int) -> np.ndarray:
        """Motion (n_freq, d) under a unit load at a reduced DOF."""
        loads = np.zeros((*self.Z.shape[:2], 1))
        loads[:, self.index[dof]] = 1.0
        return self.motion(loads)[..., 0]

    def receptance(self, row: int, column: int) -> tuple[np.ndarray, np.ndarray]:
        """H between two reduced DOFs, and how much it changes by rounding, over the unit of rounding.

        To first order dH = -y^T dZ x with Z x = e_column and Z y = e_row. Elimination in symmetric order changes the
        entry (i, j) by eps sqrt(|Z|_ii |Z|_jj) (Demmel, LAPACK Working Note 14 (1989)), and so H by
        eps (|y|^T d) (d^T |x|) at most, with d_i^2 = |Z|_ii.
        """
        y, x = self.unit_motion(row), self.unit_motion(column)
        return x[:, self.index[row]], self._rounding(y, x)

    def derivatives(
        self, row: int, column: int, slopes: Sequence[Slope]
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Yield the derivative of H between two reduced DOFs by each parameter, its rounding, and that of differences.

        d(Z^-1) = -Z^-1 dZ Z^-1, so that dH = -y^T dZ x with the motions of `receptance`. The last are the changes by
        relative changes of one in dZ and in Z of the joint, |y|^T |dZ| |x| and |y|^T |Z| |x|.
        """
        y, x = self.unit_motion(row), self.unit_motion(column)
        to_y, to_x = self._answers(y, slopes), self._answers(x, slopes)
        for number, slope in enumerate(slopes):
            own, joint = (_form(abs(y), matrix, abs(x)) for matrix in (slope.magnitude, slope.joint_magnitude))
            moved = own + self._rounding(to_y[number], x) + self._rounding(y, to_x[number])
            yield -_form(y, slope.derivative, x), moved, np.stack([own, joint])

    def _answers(self, x: np.ndarray, slopes: Sequence[Slope]) -> np.ndarray:
        """Z^-1 dZ x for each parameter, (n_params, n_freq, d)."""
        loads = [slope.derivative @ x[..., np.newaxis] for slope in slopes]
        answers = self.motion(np.concatenate(loads, axis=2)) if slopes else np.empty((*x.shape, 0))
        return np.moveaxis(answers, 2, 0)

    def _rounding(self, y: np.ndarray, x: np.ndarray) -> np.ndarray:
        d = 1 / _balance(self.magnitude)
        return (abs(y) * d).sum(axis=1) * (abs(x) * d).sum(axis=1)


def _balance(magnitude: np.ndarray) -> np.ndarray:
    """Factors that bring the diagonal of the elements' magnitudes to one: both newtons and newton metres."""
    return 1 / np.sqrt(np.diagonal(magnitude, axis1=1, axis2=2))


def _connected(magnitude: np.ndarray, numbers: Sequence[int]) -> np.ndarray:
    """Reduced DOFs that elements connect with some of them."""
    _, group = connected_components(coo_array(magnitude.any(axis=0)), directed=False)
    return np.flatnonzero(np.isin(group, group[list(numbers)]))


def merged_entries(element: Element, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Reduced DOFs of an element, and its part of L: (d, n) zeros and ones."""
    reduced = numbers[list(element.dofs)]
    distinct = np.unique(reduced[reduced >= 0])
    return distinct, (reduced[:, np.newaxis] == distinct).astype(float)


def _form(left: np.ndarray, matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """left^T matrix right at each frequency."""
    return np.einsum("fi,fij,fj->f", left, matrix, right, optimize=True)


class DenseAssembly:
    """The assembly of a description (a dict with plain SI values).

    Parameters
    ----------
    description : mapping
    archives : mapping of str to mapping
        What files hold, by their name: M, K, C, D and the table of DOFs.
    """

    def __init__(self, description: Mapping[str, Any], archives: Mapping[str, Mapping[str, Any]]) -> None:
        axis = description["frequency"]
        self.frequency = np.linspace(axis["start"], axis["stop"], axis["lines"])
        self._joints: Mapping[str, Mapping[str, Any]] = description.get("joints", {})
        self._count = 0
        self.parts = {
            name: part_of(section, archives, self._new) for name, section in description["substructures"].items()
        }
        self._inner = {name: self._new(inner_dofs(section)) for name, section in self._joints.items()}
        self._unknown = {
            name: [p for p in joint_parameters(joint) if "value" not in joint.get("parameters", {}).get(p, {})]
            for name, joint in self._joints.items()
        }
        self._parts_elements = [e for part in self.parts.values() for e in part.elements if not part.held]

    def _new(self, count: int) -> list[int]:
        self._count += count
        return list(range(self._count - count, self._count))

    @property
    def parameters(self) -> list[str]:
        """Names of the unknowns: bare where a single joint has parameters."""
        bare = sum(bool(joint_parameters(joint)) for joint in self._joints.values()) <= 1
        return [p if bare else f"{name}.{p}" for name, unknown in self._unknown.items() for p in unknown]

    def node(self, part: str, place: float | str) -> str:
        """Label of the node at a position, or of that label."""
        positions = self.parts[part].positions
        if isinstance(place, str):
            return place
        return min(positions, key=lambda label: abs(positions[label] - place))

    # -- joints and constraints ------------------------------------------------------------------------------------

    def _ports(self, joint: Mapping[str, Any]) -> dict[str, list[tuple[int, int]]]:
        return {
            port: [self.parts[end["to"]].nodes[self.node(end["to"], place)] for place in end["at"]]
            for port, end in joint["connect"].items()
        }

    def _values(self, theta: Sequence[complex]) -> dict[str, dict[str, complex]]:
        """All parameters of each joint; `theta` holds the unknown ones."""
        unknown = iter(theta)
        return {
            name: {
                p: next(unknown) if p in self._unknown[name] else joint["parameters"][p]["value"]
                for p in joint_parameters(joint)
            }
            for name, joint in self._joints.items()
        }

    def _joint_elements(self, name: str, values: Mapping[str, complex]) -> list[Element]:
        joint = self._joints[name]
        return JOINTS[joint["model"]](joint, values, self._ports(joint), self._inner[name], self.frequency)

    def numbering(self, *, rigid: bool = False) -> np.ndarray:
        """Column of L in which each full DOF has its one; -1 where it is held."""
        pairs = [
            pair
            for name, joint in self._joints.items()
            for pair in merged(joint, self._ports(joint), self._inner[name], rigid=rigid and bool(self._unknown[name]))
        ]
        first, second = np.array(pairs, dtype=int).reshape(-1, 2).T
        links = coo_array((np.ones(len(first)), (first, second)), shape=(self._count, self._count))
        _, group = connected_components(links, directed=False)
        still = {int(group[dof]) for part in self.parts.values() if part.held for n in part.nodes.values() for dof in n}
        moving = [g for g in dict.fromkeys(group.tolist()) if g not in still]
        column = {g: i for i, g in enumerate(moving)}
        return np.array([column.get(int(g), -1) for g in group])

    # -- dynamics --------------------------------------------------------------------------------------------------

    def system(self, theta: Sequence[float], points: Sequence[Point], *, rigid: bool = False) -> System:
        """Z over all DOFs that are connected with some points; see `objection` for whether it can be solved."""
        numbers = self.numbering(rigid=rigid)
        Z, magnitude = self._sum(self.elements(theta), numbers)
        connected = _connected(magnitude, [numbers[self.dof(point)] for point in points])
        Z, magnitude = (array[:, connected[:, np.newaxis], connected] for array in (Z, magnitude))
        return System(Z, magnitude, {int(dof): i for i, dof in enumerate(connected)})

    def slopes(self, theta: Sequence[float], system: System) -> list[Slope]:
        """The derivative by each unknown, by a complex step in the elements of its joint."""
        connected, numbers, slopes = np.array(list(system.index), dtype=int), self.numbering(), []
        owners = [name for name, unknown in self._unknown.items() for _ in unknown]
        for column, name in enumerate(owners):
            stepped = np.array(theta, dtype=complex)
            step = _COMPLEX_STEP * max(abs(theta[column]), 1e-6)
            stepped[column] += 1j * step
            elements = self._joint_elements(name, self._values(stepped)[name])
            changes = [Element(e.dofs, *(np.imag(matrix) / step for matrix in (e.M, e.K, e.C, e.D))) for e in elements]
            values = [Element(e.dofs, *map(np.real, (e.M, e.K, e.C, e.D))) for e in elements]
            sums = (*self._sum(changes, numbers), self._sum(values, numbers)[1])
            slopes.append(Slope(*(array[:, connected[:, np.newaxis], connected] for array in sums)))
        return slopes

    def objection(self, points: Sequence[Point], theta: Sequence[float], *, rigid: bool = False) -> str:
        """Why there is no receptance at these points; empty if there is."""
        numbers = self.numbering(rigid=rigid)
        _, magnitude = self._sum(self.elements(theta), numbers)
        for point in points:
            number = numbers[self.dof(point)]
            if number < 0:
                return f"{point} is held"
            if not magnitude[:, number, number].any():
                return f"nothing resists at {point}"
        system = self.system(theta, points, rigid=rigid)
        balance = _balance(system.magnitude)
        condition = np.linalg.cond(system.Z * balance[:, :, np.newaxis] * balance[:, np.newaxis, :])
        return "" if condition.min() < _SINGULAR else "Z is singular"

    def coupled(self, one: Point, other: Point, theta: Sequence[float]) -> bool:
        """Whether elements connect two points, or one of them is held."""
        numbers = self.numbering()
        _, magnitude = self._sum(self.elements(theta), numbers)
        ends = [int(numbers[self.dof(point)]) for point in (one, other)]
        return min(ends) < 0 or ends[1] in _connected(magnitude, ends[:1])

    def depends_on_frequency(self) -> bool:
        """Whether a joint or a measured part has no constant matrices."""
        return any(joint["model"] == "rubber" for joint in self._joints.values())

    def gives_its_own_law(self, column: int) -> bool:
        """Whether an unknown belongs to a joint without constant matrices."""
        owners = [name for name, unknown in self._unknown.items() for _ in unknown]
        return self._joints[owners[column]]["model"] == "rubber"

    def dof(self, point: Point) -> int:
        """Full number of a DOF."""
        part, label, direction = point
        return self.parts[part].nodes[label][("x", "rz").index(direction)]

    def elements(self, theta: Sequence[float], *, constant: bool = True, varying: bool = True) -> list[Element]:
        """All elements but the ground's, or only those of joints with or without constant matrices."""
        values = self._values(theta)
        chosen = [name for name, joint in self._joints.items() if (varying if joint["model"] == "rubber" else constant)]
        parts = self._parts_elements if constant else []
        return [*parts, *(e for name in chosen for e in self._joint_elements(name, values[name]))]

    def _sum(self, elements: Sequence[Element], numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Z over the reduced DOFs (n_freq, n, n), and the sum of the magnitudes of its terms."""
        size, omega = int(numbers.max(initial=-1)) + 1, (2 * np.pi * self.frequency)[:, np.newaxis, np.newaxis]
        Z = np.zeros((len(omega), size, size), dtype=complex)
        magnitude = np.zeros(Z.shape)
        for e in elements:
            distinct, L = merged_entries(e, numbers)
            own = L.T @ (e.K - omega**2 * e.M + 1j * (e.D + omega * e.C)) @ L
            terms = abs(e.K) + omega**2 * abs(e.M) + abs(e.D) + omega * abs(e.C)
            Z[:, distinct[:, np.newaxis], distinct] += own
            magnitude[:, distinct[:, np.newaxis], distinct] += L.T @ terms @ L
        return Z, magnitude
