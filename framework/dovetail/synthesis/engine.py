"""The synthesis engine: substructures condensed once, the joints' entries added, one elimination for all samples.

The primal form of frequency-domain substructure synthesis: the boundary dynamic stiffness of each substructure plus
the joints' dynamic stiffness, eliminated with the response last, so that H_rr is the inverse of the last pivot.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.synthesis.code import WIDTH, Layout, kernel_source
from dovetail.synthesis.contributions import Contributions
from dovetail.synthesis.elimination import Program, eliminate
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.machine import MachineKernel, as_vectors
from dovetail.synthesis.system import CoupledSystem, Point, Theta, depends_on_frequency

__all__ = ["Engine"]

_SAMPLES_AT_ONCE = 64
"""Most samples in one call of the kernel: enough to use each vector of substructure data well."""
_DENSE_BYTES = 64e6


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
    sought : mapping of str to list of int, optional
        Parameters of each joint by which `jacobian` differentiates, as columns of its theta; all by default.

    Attributes
    ----------
    threads : int
        How many samples are computed at the same time.
    pivoted_lines : int
        Lines solved again with pivoting so far, because a pivot nearly vanished.
    """

    def __init__(
        self,
        graph: Graph,
        frequency: NDArray[np.float64],
        points: Sequence[Point],
        probe: Theta,
        sought: Mapping[str, list[int]] | None = None,
    ) -> None:
        given = np.asarray(frequency, dtype=np.float64)
        self._lines = len(given)
        padded = np.concatenate([given, np.repeat(given[-1:], max(0, WIDTH - len(given)))])
        self.graph = graph
        self.system = CoupledSystem(graph, padded, points, probe)
        self.threads = _cores()
        self.pivoted_lines = 0
        everything = {name: list(range(len(c.model.parameters))) for name, c in graph.connections.items()}
        self._sought = everything if sought is None else {name: list(columns) for name, columns in sought.items()}

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_freq,) Hz."""
        return self.system.frequency[: self._lines]

    @cached_property
    def program(self) -> Program:
        """The symbolic elimination over the active DOFs, the drive point last."""
        return eliminate(self.system.pattern, [self.system.place(self.system.points[0])])

    @cached_property
    def _contributions(self) -> Contributions:
        return Contributions(self.system, self.program, self._sought)

    def _layout(self, *, derivatives: bool = False) -> Layout:
        found = self._contributions
        layout = Layout(found.static[0], found.terms, found.general)
        if not derivatives:
            return layout
        return Layout(layout.static, layout.terms, layout.general, found.derivatives, found.parameters)

    @cached_property
    def _receptance_kernel(self) -> MachineKernel:
        return MachineKernel(kernel_source(self.program, self._layout()))

    @cached_property
    def _amplitude_kernel(self) -> MachineKernel:
        return MachineKernel(kernel_source(self.program, self._layout(), amplitude=True))

    @cached_property
    def _jacobian_kernel(self) -> MachineKernel:
        return MachineKernel(kernel_source(self.program, self._layout(derivatives=True)))

    @cached_property
    def _static(self) -> NDArray[np.float64]:
        return as_vectors(self._contributions.static[1], WIDTH)

    @cached_property
    def _omega(self) -> NDArray[np.float64]:
        return as_vectors(2.0 * np.pi * self.system.frequency, WIDTH)

    def drive_point(self, theta: Theta, factor: NDArray[np.complex128] | None = None) -> NDArray[np.complex128]:
        """FRF at the first point for each parameter vector.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
            All parameters of each joint, by the joint's name.
        factor : (n_freq,) complex array, optional
            What turns a receptance into the wanted quantity; the receptance by default.

        Returns
        -------
        (n, n_freq) complex array
        """
        padded = self._padded(factor)
        result = np.empty((_count(theta), len(padded)), dtype=np.complex128)
        self._run(self._receptance_kernel, theta, padded, result)
        self._repair(theta, result, lambda H, lines: H * padded[lines])
        return result[:, : self._lines]

    def amplitude(self, theta: Theta, factor: NDArray[np.complex128]) -> NDArray[np.float32]:
        """Magnitude of the FRF at the first point, in single precision.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
        factor : (n_freq,) complex array
            What turns a receptance into the wanted quantity.

        Returns
        -------
        (n, n_freq) float32 array
        """
        padded = np.abs(self._padded(factor))
        result = np.empty((_count(theta), len(padded)), dtype=np.float32)
        self._run(self._amplitude_kernel, theta, padded, result)
        self._repair(theta, result, lambda H, lines: np.abs(H) * padded[lines])
        return result[:, : self._lines]

    def jacobian(
        self, theta: Theta, factor: NDArray[np.complex128] | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """FRF at the first point and its derivatives, by the adjoint: dH/dp = -x^T (dZ/dp) x, x = Z^-1 e.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
        factor : (n_freq,) complex array, optional
            What turns a receptance into the wanted quantity; the receptance by default.

        Returns
        -------
        frf : (n, n_freq) complex array
        jacobian : (n, n_freq, n_sought) complex array
            Joint by joint, per unit of the parameter.

        Raises
        ------
        DovetailError
            A pivot vanishes, or a joint with sought parameters depends on frequency otherwise than by its matrices.
        """
        for name, columns in self._sought.items():
            if columns and depends_on_frequency(self.graph.connections[name].model):
                raise DovetailError(f"joint '{name}' depends on frequency: its sensitivities are not available.")
        count, found, padded = _count(theta), self._contributions, self._padded(factor)
        result = np.empty((count, len(padded)), dtype=np.complex128)
        derived = np.empty((count, found.parameters, len(padded)), dtype=np.complex128)
        weights = found.gather_weights(theta, count)
        self._run(self._jacobian_kernel, theta, padded, result, weights=weights, derived=derived)
        self._repair(theta, result, lambda H, lines: H * padded[lines])
        if not np.isfinite(derived).all():
            raise DovetailError("a pivot vanishes at some line, so that the sensitivities are not to be had there.")
        return result[:, : self._lines], np.swapaxes(derived, 1, 2)[:, : self._lines]

    def _padded(self, factor: NDArray[np.complex128] | None) -> NDArray[np.complex128]:
        """Return one factor for each line that the kernel computes."""
        given = np.ones(self._lines) if factor is None else factor
        return np.concatenate([given, np.repeat(given[-1:], len(self.system.frequency) - self._lines)])

    def _run(
        self,
        kernel: MachineKernel,
        theta: Theta,
        factor: NDArray[Any],
        result: NDArray[Any],
        *,
        weights: NDArray[np.float64] | None = None,
        derived: NDArray[np.complex128] | None = None,
    ) -> None:
        """Let the kernel fill `result`, a block of samples a thread."""
        count, lines = result.shape
        none = np.empty((count, 0))
        terms = self._contributions.gather(theta, count)
        general = self._contributions.gather_general(theta, count) if self._contributions.general else none
        by_sample = (none if weights is None else weights, result, none if derived is None else derived)
        shared = (self._omega, as_vectors(np.stack([factor.real, factor.imag]), WIDTH), self._static)

        at_once = min(_SAMPLES_AT_ONCE, -(-count // self.threads))

        def run_block(first: int) -> None:
            block = slice(first, min(first + at_once, count))
            arrays = (*shared, *(array[block] for array in (terms, general, *by_sample)))
            kernel(len(self._omega), block.stop - block.start, lines, arrays)

        blocks = range(0, count, at_once)
        if self.threads == 1 or len(blocks) == 1:
            for first in blocks:
                run_block(first)
            return
        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(run_block, blocks))

    def _repair(
        self, theta: Theta, result: NDArray[Any], convert: Callable[[NDArray[np.complex128], NDArray[np.intp]], Any]
    ) -> None:
        """Solve again, with pivoting, the lines that the kernel left as NaN because a pivot nearly vanished."""
        for sample in np.flatnonzero(~np.isfinite(result.sum(axis=1))):
            lines = np.flatnonzero(~np.isfinite(result[sample]))
            one = {name: values[sample : sample + 1] for name, values in theta.items()}
            drive = self.system.points[:1]
            result[sample, lines] = convert(self._solve(one, lines, drive, drive)[:, 0, 0], lines)
            self.pivoted_lines += len(lines)

    def receptance(self, theta: Theta, outputs: Sequence[Point], inputs: Sequence[Point]) -> NDArray[np.complex128]:
        """Receptance between points for one parameter vector, by a pivoted solve at every frequency.

        Parameters
        ----------
        theta : mapping of str to (1, n_params) array
        outputs, inputs : sequences of Point
            Among the engine's points.

        Returns
        -------
        (n_freq, n_out, n_in) complex array
        """
        return self._solve(theta, np.arange(self._lines), outputs, inputs)

    def _solve(
        self, theta: Theta, lines: NDArray[np.intp], outputs: Sequence[Point], inputs: Sequence[Point]
    ) -> NDArray[np.complex128]:
        size = len(self.system.active)
        rows = [self.system.place(point) for point in outputs]
        loads = np.zeros((size, len(inputs)))
        loads[[self.system.place(point) for point in inputs], range(len(inputs))] = 1.0
        at_once = max(1, int(_DENSE_BYTES / (16 * size**2)))
        solved = [
            np.linalg.solve(self.system.dynamic_stiffness(theta, lines[first : first + at_once]), loads)[:, rows]
            for first in range(0, len(lines), at_once)
        ]
        return np.concatenate(solved)


def _cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _count(theta: Theta) -> int:
    return len(next(iter(theta.values()))) if theta else 1
