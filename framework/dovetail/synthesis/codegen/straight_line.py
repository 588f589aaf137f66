"""The elimination program as straight-line vector code (LLVM IR), one version for each sparsity pattern.

Real and imaginary parts are separate, and an operand that is known to be zero costs no instruction. This is the fastest
form for systems of up to some hundred multiplications. Larger ones take long to compile (see `looped`).
"""

from __future__ import annotations

from collections.abc import Sequence

from dovetail.synthesis.codegen.kernel import FACTOR, KernelWriter
from dovetail.synthesis.codegen.layout import Layout
from dovetail.synthesis.codegen.vector_ir import MASK, ComplexVector
from dovetail.synthesis.elimination import Program

__all__ = ["kernel_source"]


class _StraightLineKernel(KernelWriter):
    """Writes the kernel of a program without loops over its steps."""

    def __init__(self, program: Program, layout: Layout) -> None:
        super().__init__(layout)
        self._program = program
        self._slots: dict[int, ComplexVector] = {}
        self._size: dict[int, str | None] = {}
        self._factors: dict[int, list[ComplexVector]] = {}
        self._bad: str | None = None
        self._static = {key: row for row, key in enumerate(layout.static)}
        self._terms = {key: column for column, key in enumerate(layout.terms)}
        self._spectral = {slot: row for row, slot in enumerate(layout.spectral_terms)}

    def source(self, amplitude: bool) -> str:
        for pivot in range(self._program.pivots):
            self._eliminate(pivot)
        last = int(self._program.diagonal[-1])
        self._load(last)
        inverse, scale = self._invert_pivot(last)
        bad = str(self._bad)
        if amplitude:
            self.store_amplitude(scale, bad)
        else:
            inverse = self.nan_where(bad, inverse[0]), inverse[1]
            self.store("%out", "%element", self.ir.complex_product(inverse, FACTOR))
        if self.layout.parameters:
            self._differentiate(inverse)
        self.raise_flag(bad)
        return self.function()

    def _load(self, slot: int) -> None:
        """Add up the entries of substructures and joints at a slot, when it is first needed."""
        if slot in self._slots:
            return
        ir = self.ir
        real, imaginary = (
            ir.load("%static_here", self._static[slot, half]) if (slot, half) in self._static else None
            for half in (0, 1)
        )
        stiffness, mass = self._term(slot, "K"), self._term(slot, "M")
        spectral = self._spectral_term(slot)
        if self._program.rows[slot] == self._program.columns[slot]:
            size = ir.add(ir.magnitude(real), ir.magnitude(stiffness))
            size = ir.multiply_add(ir.magnitude(mass), "%omega2", size)
            self._size[slot] = ir.add(size, ir.magnitude(spectral[0]))
        real = ir.multiply_add(mass, "%minus_omega2", ir.add(real, stiffness))
        imaginary = ir.add(imaginary, self._term(slot, "D"))
        imaginary = ir.multiply_add(self._term(slot, "C"), "%omega", imaginary)
        self._slots[slot] = ir.add(real, spectral[0]), ir.add(imaginary, spectral[1])

    def _spectral_term(self, slot: int) -> ComplexVector:
        """Load the sum over the joints that depend on frequency at a slot."""
        if slot not in self._spectral:
            return None, None
        return self.load_complex("%spectral", "%spectral_row", self._spectral[slot])

    def _term(self, slot: int, matrix: str) -> str | None:
        if (slot, matrix) not in self._terms:
            return None
        return self.ir.broadcast(self.ir.load("%terms_here", self._terms[slot, matrix], "double"))

    def _invert_pivot(self, slot: int) -> tuple[ComplexVector, str]:
        """Invert a pivot and mark where it nearly vanishes; also return 1 / |pivot|^2."""
        inverse, scale, small = self.invert(self._slots[slot], self._size[slot])
        self._bad = small if self._bad is None else self.ir.value(f"or {MASK} {self._bad}, {small}")
        return inverse, scale

    def _eliminate(self, pivot: int) -> None:
        ir, program = self.ir, self._program
        diagonal = int(program.diagonal[pivot])
        column = [int(slot) for slot in program.column[program.start[pivot] : program.start[pivot + 1]]]
        for slot in (diagonal, *column):
            self._load(slot)
        inverse, _ = self._invert_pivot(diagonal)
        factors = [ir.complex_product(self._slots[slot], inverse) for slot in column]
        negative = [(ir.negative(real), ir.negative(imaginary)) for real, imaginary in factors]
        self._factors[pivot] = negative
        for target, row, other in program.update[program.update_start[pivot] : program.update_start[pivot + 1]]:
            slot = int(target)
            self._load(slot)
            self._slots[slot] = ir.complex_multiply_add(negative[row], self._slots[column[other]], self._slots[slot])

    def _differentiate(self, response: ComplexVector) -> None:
        """Substitute back for the motion x under a unit force, and store -x^T (dZ/dp) x for each parameter."""
        ir, program = self.ir, self._program
        motion: dict[int, ComplexVector] = {int(program.order[-1]): response}
        for pivot in reversed(range(program.pivots)):
            rows = program.rows[program.column[program.start[pivot] : program.start[pivot + 1]]]
            x: ComplexVector = (None, None)
            for factor, row in zip(self._factors[pivot], rows, strict=True):
                x = ir.complex_multiply_add(factor, motion[int(row)], x)
            motion[int(program.order[pivot])] = x
        slots = {slot for _, slot, _ in self.layout.derivatives}
        slots.update(slot for _, slot in self.layout.spectral_derivatives)
        products = {
            slot: ir.complex_product(motion[int(program.rows[slot])], motion[int(program.columns[slot])])
            for slot in sorted(slots)
        }
        by_parameter: list[dict[str, list[tuple[int, int]]]] = [{} for _ in range(self.layout.parameters)]
        for column, (parameter, slot, matrix) in enumerate(self.layout.derivatives):
            by_parameter[parameter].setdefault(matrix, []).append((column, slot))
        for parameter, by_matrix in enumerate(by_parameter):
            sums = {matrix: self._weighted_sum(columns, products) for matrix, columns in by_matrix.items()}
            total = self._add_spectral_derivatives(parameter, self.dynamic_stiffness(sums), products)
            self.store_derivative(parameter, total)

    def _add_spectral_derivatives(
        self, parameter: int, total: ComplexVector, products: dict[int, ComplexVector]
    ) -> ComplexVector:
        """Add the derivatives of joints that depend on frequency, each times the product of motions at its entry."""
        for row, (owner, slot) in enumerate(self.layout.spectral_derivatives):
            if owner == parameter:
                weight = self.load_complex("%spectral_weights", "%spectral_weight_row", row)
                total = self.ir.complex_multiply_add(weight, products[slot], total)
        return total

    def _weighted_sum(self, columns: Sequence[tuple[int, int]], products: dict[int, ComplexVector]) -> ComplexVector:
        real: str | None = None
        imaginary: str | None = None
        for column, slot in columns:
            weight = self.ir.broadcast(self.ir.load("%weights_here", column, "double"))
            real = self.ir.multiply_add(weight, products[slot][0], real)
            imaginary = self.ir.multiply_add(weight, products[slot][1], imaginary)
        return real, imaginary


def kernel_source(program: Program, layout: Layout, *, amplitude: bool = False) -> str:
    """Write the code that runs a program for many samples and frequencies.

    Parameters
    ----------
    program : Program
        With a single kept DOF.
    layout : Layout
    amplitude : bool
        Store the factor's real part times the magnitude in single precision, in place of factor times value.

    Returns
    -------
    str
        LLVM IR of the function ``kernel``.
    """
    return _StraightLineKernel(program, layout).source(amplitude)
