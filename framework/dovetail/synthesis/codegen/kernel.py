"""Common parts of both kernels: the loops over frequencies and samples, the check of the pivots, tables and stores.

The outer loop runs over vectors of frequencies and the inner loop over samples, so that the substructures' entries for
a vector of frequencies stay in the first-level cache for all samples.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping, Sequence

from dovetail.synthesis.codegen.compiler import (
    MASK,
    VECTOR,
    WIDTH,
    ComplexVector,
    VectorWriter,
    constant,
    declarations,
)
from dovetail.synthesis.codegen.layout import MATRICES, Layout
from dovetail.synthesis.elimination import Program

ZERO = constant(0.0)
_PAIRS = f"<{2 * WIDTH} x double>"
"""A vector of complex numbers, real and imaginary parts alternating."""
_MANY_SAMPLES = 8
"""Number of samples from which derivatives do not stay in a cache until they are read."""
_TINY_PIVOT = 1e-16
"""Square of a pivot over that of the size of its summands, below which half of its digits are lost."""


class KernelWriter:
    """Writes the function ``kernel`` for one layout of its arrays.

    Parameters
    ----------
    program : Program
        With a single kept DOF, directly preceded by the other DOFs of the layout's pairs.
    layout : Layout

    Attributes
    ----------
    ir : VectorWriter
        Writer of the instructions for one sample and one vector of frequencies.
    scratch : int
        Number of doubles of the scratch memory.
    rank : dict of int to int
        Position of each DOF in the order of elimination.
    points : list of int
        The DOFs of the pairs, in the order of elimination.
    """

    def __init__(self, program: Program, layout: Layout) -> None:
        self.program = program
        self.layout = layout
        self.ir = VectorWriter()
        self.scratch = 0
        self._tables: list[str] = []
        self.rank = {int(dof): position for position, dof in enumerate(program.order)}
        used = {dof for pair in layout.pairs for dof in pair}
        self.points = [int(dof) for dof in program.order[len(program.order) - len(used) :]]

    def region(self, name: str, vectors: int) -> str:
        """Reserve some vectors of the scratch memory and return the pointer to them."""
        first, self.scratch = self.scratch, self.scratch + WIDTH * vectors
        self.ir.emit(f"%scratch_{name} = getelementptr double, ptr %scratch, i64 {first}")
        return f"%scratch_{name}"

    def within(self, region: str, row: str, length: int) -> str:
        """Return the pointer to a row of `length` complex numbers in a region."""
        return self.ir.value(
            f"getelementptr {VECTOR}, ptr {region}, i64 {self.ir.value(f'mul i64 {row}, {2 * length}')}"
        )

    def table(self, values: Iterable[int]) -> str:
        """Add a table of integers to the code and return its name."""
        numbers = [int(value) for value in values]
        name = f"@table{len(self._tables)}"
        entries = ", ".join(f"i32 {number}" for number in numbers)
        self._tables.append(f"{name} = private constant [{len(numbers)} x i32] [{entries}]")
        return name

    def entry(self, table: str, index: str | int) -> str:
        """Return an integer of a table."""
        ir = self.ir
        address = ir.value(f"getelementptr i32, ptr {table}, i64 {index}")
        return ir.value(f"sext i32 {ir.value(f'load i32, ptr {address}, align 4')} to i64")

    def store_vector(self, region: str, index: str | int, value: str) -> None:
        """Store a vector in a region."""
        address = self.ir.value(f"getelementptr {VECTOR}, ptr {region}, i64 {index}")
        self.ir.emit(f"store {VECTOR} {value}, ptr {address}, align 64")

    def load_pair(self, region: str, index: str | int) -> ComplexVector:
        """Load a complex number from a region."""
        real, imaginary = self._halves(index)
        return self.ir.load(region, real), self.ir.load(region, imaginary)

    def store_pair(self, region: str, index: str | int, value: ComplexVector) -> None:
        """Store a complex number in a region."""
        for position, half in zip(self._halves(index), value, strict=True):
            self.store_vector(region, position, half or ZERO)

    def _halves(self, index: str | int) -> tuple[str, str]:
        """Return the indices of real and imaginary part of a complex number."""
        real = self.ir.value(f"mul i64 {index}, 2")
        return real, self.ir.value(f"add i64 {real}, 1")

    def invert(self, value: ComplexVector, size: str | None) -> tuple[ComplexVector, str, str]:
        """Invert a pivot; also return 1 / |pivot|^2, and a mask of where it is tiny against the summands' `size`."""
        ir = self.ir
        real, imaginary = value
        square = ir.multiply_add(real, real, ir.product(imaginary, imaginary)) or "zeroinitializer"
        limit = ir.product(ir.product(size, size), constant(_TINY_PIVOT)) or "zeroinitializer"
        small = ir.value(f"fcmp ule {VECTOR} {square}, {limit}")
        scale = ir.value(f"fdiv {VECTOR} {constant(1.0)}, {square}")
        return (ir.product(real, scale), ir.negative(ir.product(imaginary, scale))), scale, small

    def load_complex(self, pointer: str, row: str, index: str | int) -> ComplexVector:
        """Load a complex row of an array (samples, rows, 2, lines) at the current vector of lines."""
        ir = self.ir
        real_row = ir.value(f"add i64 {row}, {ir.value(f'mul i64 {index}, 2')}")
        return self._load_row(pointer, real_row), self._load_row(pointer, ir.value(f"add i64 {real_row}, 1"))

    def _load_row(self, pointer: str, row: str) -> str:
        start = self.ir.value(f"add i64 {self.ir.value(f'mul i64 {row}, %lines')}, %line")
        address = self.ir.value(f"getelementptr double, ptr {pointer}, i64 {start}")
        return self.ir.value(f"load {VECTOR}, ptr {address}, align 8")

    def nan_where(self, bad: str, value: str | None) -> str:
        """Replace a value by NaN where a pivot nearly vanished."""
        nan = constant(float("nan"))
        return self.ir.value(f"select {MASK} {bad}, {VECTOR} {nan}, {VECTOR} {value or 'zeroinitializer'}")

    def raise_flag(self, bad: str) -> None:
        """Record that a pivot nearly vanished at some line of this sample."""
        ir = self.ir
        bits = ir.value(f"bitcast {MASK} {bad} to i{WIDTH}")
        address = ir.value(f"getelementptr i{WIDTH}, ptr %flags, i64 %sample")
        before = ir.value(f"load i{WIDTH}, ptr {address}")
        ir.emit(f"store i{WIDTH} {ir.value(f'or i{WIDTH} {before}, {bits}')}, ptr {address}")

    def store(self, pointer: str, index: str, value: ComplexVector) -> None:
        """Store a complex vector, starting at a complex element."""
        both, address = self.interleave(pointer, index, value)
        self.ir.emit(f"store {_PAIRS} {both}, ptr {address}, align 64")

    def stream(self, pointer: str, index: str, value: ComplexVector) -> None:
        """Store a complex vector; if there are many samples, bypass the caches, since it is not read again soon."""
        ir = self.ir
        both, address = self.interleave(pointer, index, value)
        label = both.strip("%")
        ir.emit(f"br i1 %many, label %past_{label}, label %kept_{label}")
        ir.lines.append(f"past_{label}:")
        ir.emit(f"store {_PAIRS} {both}, ptr {address}, align 64, !nontemporal !0")
        ir.emit(f"br label %stored_{label}")
        ir.lines.append(f"kept_{label}:")
        ir.emit(f"store {_PAIRS} {both}, ptr {address}, align 64")
        ir.emit(f"br label %stored_{label}")
        ir.lines.append(f"stored_{label}:")

    def interleave(self, pointer: str, index: str, value: ComplexVector) -> tuple[str, str]:
        """Return a vector of alternating real and imaginary parts, and the address of a complex element."""
        ir = self.ir
        mask = ", ".join(f"i32 {lane}, i32 {lane + WIDTH}" for lane in range(WIDTH))
        halves = ", ".join(f"{VECTOR} {half or 'zeroinitializer'}" for half in value)
        both = ir.value(f"shufflevector {halves}, <{2 * WIDTH} x i32> <{mask}>")
        return both, ir.value(f"getelementptr {{double, double}}, ptr {pointer}, i64 {index}")

    def dynamic_stiffness(self, sums: Mapping[str, ComplexVector]) -> ComplexVector:
        """Return K + iD + i omega C - omega^2 M; a matrix that is not in `sums` is zero."""
        ir = self.ir
        none: ComplexVector = (None, None)
        (k_re, k_im), (d_re, d_im), (c_re, c_im), (m_re, m_im) = (sums.get(matrix, none) for matrix in MATRICES)
        turned_re, turned_im = ir.multiply_add(c_re, "%omega", d_re), ir.multiply_add(c_im, "%omega", d_im)
        real = ir.add(ir.multiply_add(m_re, "%minus_omega2", k_re), ir.negative(turned_im))
        imaginary = ir.add(ir.multiply_add(m_im, "%minus_omega2", k_im), turned_re)
        return real, imaginary

    def factor(self, pair: str | int) -> ComplexVector:
        """Load the factor that converts a pair's receptance to the stored quantity."""
        return self.load_pair("%factors_here", pair)

    def _row(self, pair: str | int) -> str:
        """Return the row of a pair among the FRFs of all samples."""
        return self.ir.value(f"add i64 %frf_row, {pair}")

    def _element(self, row: str) -> str:
        """Return the index of the current vector of lines in a row."""
        return self.ir.value(f"add i64 {self.ir.value(f'mul i64 {row}, %lines')}, %line")

    def store_derivative(self, pair: str | int, parameter: str | int, value: ComplexVector, at: ComplexVector) -> None:
        """Store the derivative of a pair's receptance by a parameter, times the pair's factor."""
        ir = self.ir
        first = ir.value(f"mul i64 {self._row(pair)}, {self.layout.parameters}")
        row = ir.value(f"add i64 {first}, {parameter}")
        self.stream("%jacobian", self._element(row), ir.complex_product(value, at))

    def store_frfs(
        self, receptance: Callable[[int, int], ComplexVector], scale: str, bad: str, *, amplitude: bool
    ) -> None:
        """Store each pair's receptance times its factor, or its magnitude; `scale` is |H|^2 at the last point."""
        ir = self.ir
        for pair, (output, force) in enumerate(self.layout.pairs):
            real, imaginary = receptance(output, force)
            if amplitude:
                drive_point = output == force == self.points[-1]
                square = scale if drive_point else ir.multiply_add(real, real, ir.product(imaginary, imaginary))
                self._store_amplitude(pair, square or ZERO, bad)
            else:
                value = ir.complex_product((self.nan_where(bad, real), imaginary), self.factor(pair))
                self.store("%out", self._element(self._row(pair)), value)

    def _store_amplitude(self, pair: int, square: str, bad: str) -> None:
        """Store factor * |H| in single precision."""
        ir = self.ir
        root = ir.value(f"call {VECTOR} @llvm.sqrt.v{WIDTH}f64({VECTOR} {square})")
        value = self.nan_where(bad, ir.product(root, self.factor(pair)[0]))
        single = ir.value(f"fptrunc {VECTOR} {value} to <{WIDTH} x float>")
        address = ir.value(f"getelementptr float, ptr %out, i64 {self._element(self._row(pair))}")
        ir.emit(f"store <{WIDTH} x float> {single}, ptr {address}, align 4")

    def differentiate(self, motions: str) -> None:
        """Store -x_o^T (dZ/dp) x_i of each pair for each parameter, with loops over tables.

        `motions` is a region with the motion of all DOFs, in their order, under a unit force at each of the points.
        """
        slots = {slot for _, slot, _ in self.layout.derivatives}
        slots.update(slot for _, slot in self.layout.spectral_derivatives)
        product_of = {slot: row for row, slot in enumerate(sorted(slots))}
        products = self.region("products", 2 * len(product_of))
        places = [self.table(self.points.index(pair[end]) for pair in self.layout.pairs) for end in (0, 1)]

        def store(pair: str, _: list[str]) -> list[str]:
            x, y = (self.within(motions, self.entry(table, pair), len(self.rank)) for table in places)
            self._multiply_motions(x, y, products, list(product_of))
            self._store_derivatives(pair, products, product_of)
            return []

        self.ir.loop(0, len(self.layout.pairs), store)

    def _multiply_motions(self, x: str, y: str, products: str, slots: list[int]) -> None:
        """Multiply, for each differentiated slot, the entries of two motions that it couples."""
        rows = self.table(self.rank[int(dof)] for dof in self.program.rows[slots])
        columns = self.table(self.rank[int(dof)] for dof in self.program.columns[slots])

        def multiply(index: str, _: list[str]) -> list[str]:
            row, column = self.entry(rows, index), self.entry(columns, index)
            if len(self.points) == 1:
                product = self.ir.complex_product(self.load_pair(x, row), self.load_pair(x, column))
            else:
                product = self._symmetric_product(x, y, row, column)
            self.store_pair(products, index, product)
            return []

        self.ir.loop(0, len(slots), multiply)

    def _symmetric_product(self, x: str, y: str, row: str, column: str) -> ComplexVector:
        """Return (x_r y_c + x_c y_r) / 2 of two motions, the weight of an entry of the lower triangle."""
        x_row, y_row, x_column, y_column = (self.load_pair(motion, at) for at in (row, column) for motion in (x, y))
        real, imaginary = self.ir.complex_multiply_add(x_row, y_column, self.ir.complex_product(x_column, y_row))
        return self.ir.product(real, constant(0.5)), self.ir.product(imaginary, constant(0.5))

    def _store_derivatives(self, pair: str, products: str, product_of: Mapping[int, int]) -> None:
        """Store the weighted sum of products for each parameter."""
        ir, layout, factor = self.ir, self.layout, self.factor(pair)
        tables = {matrix: self._derivative_tables(matrix, product_of) for matrix in MATRICES}
        starts = self.table(_starts([parameter for parameter, _ in layout.spectral_derivatives], layout.parameters))
        rows = self.table(product_of[slot] for _, slot in layout.spectral_derivatives)

        def parameter(index: str, _: list[str]) -> list[str]:
            after = ir.value(f"add i64 {index}, 1")
            sums = {matrix: self._sum_products(products, *tables[matrix], index, after) for matrix in MATRICES}
            total = self.dynamic_stiffness(sums)

            def add(row: str, sums: list[str]) -> list[str]:
                weight = self.load_complex("%spectral_weights", "%spectral_weight_row", row)
                product = self.load_pair(products, self.entry(rows, row))
                real, imaginary = ir.complex_multiply_add(weight, product, (sums[0], sums[1]))
                return [str(real), str(imaginary)]

            first, last = self.entry(starts, index), self.entry(starts, after)
            real, imaginary = ir.loop(first, last, add, [(VECTOR, str(half)) for half in total])
            self.store_derivative(pair, index, (real, imaginary), factor)
            return []

        ir.loop(0, layout.parameters, parameter)

    def _derivative_tables(self, matrix: str, product_of: Mapping[int, int]) -> tuple[str, str, str]:
        """Return tables of each parameter's first entry, and of each entry's column and product."""
        entries = [
            (parameter, column, product_of[slot])
            for column, (parameter, slot, kind) in enumerate(self.layout.derivatives)
            if kind == matrix
        ]
        starts = _starts([parameter for parameter, _, _ in entries], self.layout.parameters)
        return self.table(starts), self.table(c for _, c, _ in entries), self.table(p for _, _, p in entries)

    def _sum_products(
        self, products: str, starts: str, columns: str, rows: str, index: str, after: str
    ) -> ComplexVector:
        """Sum the weighted products of one parameter and one matrix."""
        ir = self.ir

        def add(entry: str, sums: list[str]) -> list[str]:
            weight = ir.broadcast(ir.load("%weights_here", self.entry(columns, entry), "double"))
            product = self.load_pair(products, self.entry(rows, entry))
            return [str(ir.multiply_add(weight, x, total)) for x, total in zip(product, sums, strict=True)]

        first, last = self.entry(starts, index), self.entry(starts, after)
        real, imaginary = ir.loop(first, last, add, [(VECTOR, ZERO)] * 2)
        return real, imaginary

    def function(self) -> str:
        """Return the LLVM IR of the function: the instructions, in loops over vectors of frequencies and over samples.

        The fence at its end makes the stores that bypass the caches visible to other threads.
        """
        layout = self.layout
        return "\n".join(
            [
                *self._tables,
                "!0 = !{i32 1}",
                *declarations(),
                "define void @kernel(i64 %vectors, i64 %samples, i64 %lines,",
                "    ptr noalias %omegas, ptr noalias %factors,",
                "    ptr noalias %static, ptr noalias %terms, ptr noalias %spectral, ptr noalias %weights,",
                "    ptr noalias %spectral_weights, ptr noalias %out, ptr noalias %jacobian, ptr noalias %flags,",
                "    ptr noalias %scratch) {",
                "entry:",
                "  br label %frequencies",
                "frequencies:",
                "  %vector = phi i64 [0, %entry], [%next_vector, %end]",
                f"  %omega_at = getelementptr {VECTOR}, ptr %omegas, i64 %vector",
                f"  %omega = load {VECTOR}, ptr %omega_at, align 8",
                f"  %minus_omega = fneg {VECTOR} %omega",
                f"  %minus_omega2 = fmul {VECTOR} %omega, %minus_omega",
                f"  %omega2 = fmul {VECTOR} %omega, %omega",
                f"  %factor_row = mul i64 %vector, {2 * len(layout.pairs)}",
                f"  %factors_here = getelementptr {VECTOR}, ptr %factors, i64 %factor_row",
                f"  %static_row = mul i64 %vector, {len(layout.static)}",
                f"  %static_here = getelementptr {VECTOR}, ptr %static, i64 %static_row",
                f"  %line = mul i64 %vector, {WIDTH}",
                f"  %many = icmp sge i64 %samples, {_MANY_SAMPLES}",
                "  br label %begin",
                *self._sample_begins(),
                *self.ir.lines,
                "  br label %after",
                "after:",
                "  %next_sample = add i64 %sample, 1",
                "  %more_samples = icmp slt i64 %next_sample, %samples",
                "  br i1 %more_samples, label %begin, label %end",
                "end:",
                "  %next_vector = add i64 %vector, 1",
                "  %more_vectors = icmp slt i64 %next_vector, %vectors",
                "  br i1 %more_vectors, label %frequencies, label %done",
                "done:",
                "  fence seq_cst",
                "  ret void",
                "}",
            ]
        )

    def _sample_begins(self) -> list[str]:
        """Return the instructions that compute where a sample begins in each array."""
        layout = self.layout
        return [
            "begin:",
            "  %sample = phi i64 [0, %frequencies], [%next_sample, %after]",
            f"  %term_row = mul i64 %sample, {len(layout.terms)}",
            "  %terms_here = getelementptr double, ptr %terms, i64 %term_row",
            f"  %weight_row = mul i64 %sample, {len(layout.derivatives)}",
            "  %weights_here = getelementptr double, ptr %weights, i64 %weight_row",
            f"  %spectral_row = mul i64 %sample, {2 * len(layout.spectral_terms)}",
            f"  %spectral_weight_row = mul i64 %sample, {2 * len(layout.spectral_derivatives)}",
            f"  %frf_row = mul i64 %sample, {len(layout.pairs)}",
        ]


def _starts(parameters: Sequence[int], count: int) -> list[int]:
    """Return the index at which each parameter begins in a sorted list, followed by the list's length."""
    return [bisect_left(parameters, parameter) for parameter in range(count + 1)]
