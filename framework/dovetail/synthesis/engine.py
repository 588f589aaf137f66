"""The synthesis engine: substructures condensed once, the joints' entries added, one elimination for all samples.

The primal form of frequency-domain substructure synthesis: the boundary dynamic stiffness of each substructure plus
the joints' dynamic stiffness, eliminated with the response last, so that H_rr is the inverse of the last pivot.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import JointModel, StructuralMatrices
from dovetail.synthesis.condensation import boundary_dynamic_stiffness
from dovetail.synthesis.elimination import Program, eliminate
from dovetail.synthesis.graph import Graph

__all__ = ["Engine", "Point"]

Point = tuple[str, int]
"""A DOF of a substructure: its name and the DOF's number there."""
Theta = Mapping[str, NDArray[np.float64]]
"""All parameters of each joint, (n, n_params), by the joint's name."""

_DENSE_BYTES = 64e6


@dataclass(frozen=True, eq=False)
class _JointEntries:
    """Which slot each local entry of a joint's matrices adds to."""

    local: NDArray[np.intp]
    slot: NDArray[np.intp]
    covered: NDArray[np.bool_]


class Engine:
    """FRFs of one graph on one frequency axis between chosen points.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz, positive.
    points : sequence of Point
        Where forces act and motion is read; the first is the drive point.
    probe : mapping of str to (n, n_params) array
        A few parameter vectors that show which entries of the joints' matrices are ever filled.

    Raises
    ------
    DovetailError
        A point does not move.
    """

    def __init__(self, graph: Graph, frequency: NDArray[np.float64], points: Sequence[Point], probe: Theta) -> None:
        self.graph = graph
        self.frequency = np.asarray(frequency, dtype=np.float64)
        self.points = tuple(points)
        self._probe = probe
        self._static = self._condense()
        self._general = [name for name, c in graph.connections.items() if _depends_on_frequency(c.model)]

    def _condense(self) -> dict[str, tuple[NDArray[np.intp], NDArray[np.complex128]]]:
        """Condense every substructure to the DOFs that joints and points need: global numbers and Z."""
        needed: dict[str, set[int]] = {name: set() for name in self.graph.substructures}
        for connection in self.graph.connections.values():
            for port in connection.attachments:
                needed[port.substructure].update(port.dofs)
        for name, dof in self.points:
            needed[name].add(dof)
        condensed = {}
        for name, substructure in self.graph.substructures.items():
            dofs = sorted(needed[name])
            if dofs and not substructure.grounded:
                numbers = self.graph.substructure_dofs(name)[dofs]
                Z = boundary_dynamic_stiffness(substructure, dofs, self.frequency)
                moving = np.flatnonzero(numbers >= 0)
                condensed[name] = numbers[moving], Z[:, moving[:, None], moving]
        return condensed

    @cached_property
    def _pattern(self) -> NDArray[np.bool_]:
        pattern = np.zeros((self.graph.size, self.graph.size), dtype=bool)
        for numbers, Z in self._static.values():
            pattern[np.ix_(numbers, numbers)] |= (Z != 0).any(axis=0)
        for name in self.graph.connections:
            numbers = self.graph.joint_dofs(name)
            moving = np.flatnonzero(numbers >= 0)
            filled = self._filled(name)[np.ix_(moving, moving)]
            rows, columns = np.nonzero(filled)
            pattern[numbers[moving][rows], numbers[moving][columns]] = True
        return pattern | pattern.T

    def _filled(self, name: str) -> NDArray[np.bool_]:
        """Local entries of a joint that any probe fills."""
        model, probe = self.graph.connections[name].model, self._probe[name]
        if name in self._general:
            lines = self.frequency[[0, len(self.frequency) // 2, -1]]
            filled: NDArray[np.bool_] = (model.dynamic_stiffness(lines, probe) != 0).any(axis=(0, 1))
            return filled
        return _nonzero(model.matrices(probe))

    @cached_property
    def _active(self) -> NDArray[np.intp]:
        """Global DOFs that take part, the first point's among them."""
        active = np.flatnonzero(self._pattern.any(axis=0))
        for point in self.points:
            if self._number(point) not in active:
                raise DovetailError(
                    f"{self.graph.substructures[point[0]].dof_label(point[1])} of '{point[0]}' does not move: "
                    "it is held, or nothing gives it inertia or stiffness."
                )
        return active

    def _number(self, point: Point) -> int:
        return int(self.graph.substructure_dofs(point[0])[point[1]])

    def _place(self, point: Point) -> int:
        """Place of a point among the active DOFs."""
        return int(np.searchsorted(self._active, self._number(point)))

    def _located(self, numbers: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return which of some global DOFs take part, and their places among the active ones."""
        local = np.flatnonzero(np.isin(numbers, self._active))
        return local, np.searchsorted(self._active, numbers[local])

    @cached_property
    def program(self) -> Program:
        """The symbolic elimination over the active DOFs, the drive point last."""
        return eliminate(self._pattern[np.ix_(self._active, self._active)], [self._place(self.points[0])])

    @cached_property
    def _slot_of(self) -> NDArray[np.intp]:
        """Slot of each pair of active DOFs, -1 where there is none."""
        size = len(self._active)
        table = np.full((size, size), -1, dtype=np.intp)
        slots = np.arange(self.program.slots)
        table[self.program.rows, self.program.columns] = slots
        table[self.program.columns, self.program.rows] = slots
        return table

    @cached_property
    def _static_slots(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Real and imaginary part of what the substructures contribute to each slot, (n_slots, n_freq)."""
        values = np.zeros((self.program.slots, len(self.frequency)), dtype=np.complex128)
        for numbers, Z in self._static.values():
            local, places = self._located(numbers)
            for row, column, slot in self._entries(places, np.ones((len(places),) * 2, dtype=bool)):
                values[slot] += Z[:, local[row], local[column]]
        return np.ascontiguousarray(values.real), np.ascontiguousarray(values.imag)

    def _entries(self, places: NDArray[np.intp], filled: NDArray[np.bool_]) -> list[tuple[int, int, int]]:
        """Local (row, column, slot) that make up the lower triangle; both halves where two local DOFs are merged."""
        entries = []
        for row, column in zip(*np.nonzero(filled), strict=True):
            merged = places[row] == places[column]
            slot = int(self._slot_of[places[row], places[column]])
            if slot >= 0 and (column <= row or merged):
                entries.append((int(row), int(column), slot))
        return entries

    @cached_property
    def _joint_entries(self) -> dict[str, _JointEntries]:
        found = {}
        for name, connection in self.graph.connections.items():
            numbers = self.graph.joint_dofs(name)
            moving, places = self._located(numbers)
            filled = self._filled(name)
            entries = self._entries(places, filled[np.ix_(moving, moving)])
            size = connection.model.size
            local = np.array([moving[row] * size + moving[column] for row, column, _ in entries], dtype=np.intp)
            slot = np.array([slot for _, _, slot in entries], dtype=np.intp)
            covered = filled.copy()
            covered[numbers < 0, :] = covered[:, numbers < 0] = True
            found[name] = _JointEntries(local, slot, covered)
        return found

    def drive_point(self, theta: Theta) -> NDArray[np.complex128]:
        """Receptance at the first point for each parameter vector.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
            All parameters of each joint, by the joint's name.

        Returns
        -------
        (n, n_freq) complex array
        """
        if self._general:
            return self.receptance(theta, self.points[:1], self.points[:1])[:, :, 0, 0]
        slots, added = self._gather(theta)
        from dovetail.synthesis.kernel import drive_point_receptance

        program = self.program
        static_re, static_im = self._static_slots
        result = np.empty((len(added["K"]), len(self.frequency)), dtype=np.complex128)
        drive_point_receptance(
            2.0 * np.pi * self.frequency, static_re, static_im, slots, added["K"], added["D"], added["C"], added["M"],
            program.diagonal, program.start, program.column, program.update_start, program.update, result,
        )  # fmt: skip
        return result

    def _gather(self, theta: Theta) -> tuple[NDArray[np.intp], dict[str, NDArray[np.float64]]]:
        """Collect what the joints add to each slot: the slots, and (n, n_entries) arrays of K, D, C and M."""
        slots = np.unique(np.concatenate([[], *(e.slot for e in self._joint_entries.values())])).astype(np.intp)
        count = len(next(iter(theta.values()))) if theta else 1
        gathered = {part: np.zeros((count, len(slots))) for part in "KDCM"}
        for name, entries in self._joint_entries.items():
            matrices = self.graph.connections[name].model.matrices(theta[name])
            stray = _nonzero(matrices) & ~entries.covered
            if stray.any():
                row, column = np.argwhere(stray)[0]
                model = self.graph.connections[name].model.name
                raise DovetailError(
                    f"joint '{name}' ({model}) fills the entry ({row}, {column}) of its matrices for some parameters "
                    "only; it must be filled for all, or for none."
                )
            columns = np.searchsorted(slots, entries.slot)
            for part, total in gathered.items():
                flat = getattr(matrices, part).reshape(count, -1)[:, entries.local]
                np.add.at(total.T, columns, flat.T)
        return slots, gathered

    def receptance(self, theta: Theta, outputs: Sequence[Point], inputs: Sequence[Point]) -> NDArray[np.complex128]:
        """Receptance between points, by a pivoted solve of the condensed system at every frequency.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
        outputs, inputs : sequences of Point
            Among the engine's points.

        Returns
        -------
        (n, n_freq, n_out, n_in) complex array
        """
        rows = [self._place(point) for point in outputs]
        loads = np.zeros((len(self._active), len(inputs)))
        loads[[self._place(point) for point in inputs], range(len(inputs))] = 1.0
        return self._solve(theta, loads)[:, :, rows, :]

    def _solve(self, theta: Theta, loads: NDArray[np.float64]) -> NDArray[np.complex128]:
        count, size = len(next(iter(theta.values()))) if theta else 1, len(self._active)
        solved = np.empty((count, len(self.frequency), *loads.shape), dtype=np.complex128)
        lines = max(1, int(_DENSE_BYTES / (16 * size**2)))
        for sample in range(count):
            one = {name: values[sample : sample + 1] for name, values in theta.items()}
            for first in range(0, len(self.frequency), lines):
                chunk = slice(first, first + lines)
                solved[sample, chunk] = np.linalg.solve(self._system(one, chunk), loads)
        return solved

    def _system(self, theta: Theta, chunk: slice) -> NDArray[np.complex128]:
        """Dynamic stiffness over the active DOFs for one parameter vector, (n_lines, d, d)."""
        frequency, size = self.frequency[chunk], len(self._active)
        system = np.zeros((len(frequency), size, size), dtype=np.complex128)
        for numbers, Z in self._static.values():
            local, places = self._located(numbers)
            _scatter(system, places, Z[chunk][:, local[:, None], local])
        for name, connection in self.graph.connections.items():
            local, places = self._located(self.graph.joint_dofs(name))
            Z = connection.model.dynamic_stiffness(frequency, theta[name])[0]
            _scatter(system, places, Z[:, local[:, None], local])
        return system

    def drive_point_jacobian(self, theta: Theta) -> tuple[NDArray[np.complex128], dict[str, NDArray[np.complex128]]]:
        """Receptance at the first point and its derivatives, by the adjoint: dH/dp = -x^T (dZ/dp) x, x = Z^-1 e.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array

        Returns
        -------
        receptance : (n, n_freq) complex array
        derivatives : mapping of str to (n, n_freq, n_params) complex array
            By each parameter of each joint, per unit of the parameter.
        """
        drive = self._place(self.points[0])
        x = self._solve(theta, np.eye(len(self._active))[:, [drive]])[..., 0]
        derivatives = {}
        for name, connection in self.graph.connections.items():
            if not connection.model.parameters:
                continue
            if name in self._general:
                raise DovetailError(f"joint '{name}' depends on frequency: its sensitivities are not available yet.")
            numbers = self.graph.joint_dofs(name)
            local, places = self._located(numbers)
            motion = np.zeros((*x.shape[:2], len(numbers)), dtype=np.complex128)
            motion[..., local] = x[..., places]
            derivatives[name] = self._adjoint(motion, connection.model.matrices_jacobian(theta[name]))
        return x[..., drive], derivatives

    def _adjoint(
        self, motion: NDArray[np.complex128], jacobian: Sequence[StructuralMatrices]
    ) -> NDArray[np.complex128]:
        omega = 2.0 * np.pi * self.frequency[:, None]
        columns = []
        for by_parameter in jacobian:
            quadratic = {
                part: np.einsum("nfi,nfi->nf", motion, motion @ getattr(by_parameter, part)) for part in "KDCM"
            }
            w = omega[:, 0]
            columns.append(-(quadratic["K"] + 1j * quadratic["D"] + 1j * w * quadratic["C"] - w**2 * quadratic["M"]))
        return np.stack(columns, axis=-1)


def _depends_on_frequency(model: JointModel) -> bool:
    return type(model).dynamic_stiffness is not JointModel.dynamic_stiffness


def _nonzero(matrices: StructuralMatrices) -> NDArray[np.bool_]:
    """Entries of (n, d, d) matrices that any sample fills."""
    filled = [(matrix != 0).any(axis=0) for matrix in (matrices.M, matrices.K, matrices.C, matrices.D)]
    either: NDArray[np.bool_] = np.logical_or.reduce(filled)
    return either


def _scatter(system: NDArray[np.complex128], places: NDArray[np.intp], Z: NDArray[np.complex128]) -> None:
    """Add Z to the rows and columns `places`, which may repeat."""
    for row, place in enumerate(places):
        for column, other in enumerate(places):
            system[:, place, other] += Z[:, row, column]
