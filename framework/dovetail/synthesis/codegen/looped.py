"""The elimination program as loops over tables of its steps (LLVM IR): any size compiles at once.

Where straight-line code (`code`) keeps what it can in registers, this kernel works on a scratch memory that holds all
slots for one vector of frequencies. It costs more for small systems, and less for large ones, whose straight-line code
leaves the instruction cache and takes seconds to compile.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Sequence
from functools import partial

from dovetail.synthesis.codegen.kernel import FACTOR, KernelWriter
from dovetail.synthesis.codegen.layout import Layout
from dovetail.synthesis.codegen.vector_ir import MASK, VECTOR, WIDTH, ComplexVector, constant
from dovetail.synthesis.elimination import Program

__all__ = ["looped_kernel_source"]

_PARTS = "KDCM"
_IMAGINARY = {"K": 0, "M": 0, "D": 1, "C": 1}
"""Whether a part of a joint's matrices goes to the real or to the imaginary part."""
_ZERO = constant(0.0)


class _Looped(KernelWriter):
    """Writes the kernel of a program as loops over tables."""

    def __init__(self, program: Program, layout: Layout) -> None:
        super().__init__(layout)
        self._program = program
        self._tables: list[str] = []
        self.scratch = 0
        size, slots = len(program.order), program.slots
        self._rank = {int(dof): place for place, dof in enumerate(program.order)}
        self._work = self._region("work", 2 * slots)
        self._factors = self._region("factors", 2 * len(program.column))
        self._sizes = self._region("sizes", size)
        self._motion = self._region("motion", 2 * size)
        used = {slot for _, slot, _ in layout.derivatives} | {slot for _, slot in layout.general_derivatives}
        self._used = {slot: place for place, slot in enumerate(sorted(used))}
        self._products = self._region("products", 2 * len(used))

    def source(self, amplitude: bool) -> str:
        self._fill()
        bad = self._eliminate()
        last = len(self._program.order) - 1
        slot = int(self._program.diagonal[last])
        size = self._load(self._sizes, last)
        inverse, scale, small = self.inverse(self._pair(self._work, slot), size)
        bad = self.write.value(f"or {MASK} {bad}, {small}")
        if amplitude:
            self.store_amplitude(scale, bad)
        else:
            inverse = self.spoilt(inverse[0], bad), inverse[1]
            self.store("%out", "%place", self.write.complex_product(inverse, FACTOR))
        if self.layout.parameters:
            self._put_pair(self._motion, last, inverse)
            self._substitute()
            self._multiply_motions()
            self._differentiate()
        self.raise_flag(bad)
        return "\n".join([*self._tables, self.frame()])

    def _region(self, name: str, vectors: int) -> str:
        """Reserve some vectors of the scratch memory and return the pointer to them."""
        first, self.scratch = self.scratch, self.scratch + WIDTH * vectors
        self.write.emit(f"%scratch_{name} = getelementptr double, ptr %scratch, i64 {first}")
        return f"%scratch_{name}"

    def _table(self, values: Iterable[int]) -> str:
        """Put integers into the code and return their name."""
        numbers = [int(value) for value in values]
        name = f"@table{len(self._tables)}"
        entries = ", ".join(f"i32 {number}" for number in numbers)
        self._tables.append(f"{name} = private constant [{len(numbers)} x i32] [{entries}]")
        return name

    def _entry(self, table: str, index: str | int) -> str:
        write = self.write
        address = write.value(f"getelementptr i32, ptr {table}, i64 {index}")
        return write.value(f"sext i32 {write.value(f'load i32, ptr {address}, align 4')} to i64")

    def _load(self, region: str, index: str | int) -> str:
        return self.write.load(region, index)

    def _put(self, region: str, index: str | int, value: str) -> None:
        address = self.write.value(f"getelementptr {VECTOR}, ptr {region}, i64 {index}")
        self.write.emit(f"store {VECTOR} {value}, ptr {address}, align 64")

    def _second(self, index: str | int) -> tuple[str, str]:
        """Return the places of real and imaginary part."""
        real = self.write.value(f"mul i64 {index}, 2")
        return real, self.write.value(f"add i64 {real}, 1")

    def _pair(self, region: str, index: str | int) -> ComplexVector:
        real, imaginary = self._second(index)
        return self._load(region, real), self._load(region, imaginary)

    def _put_pair(self, region: str, index: str | int, value: ComplexVector) -> None:
        for place, part in zip(self._second(index), value, strict=True):
            self._put(region, place, part or _ZERO)

    def _scatter(
        self, region: str, places: Sequence[int], sources: Sequence[int], value: Callable[[str], str | None]
    ) -> None:
        """Add ``value(source)`` to each place of a region."""
        where, what = self._table(places), self._table(sources)

        def add(index: str, _: list[str]) -> list[str]:
            place = self._entry(where, index)
            total = self.write.add(self._load(region, place), value(self._entry(what, index)))
            self._put(region, place, total or _ZERO)
            return []

        self.write.loop(0, len(places), add)

    def _fill(self) -> None:
        """Add up in each slot what substructures and joints contribute, and the size of what pivots are made of."""

        def clear(index: str, _: list[str]) -> list[str]:
            self._put(self._work, index, _ZERO)
            return []

        static = [2 * slot + part for slot, part in self.layout.static]
        self.write.loop(0, 2 * self._program.slots, clear)
        self._scatter(self._work, static, range(len(static)), lambda row: self._load("%static_here", row))
        self._measure()
        for part in _PARTS:
            chosen = [(slot, column) for column, (slot, kind) in enumerate(self.layout.terms) if kind == part]
            slots, columns = _columns(chosen)
            self._scatter(
                self._work, [2 * slot + _IMAGINARY[part] for slot in slots], columns, partial(self._term, part)
            )
        general = self.layout.general
        for side in (0, 1):
            places = [2 * slot + side for slot in general]
            self._scatter(self._work, places, range(len(general)), partial(self._added, side))

    def _measure(self) -> None:
        """Add up the magnitudes of the real summands of each pivot; the slots hold the substructures' so far."""
        pivot_of = {int(slot): place for place, slot in enumerate(self._program.diagonal)}
        diagonal = self._table(self._program.diagonal)

        def begin(index: str, _: list[str]) -> list[str]:
            real, _imaginary = self._pair(self._work, self._entry(diagonal, index))
            self._put(self._sizes, index, self.write.magnitude(real) or _ZERO)
            return []

        self.write.loop(0, len(pivot_of), begin)
        for part in "KM":
            chosen = [
                (pivot_of[slot], column)
                for column, (slot, kind) in enumerate(self.layout.terms)
                if kind == part and slot in pivot_of
            ]
            self._scatter(self._sizes, *_columns(chosen), partial(self._size_of_term, part))
        added = [(pivot_of[slot], row) for row, slot in enumerate(self.layout.general) if slot in pivot_of]
        self._scatter(self._sizes, *_columns(added), lambda row: self.write.magnitude(self._added(0, row)))

    def _size_of_term(self, part: str, column: str) -> str | None:
        return self.write.magnitude(self._term(part, column))

    def _term(self, part: str, column: str) -> str | None:
        """Load what joints contribute by one part of their matrices."""
        term = self.write.broadcast(self.write.load("%terms_here", column, "double"))
        scale = {"C": "%omega", "M": "%minus_omega2"}.get(part)
        return self.write.product(term, scale) if scale else term

    def _added(self, part: int, row: str) -> str | None:
        """Load what joints that depend on frequency contribute."""
        return self.load_pair("%general", "%general_row", row)[part]

    def _eliminate(self) -> str:
        """Run through the pivots and return where one nearly vanished."""
        write, program = self.write, self._program
        diagonal, start, column = (self._table(values) for values in (program.diagonal, program.start, program.column))
        updates, target = self._table(program.update_start), self._table(program.update[:, 0])

        def pivot(index: str, carried: list[str]) -> list[str]:
            value = self._pair(self._work, self._entry(diagonal, index))
            inverse, _, small = self.inverse(value, self._load(self._sizes, index))
            bad = write.value(f"or {MASK} {carried[0]}, {small}")
            first, last = self._entry(start, index), self._entry(start, write.value(f"add i64 {index}, 1"))

            def divide(place: str, _: list[str]) -> list[str]:
                real, imaginary = write.complex_product(self._pair(self._work, self._entry(column, place)), inverse)
                self._put_pair(self._factors, place, (write.negative(real), write.negative(imaginary)))
                return []

            write.loop(first, last, divide)

            def update_column(right: str, carried: list[str]) -> list[str]:
                given = self._pair(self._work, self._entry(column, right))

                def update(left: str, carried: list[str]) -> list[str]:
                    slot = self._entry(target, carried[0])
                    factor = self._pair(self._factors, left)
                    total = write.complex_multiply_add(factor, given, self._pair(self._work, slot))
                    self._put_pair(self._work, slot, total)
                    return [write.value(f"add i64 {carried[0]}, 1")]

                return write.loop(right, last, update, [("i64", carried[0])])

            write.loop(first, last, update_column, [("i64", self._entry(updates, index))])
            return [bad]

        return write.loop(0, program.pivots, pivot, [(MASK, "zeroinitializer")])[0]

    def _substitute(self) -> None:
        """Substitute back for the motion under a unit force, in the order of elimination."""
        write, program = self.write, self._program
        start = self._table(program.start)
        ranks = self._table(self._rank[int(row)] for row in program.rows[program.column])

        def pivot(index: str, _: list[str]) -> list[str]:
            place = write.value(f"sub i64 {program.pivots - 1}, {index}")
            first, last = self._entry(start, place), self._entry(start, write.value(f"add i64 {place}, 1"))

            def gather(at: str, sums: list[str]) -> list[str]:
                (a, b), (c, d) = self._pair(self._factors, at), self._pair(self._motion, self._entry(ranks, at))
                pairs = ((a, c), (b, d), (a, d), (b, c))
                return [str(write.multiply_add(x, y, total)) for (x, y), total in zip(pairs, sums, strict=True)]

            ac, bd, ad, bc = write.loop(first, last, gather, [(VECTOR, _ZERO)] * 4)
            self._put_pair(self._motion, place, (write.value(f"fsub {VECTOR} {ac}, {bd}"), write.add(ad, bc)))
            return []

        write.loop(0, program.pivots, pivot)

    def _multiply_motions(self) -> None:
        """Multiply the two motions that each differentiated slot couples."""
        rows = self._table(self._rank[int(self._program.rows[slot])] for slot in self._used)
        columns = self._table(self._rank[int(self._program.columns[slot])] for slot in self._used)

        def multiply(index: str, _: list[str]) -> list[str]:
            one, other = (self._pair(self._motion, self._entry(table, index)) for table in (rows, columns))
            self._put_pair(self._products, index, self.write.complex_product(one, other))
            return []

        self.write.loop(0, len(self._used), multiply)

    def _differentiate(self) -> None:
        """Store -x^T (dZ/dp) x for each parameter."""
        write, layout = self.write, self.layout
        ranges = {part: self._ranges(part) for part in _PARTS}
        general = [parameter for parameter, _ in layout.general_derivatives]
        general_start = self._table(_starts(general, layout.parameters))
        general_product = self._table(self._used[slot] for _, slot in layout.general_derivatives)

        def parameter(index: str, _: list[str]) -> list[str]:
            after = write.value(f"add i64 {index}, 1")
            sums = {part: self._weighted(*tables, index, after) for part, tables in ranges.items()}
            total = self.combined(sums)

            def add(place: str, sums: list[str]) -> list[str]:
                weight = self.load_pair("%general_weights", "%general_weight_row", place)
                product = self._pair(self._products, self._entry(general_product, place))
                real, imaginary = write.complex_multiply_add(weight, product, (sums[0], sums[1]))
                return [str(real), str(imaginary)]

            first, last = self._entry(general_start, index), self._entry(general_start, after)
            real, imaginary = write.loop(first, last, add, [(VECTOR, str(part)) for part in total])
            self.store_derivative(index, (real, imaginary))
            return []

        write.loop(0, layout.parameters, parameter)

    def _ranges(self, part: str) -> tuple[str, str, str]:
        """Return tables of the first entry of each parameter, and of each entry's column and product."""
        chosen = [
            (parameter, column, self._used[slot])
            for column, (parameter, slot, kind) in enumerate(self.layout.derivatives)
            if kind == part
        ]
        starts = _starts([parameter for parameter, _, _ in chosen], self.layout.parameters)
        return self._table(starts), self._table(c for _, c, _ in chosen), self._table(p for _, _, p in chosen)

    def _weighted(self, starts: str, columns: str, products: str, index: str, after: str) -> ComplexVector:
        """Add up the weighted products of one parameter and one part."""
        write = self.write

        def add(place: str, sums: list[str]) -> list[str]:
            weight = write.broadcast(write.load("%weights_here", self._entry(columns, place), "double"))
            product = self._pair(self._products, self._entry(products, place))
            return [str(write.multiply_add(weight, x, total)) for x, total in zip(product, sums, strict=True)]

        first, last = self._entry(starts, index), self._entry(starts, after)
        real, imaginary = write.loop(first, last, add, [(VECTOR, _ZERO)] * 2)
        return real, imaginary


def _starts(parameters: Sequence[int], count: int) -> list[int]:
    """Return where each parameter begins in a sorted list, and its end."""
    return [bisect_left(parameters, parameter) for parameter in range(count + 1)]


def _columns(pairs: Sequence[tuple[int, int]]) -> tuple[list[int], list[int]]:
    return [one for one, _ in pairs], [other for _, other in pairs]


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
    kernel = _Looped(program, layout)
    return kernel.source(amplitude), kernel.scratch
