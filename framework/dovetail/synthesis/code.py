"""The elimination program as straight-line vector code (LLVM IR), one version for each sparsity pattern.

Frequencies run in the outer loop, a vector at a time, and samples in the inner one, so that what the substructures
contribute to a vector of frequencies stays in the first-level cache for all samples. Real and imaginary parts are
apart, and what is known to be zero has no instruction.
"""

from __future__ import annotations

from collections.abc import Sequence

from dovetail.synthesis.elimination import Program
from dovetail.synthesis.layout import Layout
from dovetail.synthesis.vectors import VECTOR, WIDTH, ComplexVector, VectorWriter, constant, declarations

__all__ = ["kernel_source"]

_PAIRS = f"<{2 * WIDTH} x double>"
"""As many complex numbers."""
_MANY_SAMPLES = 8
"""Samples whose derivatives are too much to stay in a cache until they are read."""
_TINY_PIVOT = 1e-16
"""A pivot whose square falls below this part of its summands' has lost half of its digits."""
_FACTOR: ComplexVector = ("%factor", "%factor_imaginary")
"""What turns a receptance into the quantity that is stored."""


class _Kernel:
    """Writes one kernel for a program and a layout."""

    def __init__(self, program: Program, layout: Layout) -> None:
        self._program = program
        self._layout = layout
        self._write = VectorWriter()
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
        if amplitude:
            self._store_amplitude(scale)
        else:
            inverse = self._spoilt(inverse[0]), inverse[1]
            self._store("%out", "%place", self._write.complex_product(inverse, _FACTOR))
        if self._layout.parameters:
            self._differentiate(inverse)
        self._raise_flag()
        return _frame(self._write.lines, self._layout)

    def _load(self, slot: int) -> None:
        """Add up what substructures and joints contribute to a slot, when it is first needed."""
        if slot in self._slots:
            return
        write = self._write
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
        return self._load_complex("%general", "%general_row", self._general[slot])

    def _load_complex(self, pointer: str, row: str, place: int) -> ComplexVector:
        """Load a pair of rows of an array (samples, pairs, 2, lines) at this vector of lines."""
        write = self._write
        parts = []
        for part in (0, 1):
            line = write.value(f"add i64 {row}, {2 * place + part}")
            offset = write.value(f"mul i64 {line}, %lines")
            start = write.value(f"add i64 {offset}, %line")
            address = write.value(f"getelementptr double, ptr {pointer}, i64 {start}")
            parts.append(write.value(f"load {VECTOR}, ptr {address}, align 8"))
        return parts[0], parts[1]

    def _term(self, slot: int, part: str) -> str | None:
        if (slot, part) not in self._terms:
            return None
        return self._write.broadcast(self._write.load("%terms_here", self._terms[slot, part], "double"))

    def _inverse(self, slot: int) -> tuple[ComplexVector, str]:
        """Invert a pivot, noting where it nearly vanishes; also return 1 / |pivot|^2."""
        write = self._write
        real, imaginary = self._slots[slot]
        square = write.multiply_add(real, real, write.product(imaginary, imaginary)) or "zeroinitializer"
        size = self._size[slot]
        limit = write.product(write.product(size, size), constant(_TINY_PIVOT)) or "zeroinitializer"
        small = write.value(f"fcmp {'ueq' if size is None else 'ult'} {VECTOR} {square}, {limit}")
        self._bad = small if self._bad is None else write.value(f"or <{WIDTH} x i1> {self._bad}, {small}")
        scale = write.value(f"fdiv {VECTOR} {constant(1.0)}, {square}")
        return (write.product(real, scale), write.negative(write.product(imaginary, scale))), scale

    def _eliminate(self, pivot: int) -> None:
        write, program = self._write, self._program
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

    def _spoilt(self, value: str | None) -> str:
        """Put NaN where a pivot nearly vanished."""
        given = value or "zeroinitializer"
        if self._bad is None:
            return given
        nan = constant(float("nan"))
        return self._write.value(f"select <{WIDTH} x i1> {self._bad}, {VECTOR} {nan}, {VECTOR} {given}")

    def _raise_flag(self) -> None:
        """Note that a pivot nearly vanished at some line of this sample."""
        write = self._write
        bits = write.value(f"bitcast <{WIDTH} x i1> {self._bad} to i{WIDTH}")
        address = write.value(f"getelementptr i{WIDTH}, ptr %flags, i64 %sample")
        before = write.value(f"load i{WIDTH}, ptr {address}")
        write.emit(f"store i{WIDTH} {write.value(f'or i{WIDTH} {before}, {bits}')}, ptr {address}")

    def _store(self, pointer: str, place: str, value: ComplexVector) -> None:
        """Store a complex vector, real and imaginary parts in turn."""
        both, address = self._in_turn(pointer, place, value)
        self._write.emit(f"store {_PAIRS} {both}, ptr {address}, align 64")

    def _stream(self, pointer: str, place: str, value: ComplexVector) -> None:
        """Store a complex vector past the caches where there are many samples, since it is not read again soon."""
        write = self._write
        both, address = self._in_turn(pointer, place, value)
        label = both.strip("%")
        write.emit(f"br i1 %many, label %past_{label}, label %kept_{label}")
        write.lines.append(f"past_{label}:")
        write.emit(f"store {_PAIRS} {both}, ptr {address}, align 64, !nontemporal !0")
        write.emit(f"br label %stored_{label}")
        write.lines.append(f"kept_{label}:")
        write.emit(f"store {_PAIRS} {both}, ptr {address}, align 64")
        write.emit(f"br label %stored_{label}")
        write.lines.append(f"stored_{label}:")

    def _in_turn(self, pointer: str, place: str, value: ComplexVector) -> tuple[str, str]:
        """Return a vector of real and imaginary parts in turn, and the address of a complex element."""
        write = self._write
        mask = ", ".join(f"i32 {index + part * WIDTH}" for index in range(WIDTH) for part in (0, 1))
        parts = ", ".join(f"{VECTOR} {part or 'zeroinitializer'}" for part in value)
        both = write.value(f"shufflevector {parts}, <{2 * WIDTH} x i32> <{mask}>")
        return both, write.value(f"getelementptr {{double, double}}, ptr {pointer}, i64 {place}")

    def _store_amplitude(self, scale: str) -> None:
        """Store factor * |H| in single precision."""
        write = self._write
        root = write.value(f"call {VECTOR} @llvm.sqrt.v{WIDTH}f64({VECTOR} {scale})")
        value = self._spoilt(write.product(root, _FACTOR[0]))
        single = write.value(f"fptrunc {VECTOR} {value} to <{WIDTH} x float>")
        address = write.value("getelementptr float, ptr %out, i64 %place")
        write.emit(f"store <{WIDTH} x float> {single}, ptr {address}, align 4")

    def _differentiate(self, response: ComplexVector) -> None:
        """Substitute back for the motion x under a unit force, and store -x^T (dZ/dp) x for each parameter."""
        write, program = self._write, self._program
        motion: dict[int, ComplexVector] = {int(program.order[-1]): response}
        for pivot in reversed(range(program.pivots)):
            rows = program.rows[program.column[program.start[pivot] : program.start[pivot + 1]]]
            x: ComplexVector = (None, None)
            for factor, row in zip(self._factors[pivot], rows, strict=True):
                x = write.complex_multiply_add(factor, motion[int(row)], x)
            motion[int(program.order[pivot])] = x
        slots = {slot for _, slot, _ in self._layout.derivatives}
        slots.update(slot for _, slot in self._layout.general_derivatives)
        products = {
            slot: write.complex_product(motion[int(program.rows[slot])], motion[int(program.columns[slot])])
            for slot in sorted(slots)
        }
        by_parameter: list[dict[str, list[tuple[int, int]]]] = [{} for _ in range(self._layout.parameters)]
        for column, (parameter, slot, part) in enumerate(self._layout.derivatives):
            by_parameter[parameter].setdefault(part, []).append((column, slot))
        for parameter, parts in enumerate(by_parameter):
            row = write.value(f"add i64 %derivative_row, {parameter}")
            offset = write.value(f"mul i64 {row}, %lines")
            place = write.value(f"add i64 {offset}, %line")
            total = self._general_derivative(parameter, self._derivative(parts, products), products)
            self._stream("%derived", place, write.complex_product(total, _FACTOR))

    def _general_derivative(
        self, parameter: int, total: ComplexVector, products: dict[int, ComplexVector]
    ) -> ComplexVector:
        """Add the derivatives of joints that depend on frequency, each times the product of motions at its entry."""
        for place, (owner, slot) in enumerate(self._layout.general_derivatives):
            if owner == parameter:
                weight = self._load_complex("%general_weights", "%general_weight_row", place)
                total = self._write.complex_multiply_add(weight, products[slot], total)
        return total

    def _derivative(self, parts: dict[str, list[tuple[int, int]]], products: dict[int, ComplexVector]) -> ComplexVector:
        """Add up K + iD + i omega C - omega^2 M, each times the product of motions at its entry."""
        write = self._write
        sums = {part: self._weighted(columns, products) for part, columns in parts.items()}
        none: ComplexVector = (None, None)
        (k_re, k_im), (d_re, d_im), (c_re, c_im), (m_re, m_im) = (sums.get(part, none) for part in "KDCM")
        turned_re, turned_im = write.multiply_add(c_re, "%omega", d_re), write.multiply_add(c_im, "%omega", d_im)
        real = write.add(write.multiply_add(m_re, "%minus_omega2", k_re), write.negative(turned_im))
        imaginary = write.add(write.multiply_add(m_im, "%minus_omega2", k_im), turned_re)
        return real, imaginary

    def _weighted(self, columns: Sequence[tuple[int, int]], products: dict[int, ComplexVector]) -> ComplexVector:
        write = self._write
        real: str | None = None
        imaginary: str | None = None
        for column, slot in columns:
            weight = write.broadcast(write.load("%weights_here", column, "double"))
            real = write.multiply_add(weight, products[slot][0], real)
            imaginary = write.multiply_add(weight, products[slot][1], imaginary)
        return real, imaginary


def _frame(body: Sequence[str], layout: Layout) -> str:
    """Put the loops over vectors of frequencies and over samples around the body."""
    return "\n".join(
        [
            "!0 = !{i32 1}",
            *declarations(),
            "define void @kernel(i64 %vectors, i64 %samples, i64 %lines, ptr noalias %omegas, ptr noalias %factors,",
            "    ptr noalias %static, ptr noalias %terms, ptr noalias %general, ptr noalias %weights,",
            "    ptr noalias %general_weights, ptr noalias %out, ptr noalias %derived, ptr noalias %flags) {",
            "entry:",
            "  br label %frequencies",
            "frequencies:",
            "  %vector = phi i64 [0, %entry], [%next_vector, %end]",
            f"  %omega_at = getelementptr {VECTOR}, ptr %omegas, i64 %vector",
            f"  %omega = load {VECTOR}, ptr %omega_at, align 8",
            f"  %minus_omega = fneg {VECTOR} %omega",
            f"  %minus_omega2 = fmul {VECTOR} %omega, %minus_omega",
            f"  %omega2 = fmul {VECTOR} %omega, %omega",
            "  %factor_row = mul i64 %vector, 2",
            f"  %factor_at = getelementptr {VECTOR}, ptr %factors, i64 %factor_row",
            f"  %factor = load {VECTOR}, ptr %factor_at, align 8",
            f"  %factor_imaginary_at = getelementptr {VECTOR}, ptr %factor_at, i64 1",
            f"  %factor_imaginary = load {VECTOR}, ptr %factor_imaginary_at, align 8",
            f"  %static_row = mul i64 %vector, {len(layout.static)}",
            f"  %static_here = getelementptr {VECTOR}, ptr %static, i64 %static_row",
            f"  %line = mul i64 %vector, {WIDTH}",
            f"  %many = icmp sge i64 %samples, {_MANY_SAMPLES}",
            "  br label %one",
            "one:",
            "  %sample = phi i64 [0, %frequencies], [%next_sample, %after]",
            f"  %term_row = mul i64 %sample, {len(layout.terms)}",
            "  %terms_here = getelementptr double, ptr %terms, i64 %term_row",
            f"  %weight_row = mul i64 %sample, {len(layout.derivatives)}",
            "  %weights_here = getelementptr double, ptr %weights, i64 %weight_row",
            f"  %general_row = mul i64 %sample, {2 * len(layout.general)}",
            f"  %general_weight_row = mul i64 %sample, {2 * len(layout.general_derivatives)}",
            f"  %derivative_row = mul i64 %sample, {layout.parameters}",
            "  %row = mul i64 %sample, %lines",
            "  %place = add i64 %row, %line",
            *body,
            "  br label %after",
            "after:",
            "  %next_sample = add i64 %sample, 1",
            "  %more_samples = icmp slt i64 %next_sample, %samples",
            "  br i1 %more_samples, label %one, label %end",
            "end:",
            "  %next_vector = add i64 %vector, 1",
            "  %more_vectors = icmp slt i64 %next_vector, %vectors",
            "  br i1 %more_vectors, label %frequencies, label %done",
            "done:",
            "  ret void",
            "}",
        ]
    )


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
    return _Kernel(program, layout).source(amplitude)
