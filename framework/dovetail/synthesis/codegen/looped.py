"""The elimination program as loops over tables of its steps (LLVM IR), which compile quickly for any size.

Straight-line code (`straight_line`) keeps as much as possible in registers. This kernel works in a scratch memory that
holds all slots for one vector of frequencies. It is slower for small systems and faster for large ones, whose
straight-line code does not fit into the instruction cache and takes seconds to compile.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from dovetail.synthesis.codegen.compiler import MASK, VECTOR, ComplexVector
from dovetail.synthesis.codegen.kernel import ZERO, KernelWriter
from dovetail.synthesis.codegen.layout import MATRICES, Layout
from dovetail.synthesis.elimination import Program

_IMAGINARY = {"K": 0, "M": 0, "D": 1, "C": 1}
"""Whether a matrix belongs to the real (0) or to the imaginary part (1) of the dynamic stiffness."""


class _LoopedKernel(KernelWriter):
    """Writes the kernel of a program as loops over tables."""

    def __init__(self, program: Program, layout: Layout) -> None:
        super().__init__(program, layout)
        size, count = len(program.order), len(self.points)
        self._work = self.region("work", 2 * program.slots)
        self._factors = self.region("factors", 2 * len(program.column))
        self._sizes = self.region("sizes", size)
        self._numbered_terms = list(enumerate(layout.terms))
        self._between = self.region("between", 2 * count**2)
        self._motions = self.region("motions", 2 * size * count)

    def source(self, amplitude: bool) -> str:
        self._fill_slots()
        scale, bad = self._invert_last(self._eliminate())
        self._substitute_between_points()
        self.store_frfs(self._load_between, scale, bad, amplitude=amplitude)
        if self.layout.parameters:
            self.ir.loop(0, len(self.points), self._substitute)
            self.differentiate(self._motions)
        self.raise_flag(bad)
        return self.function()

    def _scatter(self, region: str, pairs: Sequence[tuple[int, int]], value: Callable[[str], str | None]) -> None:
        """Add ``value(source)`` to each target in a region, for pairs of target and source."""
        targets, sources = self.table(target for target, _ in pairs), self.table(source for _, source in pairs)

        def add(index: str, _: list[str]) -> list[str]:
            target = self.entry(targets, index)
            total = self.ir.add(self.ir.load(region, target), value(self.entry(sources, index)))
            self.store_vector(region, target, total or ZERO)
            return []

        self.ir.loop(0, len(pairs), add)

    def _fill_slots(self) -> None:
        """Sum the entries of substructures and joints in each slot, and the magnitudes of each pivot's summands."""

        def clear(index: str, _: list[str]) -> list[str]:
            self.store_vector(self._work, index, ZERO)
            return []

        static = [(2 * slot + half, row) for row, (slot, half) in enumerate(self.layout.static)]
        self.ir.loop(0, 2 * self.program.slots, clear)
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
        """Sum the magnitudes of each pivot's real summands; at this point the slots hold those of substructures."""
        pivot_of = {int(slot): position for position, slot in enumerate(self.program.diagonal)}
        diagonal = self.table(self.program.diagonal)

        def begin(index: str, _: list[str]) -> list[str]:
            real, _imaginary = self.load_pair(self._work, self.entry(diagonal, index))
            self.store_vector(self._sizes, index, self.ir.magnitude(real) or ZERO)
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
        """Eliminate all pivots and return a mask of where one nearly vanished."""
        ir, program = self.ir, self.program
        diagonal, start, column = (self.table(values) for values in (program.diagonal, program.start, program.column))
        updates, target = self.table(program.update_start), self.table(program.update[:, 0])

        def pivot(index: str, carried: list[str]) -> list[str]:
            value = self.load_pair(self._work, self.entry(diagonal, index))
            inverse, _, small = self.invert(value, self.ir.load(self._sizes, index))
            bad = ir.value(f"or {MASK} {carried[0]}, {small}")
            first, last = self.entry(start, index), self.entry(start, ir.value(f"add i64 {index}, 1"))

            def divide(position: str, _: list[str]) -> list[str]:
                entry = self.load_pair(self._work, self.entry(column, position))
                real, imaginary = ir.complex_product(entry, inverse)
                self.store_pair(self._factors, position, (ir.negative(real), ir.negative(imaginary)))
                return []

            ir.loop(first, last, divide)

            def update_column(other: str, carried: list[str]) -> list[str]:
                entry = self.load_pair(self._work, self.entry(column, other))

                def update(row: str, carried: list[str]) -> list[str]:
                    slot = self.entry(target, carried[0])
                    factor = self.load_pair(self._factors, row)
                    total = ir.complex_multiply_add(factor, entry, self.load_pair(self._work, slot))
                    self.store_pair(self._work, slot, total)
                    return [ir.value(f"add i64 {carried[0]}, 1")]

                return ir.loop(other, last, update, [("i64", carried[0])])

            ir.loop(first, last, update_column, [("i64", self.entry(updates, index))])
            return [bad]

        return ir.loop(0, program.pivots, pivot, [(MASK, "zeroinitializer")])[0]

    def _invert_last(self, bad: str) -> tuple[str, str]:
        """Invert the last pivot to the receptance at the last point; return 1 / |pivot|^2 and the mask."""
        last = self.program.pivots
        value = self.load_pair(self._work, int(self.program.diagonal[last]))
        inverse, scale, small = self.invert(value, self.ir.load(self._sizes, last))
        self.store_pair(self._between, len(self.points) ** 2 - 1, inverse)
        return scale, self.ir.value(f"or {MASK} {bad}, {small}")

    def _load_between(self, output: int, force: int) -> ComplexVector:
        """Load the receptance between two of the points."""
        return self.load_pair(self._between, len(self.points) * self.points.index(output) + self.points.index(force))

    def _substitute_between_points(self) -> None:
        """Compute the receptances between the points from the last one backwards, as in straight-line code."""
        ir, program, count = self.ir, self.program, len(self.points)
        if count == 1:
            return
        before = len(program.order) - count
        diagonal, start = self.table(program.diagonal[before:]), self.table(program.start[before:])
        rows = self.table(self.rank[int(program.rows[slot])] - before for slot in program.column)

        def point(index: str, _: list[str]) -> list[str]:
            current = ir.value(f"sub i64 {count - 2}, {index}")
            after = ir.value(f"add i64 {current}, 1")
            first, last = self.entry(start, current), self.entry(start, after)

            def fill(other: str, value: ComplexVector) -> None:
                def gather(at: str, sums: list[str]) -> list[str]:
                    later = self.load_pair(self.within(self._between, self.entry(rows, at), count), other)
                    factor = self.load_pair(self._factors, at)
                    return [str(half) for half in ir.complex_multiply_add(factor, later, (sums[0], sums[1]))]

                real, imaginary = ir.loop(first, last, gather, [(VECTOR, str(half)) for half in value])
                for row, column in ((current, other), (other, current)):
                    self.store_pair(self.within(self._between, row, count), column, (real, imaginary))

            def with_later(other: str, _: list[str]) -> list[str]:
                fill(other, (ZERO, ZERO))
                return []

            ir.loop(after, count, with_later)
            fill(current, self.invert(self.load_pair(self._work, self.entry(diagonal, current)), None)[0])
            return []

        ir.loop(0, count - 1, point)

    def _substitute(self, force: str, _: list[str]) -> list[str]:
        """Compute the motion under a unit force at a point by back substitution, in the order of elimination."""
        ir, program, count = self.ir, self.program, len(self.points)
        before = len(program.order) - count
        between, motion = (
            self.within(self._between, force, count),
            self.within(self._motions, force, len(program.order)),
        )
        start = self.table(program.start)
        ranks = self.table(self.rank[int(row)] for row in program.rows[program.column])
        for at in range(count):
            self.store_pair(motion, before + at, self.load_pair(between, at))

        def pivot(index: str, _: list[str]) -> list[str]:
            position = ir.value(f"sub i64 {before - 1}, {index}")
            first, last = self.entry(start, position), self.entry(start, ir.value(f"add i64 {position}, 1"))

            def gather(at: str, sums: list[str]) -> list[str]:
                (a, b), (c, d) = self.load_pair(self._factors, at), self.load_pair(motion, self.entry(ranks, at))
                pairs = ((a, c), (b, d), (a, d), (b, c))
                return [str(ir.multiply_add(x, y, total)) for (x, y), total in zip(pairs, sums, strict=True)]

            ac, bd, ad, bc = ir.loop(first, last, gather, [(VECTOR, ZERO)] * 4)
            self.store_pair(motion, position, (ir.value(f"fsub {VECTOR} {ac}, {bd}"), ir.add(ad, bc)))
            return []

        ir.loop(0, before, pivot)
        return []


def looped_kernel_source(program: Program, layout: Layout, *, amplitude: bool = False) -> tuple[str, int]:
    """Write the code that runs a program of any size, with the parameters and results of `kernel_source`."""
    kernel = _LoopedKernel(program, layout)
    return kernel.source(amplitude), kernel.scratch
