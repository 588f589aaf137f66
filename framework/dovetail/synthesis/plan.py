"""The elimination, the inputs and the compiled kernels for one sparsity pattern."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dovetail.errors import DovetailError
from dovetail.interfaces import JointModel
from dovetail.synthesis.codegen.compiler import WIDTH, MachineKernel, as_vectors, compiled
from dovetail.synthesis.codegen.layout import Layout, SpectralDerivative
from dovetail.synthesis.codegen.looped import looped_kernel_source
from dovetail.synthesis.codegen.straight_line import kernel_source
from dovetail.synthesis.coupled_system import CoupledSystem, JointStructure
from dovetail.synthesis.elimination import Program, plan_elimination
from dovetail.synthesis.joint_evaluation import (
    Sparsity,
    Theta,
    depends_on_frequency,
    filled_entries,
    joint_stiffness,
    joint_stiffness_jacobian,
)
from dovetail.synthesis.kernel_inputs import KernelInputs, kernel_inputs, require
from dovetail.synthesis.pivoting import PivotedSolver


@dataclass(frozen=True)
class Settings:
    """How an elimination is compiled."""

    straight_line: int = 1500
    """Number of multiplications up to which an elimination is compiled without loops, in less than a second.

    The choice depends only on the system, never on the number of samples, so that an FRF is always the same bit for
    bit.
    """


SETTINGS = Settings()


FactorsLike: TypeAlias = "NDArray[np.complex128] | Factors | None"
"""A factor for each pair and line, (n_pairs, n_freq), or for each line, (n_freq,); None means 1."""


@dataclass(frozen=True, eq=False)
class Factors:
    """A factor for each pair and each line that a kernel computes.

    Parameters
    ----------
    values : (n_pairs, n_lines) array
        The number of lines is a multiple of the vector length.
    """

    values: NDArray[np.complex128]

    @staticmethod
    def from_like(given: FactorsLike, pairs: int, lines: int) -> Factors:
        """Return the factor of each pair and line; that of the last line is repeated to fill the last vector."""
        if isinstance(given, Factors):
            return given
        every = np.broadcast_to(np.asarray(1.0 if given is None else given, dtype=np.complex128), (pairs, lines))
        return Factors(np.concatenate([every, np.repeat(every[:, -1:], -lines % WIDTH, axis=1)], axis=1))

    @cached_property
    def magnitudes(self) -> Factors:
        """The factors for amplitudes: the magnitudes of these."""
        return Factors(np.abs(self.values).astype(np.complex128))

    @cached_property
    def vectors(self) -> NDArray[np.float64]:
        """(n_vectors, 2 n_pairs, width) array of the real and imaginary parts of each pair's factors."""
        halves = np.stack([self.values.real, self.values.imag], axis=1)
        return as_vectors(halves.reshape(-1, self.values.shape[1]))


class SpectralInputs:
    """The kernel's inputs from joints that depend on frequency and provide their dynamic stiffness.

    Parameters
    ----------
    system : CoupledSystem
    program : Program
        Over the system's active DOFs.
    jacobian_columns : mapping of str to list of int
        Columns of each joint's theta by which to differentiate.
    inputs : KernelInputs
        Of the same system and program.
    """

    def __init__(
        self, system: CoupledSystem, program: Program, jacobian_columns: Mapping[str, list[int]], inputs: KernelInputs
    ) -> None:
        self._system = system
        self._off_diagonal = program.rows != program.columns
        self._jacobian_columns = jacobian_columns
        self._entries = {
            name: inputs.local_slots(name, system.sparsity[name].filled)
            for name, connection in system.graph.connections.items()
            if depends_on_frequency(connection.model)
        }

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that depend on frequency."""
        return tuple(self._entries)

    @cached_property
    def slots(self) -> tuple[int, ...]:
        """Slots at which these joints have entries."""
        return tuple(sorted({slot for entries in self._entries.values() for _, slot in entries}))

    @cached_property
    def derivatives(self) -> tuple[SpectralDerivative, ...]:
        """Parameter and slot of each row of the derivatives."""
        derivatives = {
            (parameter, slot)
            for name, entries in self._entries.items()
            for parameter in self._parameter_numbers(name).values()
            for _, slot in entries
        }
        return tuple(sorted(derivatives))

    @cached_property
    def parameters(self) -> NDArray[np.intp]:
        """(n_derivatives,) the parameter of each row of the derivatives."""
        return np.array([parameter for parameter, _ in self.derivatives], dtype=np.intp)

    def bytes_per_sample(self, *, derivatives: bool) -> int:
        """Return an estimate of the memory that the evaluation of one sample takes."""
        largest = max((self._model(name).size ** 2 for name in self._entries), default=0)
        rows = len(self.slots) + (len(self.derivatives) if derivatives else 0)
        temporaries = 12 if derivatives else 3
        return 16 * len(self._system.frequency) * (rows + temporaries * largest)

    def gather(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the sum over these joints at each slot, (n, n_slots, 2, n_freq).

        Raises
        ------
        UnplannedEntries
            A joint fills entries of its dynamic stiffness for which there is no slot.
        """
        frequency = self._system.frequency
        total = np.zeros((count, len(self.slots), 2, len(frequency)))
        row_of = {slot: row for row, slot in enumerate(self.slots)}
        for name, entries in self._entries.items():
            Z = joint_stiffness(name, self._model(name), frequency, theta[name])
            sparsity = self._system.sparsity[name].with_matrices(filled_entries(Z)[np.newaxis])
            require(self._system.sparsity, {name: sparsity})
            for (row, column), slot in entries:
                total[:, row_of[slot], 0] += Z[..., row, column].real
                total[:, row_of[slot], 1] += Z[..., row, column].imag
        return total

    def gather_weights(self, theta: Theta, count: int) -> NDArray[np.float64]:
        """Return the derivatives by the parameters, (n, n_derivatives, 2, n_freq), signed for -x^T dZ x.

        Raises
        ------
        UnplannedEntries
            A joint fills entries of a derivative for which there is no slot.
        """
        total = np.zeros((count, len(self.derivatives), 2, len(self._system.frequency)))
        row_of = {key: row for row, key in enumerate(self.derivatives)}
        for name, parameter, dZ in self._stiffness_derivatives(theta):
            for (row, column), slot in self._entries[name]:
                weight = -2.0 if self._off_diagonal[slot] else -1.0
                total[:, row_of[parameter, slot], 0] += weight * dZ[..., row, column].real
                total[:, row_of[parameter, slot], 1] += weight * dZ[..., row, column].imag
        return total

    def _stiffness_derivatives(self, theta: Theta) -> Iterator[tuple[str, int, NDArray[np.complex128]]]:
        """Yield joint, parameter index and derivative, one derivative at a time to save memory."""
        for name in self._entries:
            if numbers := self._parameter_numbers(name):
                derivatives = joint_stiffness_jacobian(name, self._model(name), self._system.frequency, theta[name])
                for column, dZ in enumerate(derivatives):
                    if column in numbers:
                        filled = filled_entries(dZ)[np.newaxis, np.newaxis]
                        sparsity = self._system.sparsity[name].with_derivatives([column], filled)
                        require(self._system.sparsity, {name: sparsity})
                        yield name, numbers[column], dZ

    def _parameter_numbers(self, name: str) -> dict[int, int]:
        """Return the index among all parameters for each column of a joint by which to differentiate."""
        before = 0
        for joint, columns in self._jacobian_columns.items():
            if joint == name:
                return {column: before + index for index, column in enumerate(columns)}
            before += len(columns)
        return {}

    def _model(self, name: str) -> JointModel:
        return self._system.graph.connections[name].model


@dataclass(frozen=True, eq=False)
class Plan:
    """The elimination of a coupled system, its inputs and its kernels, each created when it is first used.

    Parameters
    ----------
    system : CoupledSystem
    jacobian_columns : mapping of str to list of int
        Columns of each joint's theta by which to differentiate.
    pairs : sequence of (int, int)
        Output and input of each FRF, as indices into the system's points.
    order : sequence of int, optional
        Global DOFs that an earlier plan eliminated, in its order, which is kept; new DOFs are eliminated before them.
        Thus the FRFs of parameters that do not fill the new entries stay the same bit for bit.
    """

    system: CoupledSystem
    jacobian_columns: Mapping[str, list[int]]
    pairs: Sequence[tuple[int, int]]
    order: Sequence[int] = ()

    def widened(self, sparsity: Sparsity) -> Plan:
        """Return a plan that also covers further entries of some joints' matrices and derivatives."""
        system = self.system
        whole = {name: entries | sparsity.get(name, entries) for name, entries in system.sparsity.items()}
        wider = CoupledSystem(system.graph, system.frequency, system.points, system.condensed, whole)
        try:
            order = system.active[self.program.order].tolist()
        except DovetailError:  # a point moves only through the new entries
            order = self.order
        return Plan(wider, self.jacobian_columns, self.pairs, order)

    @cached_property
    def program(self) -> Program:
        """The symbolic elimination of the active DOFs, those of the pairs last."""
        last, *others = dict.fromkeys(dof for pair in self._dofs_of_pairs for dof in pair)
        position = {int(dof): index for index, dof in enumerate(self.system.active)}
        order = [position[dof] for dof in self.order if position[dof] not in (last, *others)]
        return plan_elimination(self.system.pattern, [last], [*order, *others])

    @cached_property
    def _dofs_of_pairs(self) -> tuple[tuple[int, int], ...]:
        """Output and input of each FRF, as indices of active DOFs."""
        index = [self.system.index(point) for point in self.system.points]
        return tuple((index[output], index[force]) for output, force in self.pairs)

    @cached_property
    def inputs(self) -> KernelInputs:
        """Entries of joints with constant matrices."""
        return kernel_inputs(JointStructure(self.system.joints, self.program, self.jacobian_columns))

    @cached_property
    def spectral(self) -> SpectralInputs:
        """Entries of joints that depend on frequency."""
        return SpectralInputs(self.system, self.program, self.jacobian_columns, self.inputs)

    @cached_property
    def pivoted(self) -> PivotedSolver:
        """Solutions with pivoting."""
        return PivotedSolver(self.system, self.jacobian_columns, self.pairs)

    @cached_property
    def _static(self) -> tuple[tuple[tuple[int, int], ...], NDArray[np.float64]]:
        """Slot and part (real or imaginary) of the substructures' entries, and the entries as the kernel reads them."""
        keys, rows = self.system.substructure_rows(self.program)
        vectors = np.empty((len(self.system.frequency) // WIDTH, len(keys), WIDTH))
        for number, row in enumerate(rows):
            vectors[:, number] = row.reshape(-1, WIDTH)
        return keys, vectors

    @cached_property
    def static(self) -> NDArray[np.float64]:
        """The substructures' entries as the kernel reads them."""
        return self._static[1]

    @cached_property
    def omega(self) -> NDArray[np.float64]:
        """Angular frequencies [rad/s] as the kernel reads them."""
        return as_vectors(2.0 * np.pi * self.system.frequency)

    def layout(self, *, derivatives: bool = False) -> Layout:
        """Return the meaning of the columns of the kernel's arrays."""
        layout = Layout(self._static[0], self.inputs.terms, self._dofs_of_pairs, self.spectral.slots)
        if not derivatives:
            return layout
        return replace(
            layout,
            derivatives=self.inputs.derivatives,
            spectral_derivatives=self.spectral.derivatives,
            parameters=self.inputs.parameters,
        )

    @cached_property
    def receptance_kernel(self) -> MachineKernel:
        """The kernel for complex FRFs."""
        return self._kernel(self.layout())

    @cached_property
    def amplitude_kernel(self) -> MachineKernel:
        """The kernel for magnitudes in single precision."""
        return self._kernel(self.layout(), amplitude=True)

    @cached_property
    def jacobian_kernel(self) -> MachineKernel:
        """The kernel for complex FRFs and their derivatives."""
        return self._kernel(self.layout(derivatives=True))

    def _kernel(self, layout: Layout, *, amplitude: bool = False) -> MachineKernel:
        return compiled(*_source(self.program, layout, amplitude, SETTINGS.straight_line))


@lru_cache(maxsize=64)
def _source(program: Program, layout: Layout, amplitude: bool, straight_line: int) -> tuple[str, int]:
    """Return the source of a kernel and its scratch memory; the same system on other lines has the same program."""
    straight = program.multiplications <= straight_line
    return (kernel_source if straight else looped_kernel_source)(program, layout, amplitude=amplitude)
