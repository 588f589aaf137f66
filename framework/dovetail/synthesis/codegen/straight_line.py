"""The elimination program as straight-line vector code (LLVM IR), one version for each sparsity pattern.

Real and imaginary parts are apart, and what is known to be zero has no instruction. For systems of up to some hundred
multiplications this is the fastest; for larger ones it takes long to compile (see `loops`).
"""

from __future__ import annotations

from collections.abc import Sequence

from dovetail.synthesis.codegen.kernel import FACTOR, KernelWriter
from dovetail.synthesis.codegen.layout import Layout
from dovetail.synthesis.codegen.vector_ir import MASK, ComplexVector
from dovetail.synthesis.elimination import Program

__all__ = ["kernel_source"]


class _StraightLine(KernelWriter):
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
        self._general = {slot: place for place, slot in enumerate(layout.general)}

    def source(self, amplitude: bool) -> str:
        for pivot in range(self._program.pivots):
            self._eliminate(pivot)
        last = int(self._program.diagonal[-1])
        self._load(last)
        inverse, scale = self._inverse(last)
        bad = str(self._bad)
        if amplitude:
            self.store_amplitude(scale, bad)
        else:
            inverse = self.spoilt(inverse[0], bad), inverse[1]
            self.store("%out", "%place", self.write.complex_product(inverse, FACTOR))
        if self.layout.parameters:
            self._differentiate(inverse)
        self.raise_flag(bad)
        return self.frame()

    def _load(self, slot: int) -> None:
        """Add up what substructures and joints contribute to a slot, when it is first needed."""
        if slot in self._slots:
            return
        write = self.write
        real, imaginary = (
            write.load("%static_here", self._static[slot, part]) if (slot, part) in self._static else None
            for part in (0, 1)
        )
        stiffness, mass = self._term(slot, "K"), self._term(slot, "M")
        added = self._added(slot)
        if self._program.rows[slot] == self._program.columns[slot]:
            size = write.add(write.magnitude(real), write.magnitude(stiffness))
            size = write.multiply_add(write.magnitude(mass), "%omega2", size)
            self._size[slot] = write.add(size, write.magnitude(added[0]))
        real = write.multiply_add(mass, "%minus_omega2", write.add(real, stiffness))
        imaginary = write.add(imaginary, self._term(slot, "D"))
        imaginary = write.multiply_add(self._term(slot, "C"), "%omega", imaginary)
        self._slots[slot] = write.add(real, added[0]), write.add(imaginary, added[1])

    def _added(self, slot: int) -> ComplexVector:
        """Load what joints that depend on frequency contribute to a slot."""
        if slot not in self._general:
            return None, None
        return self.load_pair("%general", "%general_row", self._general[slot])

    def _term(self, slot: int, part: str) -> str | None:
        if (slot, part) not in self._terms:
            return None
        return self.write.broadcast(self.write.load("%terms_here", self._terms[slot, part], "double"))

    def _inverse(self, slot: int) -> tuple[ComplexVector, str]:
        """Invert a pivot, noting where it nearly vanishes; also return 1 / |pivot|^2."""
        inverse, scale, small = self.inverse(self._slots[slot], self._size[slot])
        self._bad = small if self._bad is None else self.write.value(f"or {MASK} {self._bad}, {small}")
        return inverse, scale

    def _eliminate(self, pivot: int) -> None:
        write, program = self.write, self._program
        diagonal = int(program.diagonal[pivot])
        column = [int(slot) for slot in program.column[program.start[pivot] : program.start[pivot + 1]]]
        for slot in (diagonal, *column):
            self._load(slot)
        inverse, _ = self._inverse(diagonal)
        factors = [write.complex_product(self._slots[slot], inverse) for slot in column]
        negative = [(write.negative(real), write.negative(imaginary)) for real, imaginary in factors]
        self._factors[pivot] = negative
        for target, left, right in program.update[program.update_start[pivot] : program.update_start[pivot + 1]]:
            slot = int(target)
            self._load(slot)
            self._slots[slot] = write.complex_multiply_add(
                negative[left], self._slots[column[right]], self._slots[slot]
            )

    def _differentiate(self, response: ComplexVector) -> None:
        """Substitute back for the motion x under a unit force, and store -x^T (dZ/dp) x for each parameter."""
        write, program = self.write, self._program
        motion: dict[int, ComplexVector] = {int(program.order[-1]): response}
        for pivot in reversed(range(program.pivots)):
            rows = program.rows[program.column[program.start[pivot] : program.start[pivot + 1]]]
            x: ComplexVector = (None, None)
            for factor, row in zip(self._factors[pivot], rows, strict=True):
                x = write.complex_multiply_add(factor, motion[int(row)], x)
            motion[int(program.order[pivot])] = x
        slots = {slot for _, slot, _ in self.layout.derivatives}
        slots.update(slot for _, slot in self.layout.general_derivatives)
        products = {
            slot: write.complex_product(motion[int(program.rows[slot])], motion[int(program.columns[slot])])
            for slot in sorted(slots)
        }
        by_parameter: list[dict[str, list[tuple[int, int]]]] = [{} for _ in range(self.layout.parameters)]
        for column, (parameter, slot, part) in enumerate(self.layout.derivatives):
            by_parameter[parameter].setdefault(part, []).append((column, slot))
        for parameter, parts in enumerate(by_parameter):
            sums = {part: self._weighted(columns, products) for part, columns in parts.items()}
            self.store_derivative(parameter, self._general_derivative(parameter, self.combined(sums), products))

    def _general_derivative(
        self, parameter: int, total: ComplexVector, products: dict[int, ComplexVector]
    ) -> ComplexVector:
        """Add the derivatives of joints that depend on frequency, each times the product of motions at its entry."""
        for place, (owner, slot) in enumerate(self.layout.general_derivatives):
            if owner == parameter:
                weight = self.load_pair("%general_weights", "%general_weight_row", place)
                total = self.write.complex_multiply_add(weight, products[slot], total)
        return total

    def _weighted(self, columns: Sequence[tuple[int, int]], products: dict[int, ComplexVector]) -> ComplexVector:
        write = self.write
        real: str | None = None
        imaginary: str | None = None
        for column, slot in columns:
            weight = write.broadcast(write.load("%weights_here", column, "double"))
            real = write.multiply_add(weight, products[slot][0], real)
            imaginary = write.multiply_add(weight, products[slot][1], imaginary)
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
    return _StraightLine(program, layout).source(amplitude)
