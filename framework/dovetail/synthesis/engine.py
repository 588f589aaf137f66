"""The synthesis engine: substructures condensed once, the joints' entries added, one elimination for all samples.

The primal form of frequency-domain substructure synthesis: the boundary dynamic stiffness of each substructure plus
the joints' dynamic stiffness, eliminated with the response last, so that H_rr is the inverse of the last pivot.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.synthesis.codegen.compiler import MachineKernel, aligned_empty, as_vectors, compiled
from dovetail.synthesis.codegen.layout import Layout
from dovetail.synthesis.codegen.looped import looped_kernel_source
from dovetail.synthesis.codegen.straight_line import kernel_source
from dovetail.synthesis.codegen.vector_ir import WIDTH
from dovetail.synthesis.coupled_system import CoupledSystem, Point
from dovetail.synthesis.elimination import Program, eliminate
from dovetail.synthesis.graph import Graph
from dovetail.synthesis.joint_evaluation import Theta
from dovetail.synthesis.kernel_inputs import Contributions, GeneralContributions
from dovetail.synthesis.pivoting import PivotedSolver

__all__ = ["Engine"]

STRAIGHT_LINE = 1500
"""Multiplications a line up to which an elimination is compiled without loops, in less than a second.

The route depends on the system alone, never on the number of samples, so that an FRF is the same bit for bit however it
is asked for.
"""
_SAMPLES_AT_ONCE = 64
"""Most samples in one call of the kernel: enough to use each vector of substructure data well."""
_SAMPLES_AT_LEAST = 8
"""Samples that are worth a call of their own."""
_SAMPLES_GATHERED = 512
"""Samples whose joint matrices are made at once."""
_GENERAL_BYTES = 16e6
"""Memory in which a thread evaluates joints that depend on frequency."""


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
        padded = np.concatenate([given, np.repeat(given[-1:], -len(given) % WIDTH)])
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

    @cached_property
    def _general(self) -> GeneralContributions:
        return GeneralContributions(self.system, self.program, self._sought, self._contributions)

    @cached_property
    def _pivoted(self) -> PivotedSolver:
        return PivotedSolver(self.system, self._sought)

    def _layout(self, *, derivatives: bool = False) -> Layout:
        found, general = self._contributions, self._general
        layout = Layout(found.static[0], found.terms, general.slots)
        if not derivatives:
            return layout
        return replace(
            layout,
            derivatives=found.derivatives,
            general_derivatives=general.derivatives,
            parameters=found.parameters,
        )

    def _kernel(self, layout: Layout, *, amplitude: bool = False) -> MachineKernel:
        if self.program.multiplications > STRAIGHT_LINE:
            return MachineKernel(*looped_kernel_source(self.program, layout, amplitude=amplitude))
        return compiled(kernel_source(self.program, layout, amplitude=amplitude))

    @cached_property
    def _receptance_kernel(self) -> MachineKernel:
        return self._kernel(self._layout())

    @cached_property
    def _amplitude_kernel(self) -> MachineKernel:
        return self._kernel(self._layout(), amplitude=True)

    @cached_property
    def _jacobian_kernel(self) -> MachineKernel:
        return self._kernel(self._layout(derivatives=True))

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
        result = aligned_empty((_count(theta), len(padded)), np.complex128)
        flagged = self._run(self._receptance_kernel, theta, padded, result)
        for one, sample, lines in self._spoilt(theta, result, flagged):
            result[sample, lines] = self._pivoted.drive_point(one, lines) * padded[lines]
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
        result = aligned_empty((_count(theta), len(padded)), np.float32)
        flagged = self._run(self._amplitude_kernel, theta, padded, result)
        for one, sample, lines in self._spoilt(theta, result, flagged):
            result[sample, lines] = np.abs(self._pivoted.drive_point(one, lines)) * padded[lines]
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
        """
        count, padded = _count(theta), self._padded(factor)
        result = aligned_empty((count, len(padded)), np.complex128)
        derived = aligned_empty((count, self._contributions.parameters, len(padded)), np.complex128)
        flagged = self._run(self._jacobian_kernel, theta, padded, result, derived)
        for one, sample, lines in self._spoilt(theta, result, flagged):
            result[sample, lines] = self._pivoted.drive_point(one, lines) * padded[lines]
            derived[sample][:, lines] = self._pivoted.derivatives(one, lines).T * padded[lines]
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
        derived: NDArray[np.complex128] | None = None,
    ) -> NDArray[np.intp]:
        """Let the kernel fill `result`, a block of samples a thread; return the samples with a vanishing pivot."""
        count = len(result)
        flags = np.zeros(count, dtype=np.uint8)
        shared = (self._omega, as_vectors(np.stack([factor.real, factor.imag]), WIDTH), self._static)
        outputs = (result, np.empty((count, 0)) if derived is None else derived, flags)

        def run_block(first: int, theta: Theta, terms: NDArray[np.float64], weights: NDArray[np.float64]) -> None:
            block = slice(first, first + len(terms))
            general, general_weights = self._gather_general(theta, len(terms), derivatives=derived is not None)
            inputs = (terms, general, weights, general_weights)
            kernel(len(self._omega), len(terms), result.shape[1], (*shared, *inputs, *(a[block] for a in outputs)))

        self._in_blocks(theta, count, run_block, derivatives=derived is not None)
        return np.flatnonzero(flags)

    def _in_blocks(self, theta: Theta, count: int, run_block: Callable[..., None], *, derivatives: bool) -> None:
        """Gather what the joints contribute for some samples while the threads work on those before."""
        size = self._block_size(count, derivatives=derivatives)
        if not count:
            return
        if count <= size:
            weights = self._contributions.gather_weights(theta, count) if derivatives else np.empty((count, 0))
            run_block(0, theta, self._contributions.gather(theta, count), weights)
            return
        under_way: list[Future[None]] = []
        with ThreadPoolExecutor(self.threads) as pool:
            for start in range(0, count, _SAMPLES_GATHERED):
                some = _part(theta, start, min(start + _SAMPLES_GATHERED, count))
                number = min(_SAMPLES_GATHERED, count - start)
                terms = self._contributions.gather(some, number)
                weights = self._contributions.gather_weights(some, number) if derivatives else np.empty((number, 0))
                _finish(under_way)
                under_way = [
                    pool.submit(
                        run_block, start + first, _part(some, first, last), terms[first:last], weights[first:last]
                    )
                    for first in range(0, number, size)
                    for last in [min(first + size, number)]
                ]
            _finish(under_way)

    def _block_size(self, count: int, *, derivatives: bool) -> int:
        """Return how many samples go to a thread at once: enough for the cache, and some for every thread."""
        size = min(_SAMPLES_AT_ONCE, max(_SAMPLES_AT_LEAST, -(-count // self.threads)))
        if self._general.slots:
            size = min(size, int(_GENERAL_BYTES / self._general.bytes_per_sample(derivatives=derivatives)))
        return max(1, size)

    def _gather_general(
        self, theta: Theta, count: int, *, derivatives: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        none = np.empty((count, 0))
        if not self._general.slots:
            return none, none
        general = self._general.gather(theta, count)
        return general, self._general.gather_weights(theta, count) if derivatives else none

    def _spoilt(
        self, theta: Theta, result: NDArray[Any], samples: NDArray[np.intp]
    ) -> Iterator[tuple[Theta, int, NDArray[np.intp]]]:
        """Yield the parameters, the number and the lines of each sample in which a pivot nearly vanished."""
        for sample in map(int, samples):
            lines = np.flatnonzero(np.isnan(result[sample]))
            self.pivoted_lines += int(np.count_nonzero(lines < self._lines))
            yield _part(theta, sample, sample + 1), sample, lines

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
        return self._pivoted.receptance(theta, np.arange(self._lines), outputs, inputs)


def _cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def _count(theta: Theta) -> int:
    return len(next(iter(theta.values()))) if theta else 1


def _part(theta: Theta, first: int, last: int) -> Theta:
    return {name: values[first:last] for name, values in theta.items()}


def _finish(under_way: Sequence[Future[None]]) -> None:
    """Wait, and raise what was raised."""
    for future in under_way:
        future.result()
