"""The synthesis engine: FRFs of many parameter vectors by one symbolic elimination and compiled code.

It uses the primal form of frequency-domain substructure synthesis. The sum of the boundary dynamic stiffnesses of
substructures, condensed once, and of joints is eliminated with the points of the FRFs last. For a single point, H_rr is
the inverse of the last pivot; for several points, receptances and motions follow from it by back substitution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.parallel import cores, threads
from dovetail.synthesis.codegen.compiler import WIDTH, MachineKernel, aligned_empty
from dovetail.synthesis.coupled_system import CoupledSystem, Within, condense
from dovetail.synthesis.elimination import Program
from dovetail.synthesis.graph import Graph, Point
from dovetail.synthesis.joint_evaluation import (
    JointSparsity,
    Theta,
    UnplannedEntries,
    probe_derivatives,
    probe_matrices,
    sample_count,
)
from dovetail.synthesis.plan import Factors, FactorsLike, Plan


@dataclass(frozen=True)
class Settings:
    """How the engine divides its work."""

    most_samples: int = 64
    """Largest number of samples in one call of the kernel, enough to reuse each vector of substructure data."""
    fewest_samples: int = 8
    """Smallest number of samples that is worth a call of the kernel."""
    gathered_samples: int = 512
    """Number of samples whose joint matrices are computed at a time."""
    threaded_multiplications: float = 3e5
    """Number of complex multiplications, about half a millisecond, from which a second thread is worth its call."""
    with_derivatives: int = 4
    """Times as many multiplications as for an FRF alone."""
    spectral_bytes: float = 16e6
    """Memory in which a thread evaluates joints that depend on frequency."""


SETTINGS = Settings()
_EVALUATION = Lock()
"""Held while joints are evaluated: their models need not be made for several threads."""


@dataclass(frozen=True, eq=False)
class _Job:
    """The parameter vectors of one call of a kernel, the factors of its FRFs, and the arrays that it fills."""

    kernel_of: Callable[[Plan], MachineKernel]
    theta: Theta
    factors: Factors
    result: NDArray[Any]
    jacobian: NDArray[np.complex128] | None = None
    scales: NDArray[np.float64] | None = None


class Engine:
    """FRFs of one graph on one frequency axis between chosen points, all from one elimination.

    Parameters
    ----------
    graph : Graph
    frequency : (n_freq,) array
        Hz, positive.
    points : sequence of Point
        DOFs at which forces act or motion is computed.
    probe_theta : mapping of str to (n, n_params) array
        A few parameter vectors that show which entries of the joints' matrices are filled. Only the first plan depends
        on them: if other parameters fill further entries, the plan is extended and compiled again.
    jacobian_columns : mapping of str to list of int, optional
        Columns of each joint's theta by which `frfs_jacobian` differentiates; all by default.
    pairs : sequence of (int, int), optional
        Output and input of each FRF, as indices into `points`: motion at the first per force at the second. By default
        the drive-point FRF at the first point only.
    within : Within, optional
        All lines of which these are some. Parts are condensed at all of them at once, and kept for other engines.

    Raises
    ------
    ValueError
        There are no pairs, or one of them refers to a point that does not exist.

    Attributes
    ----------
    pairs : tuple of (int, int)
    pivoted_lines : int
        Number of lines so far that were solved again with pivoting, because a pivot nearly vanished.
    plan : Plan
        For the entries that have occurred so far.
    """

    def __init__(
        self,
        graph: Graph,
        frequency: NDArray[np.float64],
        points: Sequence[Point],
        probe_theta: Theta,
        jacobian_columns: Mapping[str, list[int]] | None = None,
        *,
        pairs: Sequence[tuple[int, int]] = ((0, 0),),
        within: Within | None = None,
    ) -> None:
        self.pairs = tuple((int(output), int(force)) for output, force in pairs)
        if not self.pairs or not all(0 <= index < len(points) for pair in self.pairs for index in pair):
            raise ValueError(f"pairs are {self.pairs}: one or more (output, input) below {len(points)} are expected.")
        frequency = np.asarray(frequency, dtype=np.float64)
        self._lines = len(frequency)
        padded = np.concatenate([frequency, np.repeat(frequency[-1:], -len(frequency) % WIDTH)])
        self.graph = graph
        self._threads: int | None = None
        self.pivoted_lines = 0
        if jacobian_columns is None:
            jacobian_columns = {name: list(range(len(c.model.parameters))) for name, c in graph.connections.items()}
        self._jacobian_columns = {name: list(columns) for name, columns in jacobian_columns.items()}
        self.probe_theta = probe_theta
        sparsity = probe_matrices(graph, padded, probe_theta)
        system = CoupledSystem(graph, padded, points, condense(graph, padded, points, within=within), sparsity)
        self.plan = Plan(system, self._jacobian_columns, self.pairs)
        self._has_probed_derivatives = False

    @property
    def system(self) -> CoupledSystem:
        """The coupled system with the entries that are planned for."""
        return self.plan.system

    @property
    def frequency(self) -> NDArray[np.float64]:
        """(n_freq,) Hz."""
        return self.system.frequency[: self._lines]

    @property
    def program(self) -> Program:
        """The symbolic elimination of the active DOFs, those of the pairs last."""
        return self.plan.program

    def _probe_derivatives(self) -> None:
        """Extend the plan by the entries of the derivatives at the probes."""
        if self._has_probed_derivatives:
            return
        sparsity = self.system.sparsity
        probed = probe_derivatives(self.graph, self.system.frequency, self.probe_theta, self._jacobian_columns)
        self.plan = self.plan.widened(
            {name: JointSparsity(sparsity[name].matrices, derivatives) for name, derivatives in probed.items()}
        )
        self._has_probed_derivatives = True

    def prepared(self, factors: FactorsLike) -> Factors:
        """Prepare factors once for many calls of this engine's methods.

        Parameters
        ----------
        factors : as in `frfs`
        """
        return Factors.from_like(factors, len(self.pairs), self._lines)

    def frfs(self, theta: Theta, factors: FactorsLike = None) -> NDArray[np.complex128]:
        """Return the FRFs of all pairs for each parameter vector.

        Parameters
        ----------
        theta : mapping of str to (n, n_params) array
            All parameters of each joint, by the joint's name.
        factors : (n_pairs, n_freq) or (n_freq,) complex array or Factors, optional
            Factors that convert each pair's receptance to the desired quantity; 1 by default. See `prepared`.

        Returns
        -------
        (n, n_pairs, n_freq) complex array
        """
        prepared = self.prepared(factors)
        result = aligned_empty((sample_count(theta), *prepared.values.shape), np.complex128)
        samples = self._run(_Job(lambda plan: plan.receptance_kernel, theta, prepared, result))
        for single, sample, lines in self._failed_lines(theta, result, samples):
            result[sample][:, lines] = self.plan.pivoted.frfs(single, lines) * prepared.values[:, lines]
        return result[..., : self._lines]

    def amplitudes(self, theta: Theta, factors: FactorsLike) -> NDArray[np.float32]:
        """Return the magnitudes of the FRFs of all pairs, in single precision.

        Parameters
        ----------
        theta, factors : as in `frfs`

        Returns
        -------
        (n, n_pairs, n_freq) float32 array
        """
        prepared = self.prepared(factors).magnitudes
        result = aligned_empty((sample_count(theta), *prepared.values.shape), np.float32)
        samples = self._run(_Job(lambda plan: plan.amplitude_kernel, theta, prepared, result))
        for single, sample, lines in self._failed_lines(theta, result, samples):
            result[sample][:, lines] = np.abs(self.plan.pivoted.frfs(single, lines)) * prepared.values.real[:, lines]
        return result[..., : self._lines]

    def frfs_jacobian(
        self, theta: Theta, factors: FactorsLike = None, scales: NDArray[np.float64] | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Return the FRFs of all pairs and their derivatives, dH_oi/dp = -x_o^T (dZ/dp) x_i with x_p = Z^-1 e_p.

        Parameters
        ----------
        theta, factors : as in `frfs`
        scales : (n, n_jacobian) array, optional
            Factors of each derivative, such as derivatives of the parameters by others; 1 by default.

        Returns
        -------
        frfs : (n, n_pairs, n_freq) complex array
        jacobian : (n, n_pairs, n_freq, n_jacobian) complex array
            Per unit of each parameter, joint by joint.
        """
        self._probe_derivatives()
        prepared = self.prepared(factors)
        result = aligned_empty((sample_count(theta), *prepared.values.shape), np.complex128)
        jacobian = aligned_empty((*result.shape[:2], self.plan.inputs.parameters, result.shape[2]), np.complex128)
        samples = self._run(_Job(lambda plan: plan.jacobian_kernel, theta, prepared, result, jacobian, scales))
        for single, sample, lines in self._failed_lines(theta, result, samples):
            result[sample][:, lines] = self.plan.pivoted.frfs(single, lines) * prepared.values[:, lines]
            derivatives = self.plan.pivoted.derivatives(single, lines) * prepared.values[:, np.newaxis, lines]
            jacobian[sample][..., lines] = derivatives if scales is None else derivatives * scales[sample][:, None]
        return result[..., : self._lines], np.swapaxes(jacobian, 2, 3)[:, :, : self._lines]

    @property
    def threads(self) -> int:
        """Number of threads, each of which computes a block: the cores of this process, unless it is set."""
        return self._threads or cores()

    @threads.setter
    def threads(self, count: int) -> None:
        self._threads = count

    def _run(self, job: _Job) -> NDArray[np.intp]:
        """Fill the job's arrays; return the samples in which a pivot nearly vanished."""
        return self._planned(lambda plan: self._run_plan(plan, job))

    def _planned(self, compute: Callable[[Plan], NDArray[Any]]) -> NDArray[Any]:
        """Compute with the plan; if entries occur that are not planned for, extend it and compute again."""
        while True:
            try:
                return compute(self.plan)
            except UnplannedEntries as unplanned:
                self.plan = self.plan.widened(unplanned.sparsity)

    def _run_plan(self, plan: Plan, job: _Job) -> NDArray[np.intp]:
        """Fill the job's arrays with one plan, a block of samples in each thread; return the samples as `_run`."""
        count, derivatives = len(job.result), job.jacobian is not None
        flags = np.zeros(count, dtype=np.uint8)
        outputs = (job.result, np.empty((count, 0)) if job.jacobian is None else job.jacobian, flags)

        def run_block(first: int, theta: Theta, terms: NDArray[np.float64], weights: NDArray[np.float64]) -> None:
            block = slice(first, first + len(terms))
            spectral, spectral_weights = _gather_spectral(plan, theta, len(terms), derivatives=derivatives)
            if job.scales is not None and plan.spectral.joints:
                spectral_weights *= job.scales[block][:, plan.spectral.parameters, np.newaxis, np.newaxis]
            inputs = (plan.omega, job.factors.vectors, plan.static, terms, spectral, weights, spectral_weights)
            arrays = (*inputs, *(array[block] for array in outputs))
            job.kernel_of(plan)(len(plan.omega), len(terms), job.result.shape[-1], arrays)

        self._run_in_blocks(plan, job, run_block)
        return np.flatnonzero(flags)

    def _run_in_blocks(self, plan: Plan, job: _Job, run_block: Callable[..., None]) -> None:
        """Evaluate the joints for some samples while other threads may still compute the previous ones."""
        theta, count, derivatives = job.theta, len(job.result), job.jacobian is not None
        if not count:
            return
        size = self._block_size(plan, count, derivatives=derivatives)
        running: list[Future[None]] = []
        try:
            for start in range(0, count, SETTINGS.gathered_samples):
                number = min(SETTINGS.gathered_samples, count - start)
                chunk = _samples(theta, start, number)
                terms, weights = _gather(plan, chunk, number, derivatives=derivatives)
                if job.scales is not None:
                    weights *= job.scales[start : start + number, plan.inputs.parameter_of_derivatives]
                job.kernel_of(plan)  # compile it before several threads need it
                blocks = [
                    (start + i, _samples(chunk, i, size), terms[i : i + size], weights[i : i + size])
                    for i in range(0, number, size)
                ]
                workers = self.threads if len(blocks) > 1 else 1
                own = blocks[::workers]  # this thread is one of them
                others = [block for place, block in enumerate(blocks) if place % workers]
                _wait(running)
                running = [threads("engine", workers - 1).submit(run_block, *block) for block in others]
                for block in own:
                    run_block(*block)
        finally:
            wait(running)
        _wait(running)

    def _block_size(self, plan: Plan, count: int, *, derivatives: bool) -> int:
        """Return the number of samples in a block: enough to use the cache well, and some for every thread."""
        multiplications = len(self.system.frequency) * plan.program.multiplications
        multiplications *= SETTINGS.with_derivatives if derivatives else 1
        if not plan.spectral.joints and count * multiplications < SETTINGS.threaded_multiplications:
            return count
        fewest = min(SETTINGS.fewest_samples, -(-SETTINGS.threaded_multiplications // multiplications))
        size = min(SETTINGS.most_samples, max(int(fewest), -(-count // self.threads)))
        if plan.spectral.joints:
            size = min(size, int(SETTINGS.spectral_bytes / plan.spectral.bytes_per_sample(derivatives=derivatives)))
        return max(1, size)

    def _failed_lines(
        self, theta: Theta, result: NDArray[Any], samples: NDArray[np.intp]
    ) -> Iterator[tuple[Theta, int, NDArray[np.intp]]]:
        """Yield the parameters, the index and the affected lines of each sample in which a pivot nearly vanished."""
        for sample in map(int, samples):
            lines = np.flatnonzero(np.isnan(result[sample, 0]))
            self.pivoted_lines += int(np.count_nonzero(lines < self._lines))
            yield _samples(theta, sample, 1), sample, lines

    def receptance(self, theta: Theta, outputs: Sequence[Point], inputs: Sequence[Point]) -> NDArray[np.complex128]:
        """Return the receptance between points for one parameter vector, from a pivoted solve at each frequency.

        Parameters
        ----------
        theta : mapping of str to (1, n_params) array
        outputs, inputs : sequences of Point
            Among the engine's points.

        Returns
        -------
        (n_freq, n_out, n_in) complex array
        """
        lines = np.arange(self._lines)
        return self._planned(lambda plan: plan.pivoted.receptance(theta, lines, outputs, inputs))


def _gather(
    plan: Plan, theta: Theta, count: int, *, derivatives: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the terms of joints with constant matrices and, if needed, their derivatives."""
    with _EVALUATION:
        terms = plan.inputs.gather(theta, count)
        return terms, plan.inputs.gather_weights(theta, count) if derivatives else np.empty((count, 0))


def _gather_spectral(
    plan: Plan, theta: Theta, count: int, *, derivatives: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the dynamic stiffness of joints that depend on frequency and, if needed, its derivatives."""
    none = np.empty((count, 0))
    if not plan.spectral.joints:
        return none, none
    stiffness = plan.spectral.gather(theta, count)
    return stiffness, plan.spectral.gather_weights(theta, count) if derivatives else none


def _samples(theta: Theta, first: int, count: int) -> Theta:
    return {name: values[first : first + count] for name, values in theta.items()}


def _wait(blocks: Sequence[Future[None]]) -> None:
    """Wait for all blocks, and raise the first of their exceptions."""
    for future in blocks:
        future.result()
