"""The elimination program as loops over tables of its steps (LLVM IR), which compile quickly for any size.

Straight-line code (`straight_line`) keeps what it can in registers. This kernel works on a scratch memory that holds
all slots for one vector of frequencies. It is slower for small systems, and faster for large ones, whose straight-line
code does not fit the instruction cache and takes seconds to compile.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from dovetail.synthesis.codegen.kernel import FACTOR, KernelWriter
from dovetail.synthesis.codegen.layout import MATRICES, Layout
from dovetail.synthesis.codegen.vector_ir import MASK, VECTOR, WIDTH, ComplexVector, constant
from dovetail.synthesis.elimination import Program

__all__ = ["looped_kernel_source"]

_IMAGINARY = {"K": 0, "M": 0, "D": 1, "C": 1}
"""Whether a matrix belongs to the real (0) or to the imaginary part (1) of the dynamic stiffness."""
_ZERO = constant(0.0)


class _LoopedKernel(KernelWriter):
    """Writes the kernel of a program as loops over tables."""

    def __init__(self, program: Program, layout: Layout) -> None:
        super().__init__(layout)
        self._program = program
        self._tables: list[str] = []
        self.scratch = 0
        size = len(program.order)
        self._rank = {int(dof): position for position, dof in enumerate(program.order)}
        self._work = self._region("work", 2 * program.slots)
        self._factors = self._region("factors", 2 * len(program.column))
        self._sizes = self._region("sizes", size)
        self._numbered_terms = list(enumerate(layout.terms))
        self._motion = self._region("motion", 2 * size)
        slots = {slot for _, slot, _ in layout.derivatives} | {slot for _, slot in layout.spectral_derivatives}
        self._product_of = {slot: row for row, slot in enumerate(sorted(slots))}
        self._products = self._region("products", 2 * len(self._product_of))

    def source(self, amplitude: bool) -> str:
        self._fill_slots()
        bad = self._eliminate()
        last = len(self._program.order) - 1
        slot = int(self._program.diagonal[last])
        size = self.ir.load(self._sizes, last)
        inverse, scale, small = self.invert(self._load_pair(self._work, slot), size)
        bad = self.ir.value(f"or {MASK} {bad}, {small}")
        if amplitude:
            self.store_amplitude(scale, bad)
        else:
            inverse = self.nan_where(bad, inverse[0]), inverse[1]
            self.store("%out", "%element", self.ir.complex_product(inverse, FACTOR))
        if self.layout.parameters:
            self._store_pair(self._motion, last, inverse)
            self._substitute()
            self._multiply_motions()
            self._differentiate()
        self.raise_flag(bad)
        return "\n".join([*self._tables, self.function()])

    def _region(self, name: str, vectors: int) -> str:
        """Reserve some vectors of the scratch memory and return the pointer to them."""
        first, self.scratch = self.scratch, self.scratch + WIDTH * vectors
        self.ir.emit(f"%scratch_{name} = getelementptr double, ptr %scratch, i64 {first}")
        return f"%scratch_{name}"

    def _table(self, values: Iterable[int]) -> str:
        """Put integers into the code and return their name."""
        numbers = [int(value) for value in values]
        name = f"@table{len(self._tables)}"
        entries = ", ".join(f"i32 {number}" for number in numbers)
        self._tables.append(f"{name} = private constant [{len(numbers)} x i32] [{entries}]")
        return name

    def _entry(self, table: str, index: str | int) -> str:
        ir = self.ir
        address = ir.value(f"getelementptr i32, ptr {table}, i64 {index}")
        return ir.value(f"sext i32 {ir.value(f'load i32, ptr {address}, align 4')} to i64")

    def _store(self, region: str, index: str | int, value: str) -> None:
        address = self.ir.value(f"getelementptr {VECTOR}, ptr {region}, i64 {index}")
        self.ir.emit(f"store {VECTOR} {value}, ptr {address}, align 64")

    def _halves(self, index: str | int) -> tuple[str, str]:
        """Return the indices of real and imaginary part of a complex number."""
        real = self.ir.value(f"mul i64 {index}, 2")
        return real, self.ir.value(f"add i64 {real}, 1")

    def _load_pair(self, region: str, index: str | int) -> ComplexVector:
        real, imaginary = self._halves(index)
        return self.ir.load(region, real), self.ir.load(region, imaginary)

    def _store_pair(self, region: str, index: str | int, value: ComplexVector) -> None:
        for position, half in zip(self._halves(index), value, strict=True):
            self._store(region, position, half or _ZERO)

    def _scatter(self, region: str, pairs: Sequence[tuple[int, int]], value: Callable[[str], str | None]) -> None:
        """Add ``value(source)`` to each target in a region, for pairs of target and source."""
        targets, sources = self._table(target for target, _ in pairs), self._table(source for _, source in pairs)

        def add(index: str, _: list[str]) -> list[str]:
            target = self._entry(targets, index)
            total = self.ir.add(self.ir.load(region, target), value(self._entry(sources, index)))
            self._store(region, target, total or _ZERO)
            return []

        self.ir.loop(0, len(pairs), add)

    def _fill_slots(self) -> None:
        """Add up the entries of substructures and joints in each slot, and the magnitudes behind each pivot."""

        def clear(index: str, _: list[str]) -> list[str]:
            self._store(self._work, index, _ZERO)
            return []

        static = [(2 * slot + half, row) for row, (slot, half) in enumerate(self.layout.static)]
        self.ir.loop(0, 2 * self._program.slots, clear)
        self._scatter(self._work, static, lambda row: self.ir.load("%static_here", row))
        self._sum_magnitudes()
        for matrix in MATRICES:
            half = _IMAGINARY[matrix]
            terms = [(2 * slot + half, column) for column, (slot, kind) in self._numbered_terms if kind == matrix]
            self._scatter(self._work, terms, partial(self._term, matrix))
        for half in (0, 1):
            spectral = [(2 * slot + half, row) for row, slot in enumerate(self.layout.spectral_terms)]
            self._scatter(self._work, spectral, partial(self._spectral_term, half))

    def _sum_magnitudes(self) -> None:
        """Add up the magnitudes of the real summands of each pivot; so far the slots hold those of substructures."""
        pivot_of = {int(slot): position for position, slot in enumerate(self._program.diagonal)}
        diagonal = self._table(self._program.diagonal)

        def begin(index: str, _: list[str]) -> list[str]:
            real, _imaginary = self._load_pair(self._work, self._entry(diagonal, index))
            self._store(self._sizes, index, self.ir.magnitude(real) or _ZERO)
            return []

        self.ir.loop(0, len(pivot_of), begin)
        for matrix in "KM":
            terms = [
                (pivot_of[slot], column)
                for column, (slot, kind) in self._numbered_terms
                if kind == matrix and slot in pivot_of
            ]
            self._scatter(self._sizes, terms, partial(self._term_magnitude, matrix))
        spectral = [(pivot_of[slot], row) for row, slot in enumerate(self.layout.spectral_terms) if slot in pivot_of]
        self._scatter(self._sizes, spectral, lambda row: self.ir.magnitude(self._spectral_term(0, row)))

    def _term_magnitude(self, matrix: str, column: str) -> str | None:
        return self.ir.magnitude(self._term(matrix, column))

    def _term(self, matrix: str, column: str) -> str | None:
        """Load an entry of a joint's matrix and scale it as in the dynamic stiffness."""
        term = self.ir.broadcast(self.ir.load("%terms_here", column, "double"))
        scale = {"C": "%omega", "M": "%minus_omega2"}.get(matrix)
        return self.ir.product(term, scale) if scale else term

    def _spectral_term(self, half: int, row: str) -> str | None:
        """Load the real (0) or imaginary part (1) of an entry of the joints that depend on frequency."""
        return self.load_complex("%spectral", "%spectral_row", row)[half]

    def _eliminate(self) -> str:
        """Run through the pivots and return a mask of where one nearly vanished."""
        ir, program = self.ir, self._program
        diagonal, start, column = (self._table(values) for values in (program.diagonal, program.start, program.column))
        updates, target = self._table(program.update_start), self._table(program.update[:, 0])

        def pivot(index: str, carried: list[str]) -> list[str]:
            value = self._load_pair(self._work, self._entry(diagonal, index))
            inverse, _, small = self.invert(value, self.ir.load(self._sizes, index))
            bad = ir.value(f"or {MASK} {carried[0]}, {small}")
            first, last = self._entry(start, index), self._entry(start, ir.value(f"add i64 {index}, 1"))

            def divide(position: str, _: list[str]) -> list[str]:
                entry = self._load_pair(self._work, self._entry(column, position))
                real, imaginary = ir.complex_product(entry, inverse)
                self._store_pair(self._factors, position, (ir.negative(real), ir.negative(imaginary)))
                return []

            ir.loop(first, last, divide)

            def update_column(other: str, carried: list[str]) -> list[str]:
                entry = self._load_pair(self._work, self._entry(column, other))

                def update(row: str, carried: list[str]) -> list[str]:
                    slot = self._entry(target, carried[0])
                    factor = self._load_pair(self._factors, row)
                    total = ir.complex_multiply_add(factor, entry, self._load_pair(self._work, slot))
                    self._store_pair(self._work, slot, total)
                    return [ir.value(f"add i64 {carried[0]}, 1")]

                return ir.loop(other, last, update, [("i64", carried[0])])

            ir.loop(first, last, update_column, [("i64", self._entry(updates, index))])
            return [bad]

        return ir.loop(0, program.pivots, pivot, [(MASK, "zeroinitializer")])[0]

    def _substitute(self) -> None:
        """Substitute back for the motion under a unit force, in the order of elimination."""
        ir, program = self.ir, self._program
        start = self._table(program.start)
        ranks = self._table(self._rank[int(row)] for row in program.rows[program.column])

        def pivot(index: str, _: list[str]) -> list[str]:
            position = ir.value(f"sub i64 {program.pivots - 1}, {index}")
            first, last = self._entry(start, position), self._entry(start, ir.value(f"add i64 {position}, 1"))

            def gather(at: str, sums: list[str]) -> list[str]:
                (a, b), (c, d) = (
                    self._load_pair(self._factors, at),
                    self._load_pair(self._motion, self._entry(ranks, at)),
                )
                pairs = ((a, c), (b, d), (a, d), (b, c))
                return [str(ir.multiply_add(x, y, total)) for (x, y), total in zip(pairs, sums, strict=True)]

            ac, bd, ad, bc = ir.loop(first, last, gather, [(VECTOR, _ZERO)] * 4)
            self._store_pair(self._motion, position, (ir.value(f"fsub {VECTOR} {ac}, {bd}"), ir.add(ad, bc)))
            return []

        ir.loop(0, program.pivots, pivot)

    def _multiply_motions(self) -> None:
        """Multiply the two motions that each differentiated slot couples."""
        rows = self._table(self._rank[int(self._program.rows[slot])] for slot in self._product_of)
        columns = self._table(self._rank[int(self._program.columns[slot])] for slot in self._product_of)

        def multiply(index: str, _: list[str]) -> list[str]:
            x_row, x_column = (self._load_pair(self._motion, self._entry(table, index)) for table in (rows, columns))
            self._store_pair(self._products, index, self.ir.complex_product(x_row, x_column))
            return []

        self.ir.loop(0, len(self._product_of), multiply)

    def _differentiate(self) -> None:
        """Store -x^T (dZ/dp) x for each parameter."""
        ir, layout = self.ir, self.layout
        tables = {matrix: self._derivative_tables(matrix) for matrix in MATRICES}
        starts = self._table(_starts([parameter for parameter, _ in layout.spectral_derivatives], layout.parameters))
        products = self._table(self._product_of[slot] for _, slot in layout.spectral_derivatives)

        def parameter(index: str, _: list[str]) -> list[str]:
            after = ir.value(f"add i64 {index}, 1")
            sums = {matrix: self._weighted_sum(*tables[matrix], index, after) for matrix in MATRICES}
            total = self.dynamic_stiffness(sums)

            def add(row: str, sums: list[str]) -> list[str]:
                weight = self.load_complex("%spectral_weights", "%spectral_weight_row", row)
                product = self._load_pair(self._products, self._entry(products, row))
                real, imaginary = ir.complex_multiply_add(weight, product, (sums[0], sums[1]))
                return [str(real), str(imaginary)]

            first, last = self._entry(starts, index), self._entry(starts, after)
            real, imaginary = ir.loop(first, last, add, [(VECTOR, str(half)) for half in total])
            self.store_derivative(index, (real, imaginary))
            return []

        ir.loop(0, layout.parameters, parameter)

    def _derivative_tables(self, matrix: str) -> tuple[str, str, str]:
        """Return tables of the first entry of each parameter, and of each entry's column and product."""
        entries = [
            (parameter, column, self._product_of[slot])
            for column, (parameter, slot, kind) in enumerate(self.layout.derivatives)
            if kind == matrix
        ]
        starts = _starts([parameter for parameter, _, _ in entries], self.layout.parameters)
        return self._table(starts), self._table(c for _, c, _ in entries), self._table(p for _, _, p in entries)

    def _weighted_sum(self, starts: str, columns: str, products: str, index: str, after: str) -> ComplexVector:
        """Add up the weighted products of one parameter and one matrix."""
        ir = self.ir

        def add(entry: str, sums: list[str]) -> list[str]:
            weight = ir.broadcast(ir.load("%weights_here", self._entry(columns, entry), "double"))
            product = self._load_pair(self._products, self._entry(products, entry))
            return [str(ir.multiply_add(weight, x, total)) for x, total in zip(product, sums, strict=True)]

        first, last = self._entry(starts, index), self._entry(starts, after)
        real, imaginary = ir.loop(first, last, add, [(VECTOR, _ZERO)] * 2)
        return real, imaginary


def _starts(parameters: Sequence[int], count: int) -> list[int]:
    """Return where each parameter begins in a sorted list, and its end."""
    return [bisect_left(parameters, parameter) for parameter in range(count + 1)]


def looped_kernel_source(program: Program, layout: Layout, *, amplitude: bool = False) -> tuple[str, int]:
    """Write the code that runs a program of any size for many samples and frequencies.

    Parameters
    ----------
    program : Program
        With a single kept DOF.
    layout : Layout
    amplitude : bool
        Store the factor's real part times the magnitude in single precision, in place of factor times value.

    Returns
    -------
    source : str
        LLVM IR of the function ``kernel``.
    scratch : int
        Number of doubles of its scratch memory.
    """
    kernel = _LoopedKernel(program, layout)
    return kernel.source(amplitude), kernel.scratch
