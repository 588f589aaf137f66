"""Solution of the coupled system with pivoting, between any points or where a pivot of the elimination vanishes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.synthesis.coupled_system import CoupledSystem
from dovetail.synthesis.graph import Point, connected_with
from dovetail.synthesis.joint_evaluation import Theta, joint_stiffness, joint_stiffness_jacobian
from dovetail.synthesis.relative_coordinates import in_coordinates, rounded, warn_of_lost_digits

_DENSE_BYTES = 64e6
"""Memory for the systems that are solved at a time."""
_SINGULAR = 0.1
"""Change of a solution by its refinement, over the solution, above which the system is singular but for rounding."""


@dataclass(frozen=True, eq=False)
class PivotedSolver:
    """Solutions for one parameter vector at a time, by LAPACK.

    Parameters
    ----------
    system : CoupledSystem
    jacobian_columns : mapping of str to list of int
        Columns of each joint's theta by which to differentiate.
    pairs : sequence of (int, int)
        Output and input of each FRF, as indices into the system's points.
    """

    system: CoupledSystem
    jacobian_columns: Mapping[str, list[int]]
    pairs: Sequence[tuple[int, int]]

    def receptance(
        self, theta: Theta, lines: NDArray[np.intp], outputs: Sequence[Point], inputs: Sequence[Point]
    ) -> NDArray[np.complex128]:
        """Return the receptance (n_lines, n_out, n_in) at some lines.

        Raises
        ------
        DovetailError
            The system is singular at a line: it resonates there without damping, or a part moves without resistance.
        """
        rows = [self.system.index(point) for point in outputs]
        columns = [self.system.index(point) for point in inputs]
        at_once = max(1, int(_DENSE_BYTES / (16 * len(self.system.active) ** 2)))
        blocks = [lines[first : first + at_once] for first in range(0, len(lines), at_once)]
        motions = [self._motion(theta, block, columns) for block in blocks]
        return np.concatenate([T[rows] @ motion for motion, T in motions])

    def _motion(
        self, theta: Theta, lines: NDArray[np.intp], forces: Sequence[int]
    ) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return the motion (n_lines, d, n) under a unit force at each of n active DOFs, and T of its coordinates.

        The motion of the DOFs is T times that of the coordinates. Those that these parameters do not connect with a
        force do not move.
        """
        Z, T = self.system.in_relative_coordinates(theta, lines)
        loads = T[list(forces)].T
        reached = np.flatnonzero(connected_with(np.asarray(loads.any(axis=1)), (Z != 0).any(axis=0)))
        motion = np.zeros((len(Z), *loads.shape), dtype=np.complex128)
        connected = Z[:, reached[:, None], reached]
        try:
            motion[:, reached] = _solve_refined(connected, loads[reached])
        except np.linalg.LinAlgError as error:
            line = next((n for n, Z_line in enumerate(connected) if _is_singular(Z_line, loads[reached])), None)
            where = "" if line is None else f" at {self.system.frequency[lines[line]]:g} Hz"
            problem = f"the assembly has no FRF{where}: it resonates without damping, or a part moves freely."
            raise DovetailError(problem) from error
        return motion, T

    def frfs(self, theta: Theta, lines: NDArray[np.intp]) -> NDArray[np.complex128]:
        """Return the receptance (n_pairs, n_lines) of each pair."""
        outputs, inputs = ([self.system.points[pair[end]] for pair in self.pairs] for end in (0, 1))
        frfs = np.diagonal(self.receptance(theta, lines, outputs, inputs), axis1=1, axis2=2).T
        self._warn(theta, lines, frfs)
        return frfs

    def _warn(self, theta: Theta, lines: NDArray[np.intp], frfs: NDArray[np.complex128]) -> None:
        """Warn where rounding in the matrices of joints changes a drive-point FRF (n_pairs, n_lines)."""
        system = self.system
        for name, connection in system.graph.connections.items():
            local, indices = system.locate(system.graph.joint_dofs(name))
            at = system.frequency[lines[:1]]
            noise = rounded(joint_stiffness(name, connection.model, at, theta[name])[0, 0])[local]
            for (output, force), frf in zip(self.pairs, frfs, strict=True):
                if output != force or not noise.any():
                    continue
                motion, T = self._motion(theta, lines, [system.index(system.points[output])])
                relative = (np.abs((T @ motion)[:, indices, 0]) ** 2 @ noise) / np.abs(frf)
                worst = int(np.argmax(relative))
                warn_of_lost_digits(f"the FRF at {system.frequency[lines[worst]]:g} Hz", float(relative[worst]))

    def derivatives(self, theta: Theta, lines: NDArray[np.intp]) -> NDArray[np.complex128]:
        """Return the derivatives (n_pairs, n_jacobian, n_lines) of each pair's receptance, by adjoint sensitivity."""
        used = list(dict.fromkeys(point for pair in self.pairs for point in pair))
        motion, T = self._motion(theta, lines, [self.system.index(self.system.points[point]) for point in used])
        frequency = self.system.frequency[lines]
        derivatives: list[list[NDArray[np.complex128]]] = []
        for name, columns in self.jacobian_columns.items():
            if columns:
                local, indices = self.system.locate(self.system.graph.joint_dofs(name))
                model = self.system.graph.connections[name].model
                x = {point: motion[:, :, at] for at, point in enumerate(used)}
                changes = {
                    column: in_coordinates(dZ[0][:, local[:, None], local], T[indices])
                    for column, dZ in enumerate(joint_stiffness_jacobian(name, model, frequency, theta[name]))
                    if column in columns
                }
                by_column = {
                    column: [-np.einsum("fi,fij,fj->f", x[output], dZ, x[force]) for output, force in self.pairs]
                    for column, dZ in changes.items()
                }
                derivatives.extend(by_column[column] for column in columns)
        shape = len(derivatives), len(self.pairs), len(lines)
        return np.array(derivatives, dtype=np.complex128).reshape(shape).swapaxes(0, 1)


def _is_singular(Z: NDArray[np.complex128], loads: NDArray[np.float64]) -> bool:
    """Return whether the system (d, d) of one line is singular, but for rounding."""
    try:
        _solve_refined(Z[np.newaxis], loads)
    except np.linalg.LinAlgError:
        return True
    return False


def _solve_refined(Z: NDArray[np.complex128], loads: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Solve with rows scaled to the same size, and once more for the residual.

    Different units (newtons and newton metres) would mislead the choice of pivots. The second step reduces the error to
    that of rounding in each entry of Z (Skeel, Iterative refinement implies numerical stability for Gaussian
    elimination, 1980).
    """
    largest = abs(Z).max(axis=2, keepdims=True)
    scale = 1.0 / np.sqrt(np.where(largest > 0.0, largest, 1.0))
    scaled = Z * scale * np.swapaxes(scale, 1, 2)
    solution = np.linalg.solve(scaled, scale * loads)
    correction = np.linalg.solve(scaled, scale * (loads - Z @ (scale * solution)))
    changed, size = (abs(each).max(axis=(1, 2), initial=0.0) for each in (correction, solution))
    if (changed > _SINGULAR * size).any():
        raise np.linalg.LinAlgError("nothing but rounding is left of a pivot")
    return np.asarray(scale * (solution + correction))
