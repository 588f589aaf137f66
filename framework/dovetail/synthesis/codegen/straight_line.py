"""The elimination program as straight-line vector code (LLVM IR), one version for each sparsity pattern.

Real and imaginary parts are separate, and an operand that is known to be zero costs no instruction. This is the fastest
form for systems of up to some hundred multiplications. Larger ones take long to compile (see `looped`).
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product

from dovetail.synthesis.codegen.compiler import MASK, ComplexVector
from dovetail.synthesis.codegen.kernel import KernelWriter
from dovetail.synthesis.codegen.layout import Layout
from dovetail.synthesis.elimination import Program


class _StraightLineKernel(KernelWriter):
    """Writes the kernel of a program without loops over its steps."""

    def __init__(self, program: Program, layout: Layout) -> None:
        super().__init__(program, layout)
        self._slots: dict[int, ComplexVector] = {}
        self._size: dict[int, str | None] = {}
        self._factors: dict[int, list[ComplexVector]] = {}
        self._inverses: dict[int, ComplexVector] = {}
        self._between: dict[tuple[int, int], ComplexVector] = {}
        self._bad: str | None = None
        self._static = {key: row for row, key in enumerate(layout.static)}
        self._terms = {key: column for column, key in enumerate(layout.terms)}
        self._spectral = {slot: row for row, slot in enumerate(layout.spectral_terms)}

    def source(self, amplitude: bool) -> str:
        for pivot in range(self.program.pivots):
            self._eliminate(pivot)
        self._load(int(self.program.diagonal[-1]))
        scale = self._invert_pivot(self.program.pivots)
        bad = str(self._bad)
        self.store_frfs(self._receptance, scale, bad, amplitude=amplitude)
        if self.layout.parameters and len(self.points) == 1:
            self._differentiate_drive_point()
        elif self.layout.parameters:
            self.differentiate(self._substitute())
        self.raise_flag(bad)
        return self.function()

    def _load(self, slot: int) -> None:
        """Sum the entries of substructures and joints at a slot when it is first needed."""
        if slot in self._slots:
            return
        ir = self.ir
        real, imaginary = (
            ir.load("%static_here", self._static[slot, half]) if (slot, half) in self._static else None
            for half in (0, 1)
        )
        stiffness, mass = self._term(slot, "K"), self._term(slot, "M")
        spectral = self._spectral_term(slot)
        if self.program.rows[slot] == self.program.columns[slot]:
            size = ir.add(ir.magnitude(real), ir.magnitude(stiffness))
            size = ir.multiply_add(ir.magnitude(mass), "%omega2", size)
            self._size[slot] = ir.add(size, ir.magnitude(spectral[0]))
        real = ir.multiply_add(mass, "%minus_omega2", ir.add(real, stiffness))
        imaginary = ir.add(imaginary, self._term(slot, "D"))
        imaginary = ir.multiply_add(self._term(slot, "C"), "%omega", imaginary)
        self._slots[slot] = ir.add(real, spectral[0]), ir.add(imaginary, spectral[1])

    def _spectral_term(self, slot: int) -> ComplexVector:
        """Load the sum over the joints that depend on frequency, at a slot."""
        if slot not in self._spectral:
            return None, None
        return self.load_complex("%spectral", "%spectral_row", self._spectral[slot])

    def _term(self, slot: int, matrix: str) -> str | None:
        if (slot, matrix) not in self._terms:
            return None
        return self.ir.broadcast(self.ir.load("%terms_here", self._terms[slot, matrix], "double"))

    def _invert_pivot(self, pivot: int) -> str:
        """Invert a pivot and record where it nearly vanishes; return 1 / |pivot|^2."""
        slot = int(self.program.diagonal[pivot])
        self._inverses[pivot], scale, small = self.invert(self._slots[slot], self._size[slot])
        self._bad = small if self._bad is None else self.ir.value(f"or {MASK} {self._bad}, {small}")
        return scale

    def _eliminate(self, pivot: int) -> None:
        ir, program = self.ir, self.program
        diagonal = int(program.diagonal[pivot])
        column = [int(slot) for slot in program.column[program.start[pivot] : program.start[pivot + 1]]]
        for slot in (diagonal, *column):
            self._load(slot)
        self._invert_pivot(pivot)
        factors = [ir.complex_product(self._slots[slot], self._inverses[pivot]) for slot in column]
        negative = [(ir.negative(real), ir.negative(imaginary)) for real, imaginary in factors]
        self._factors[pivot] = negative
        for target, row, other in program.update[program.update_start[pivot] : program.update_start[pivot + 1]]:
            slot = int(target)
            self._load(slot)
            self._slots[slot] = ir.complex_multiply_add(negative[row], self._slots[column[other]], self._slots[slot])

    def _below(self, pivot: int) -> list[tuple[ComplexVector, int]]:
        """Return -L and the row's DOF for each entry below a pivot."""
        if pivot == self.program.pivots:
            return []
        rows = self.program.rows[self.program.column[self.program.start[pivot] : self.program.start[pivot + 1]]]
        return [(factor, int(row)) for factor, row in zip(self._factors[pivot], rows, strict=True)]

    def _receptance(self, output: int, force: int) -> ComplexVector:
        """Return the entry of the inverse for two of the points, from those of points eliminated later.

        With Z = L D L^T, the matrix L^T H = D^-1 L^-1 is lower triangular, with the inverse pivots on its diagonal
        (Takahashi, Fagan, Chin 1973). H is symmetric bit for bit.
        """
        pivot, later = sorted((self.rank[output], self.rank[force]))
        if (pivot, later) not in self._between:
            value: ComplexVector = self._inverses[pivot] if pivot == later else (None, None)
            for factor, row in self._below(pivot):
                at = self._receptance(row, int(self.program.order[later]))
                value = self.ir.complex_multiply_add(factor, at, value)
            self._between[pivot, later] = value
        return self._between[pivot, later]

    def _motion(self, motion: dict[int, ComplexVector]) -> dict[int, ComplexVector]:
        """Compute the motion of all DOFs by back substitution from that of the points under a unit force."""
        for pivot in reversed(range(len(self.program.order) - len(self.points))):
            x: ComplexVector = (None, None)
            for factor, row in self._below(pivot):
                x = self.ir.complex_multiply_add(factor, motion[row], x)
            motion[int(self.program.order[pivot])] = x
        return motion

    def _differentiate_drive_point(self) -> None:
        """Store -x^T (dZ/dp) x for each parameter, with the motion x under a unit force at the only point."""
        ir, point = self.ir, self.points[0]
        x = self._motion({point: self._receptance(point, point)})
        entries: list[dict[int, dict[str, int]]] = [{} for _ in range(self.layout.parameters)]
        for column, (parameter, slot, matrix) in enumerate(self.layout.derivatives):
            entries[parameter].setdefault(slot, {})[matrix] = column
        products: dict[int, ComplexVector] = {}

        def product_at(slot: int) -> ComplexVector:  # made where it is first needed, so that few wait in memory
            if slot not in products:
                row, column = int(self.program.rows[slot]), int(self.program.columns[slot])
                products[slot] = ir.complex_product(x[row], x[column])
            return products[slot]

        factors = [(pair, self.factor(pair)) for pair in range(len(self.layout.pairs))]
        for parameter, by_slot in enumerate(entries):
            total: ComplexVector = (None, None)
            for slot, columns in by_slot.items():
                total = ir.complex_multiply_add(self._weight(columns), product_at(slot), total)
            for row, (owner, slot) in enumerate(self.layout.spectral_derivatives):
                if owner == parameter:
                    weight = self.load_complex("%spectral_weights", "%spectral_weight_row", row)
                    total = ir.complex_multiply_add(weight, product_at(slot), total)
            for pair, factor in factors:
                self.store_derivative(pair, parameter, total, factor)

    def _weight(self, columns: Mapping[str, int]) -> ComplexVector:
        """Return a derivative of an entry of the dynamic stiffness from those of the matrices, by their columns."""
        ir = self.ir
        weights = {m: ir.broadcast(ir.load("%weights_here", at, "double")) for m, at in columns.items()}
        real = ir.multiply_add(weights.get("M"), "%minus_omega2", weights.get("K"))
        return real, ir.multiply_add(weights.get("C"), "%omega", weights.get("D"))

    def _substitute(self) -> str:
        """Compute the motions under unit forces at all points; return the region that holds them.

        The code loops over the points, so that it is not longer for many of them.
        """
        count, size = len(self.points), len(self.rank)
        between, motions = self.region("between", 2 * count**2), self.region("motions", 2 * count * size)
        for at, (output, force) in enumerate(product(self.points, repeat=2)):
            self.store_pair(between, at, self._receptance(output, force))

        def substitute(index: str, _: list[str]) -> list[str]:
            force, x = self.within(between, index, count), self.within(motions, index, size)
            motion = self._motion({dof: self.load_pair(force, at) for at, dof in enumerate(self.points)})
            for dof, position in self.rank.items():
                self.store_pair(x, position, motion[dof])
            return []

        self.ir.loop(0, count, substitute)
        return motions


def kernel_source(program: Program, layout: Layout, *, amplitude: bool = False) -> tuple[str, int]:
    """Write the code that runs a program for many samples and frequencies.

    Parameters
    ----------
    program : Program
        With a single kept DOF, directly preceded by the other DOFs of the layout's pairs.
    layout : Layout
    amplitude : bool
        Store the factor's real part times the magnitude in single precision, instead of factor times value.

    Returns
    -------
    source : str
        LLVM IR of the function ``kernel``.
    scratch : int
        Number of doubles of its scratch memory.
    """
    kernel = _StraightLineKernel(program, layout)
    return kernel.source(amplitude), kernel.scratch
