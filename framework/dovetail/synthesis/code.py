"""The elimination program as straight-line vector code (LLVM IR), one version for each sparsity pattern.

Frequencies run in the outer loop, a vector at a time, and samples in the inner one, so that what the substructures
contribute to a vector of frequencies stays in the first-level cache for all samples. Real and imaginary parts are
apart, and what is known to be zero has no instruction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dovetail.synthesis.elimination import Program

__all__ = ["WIDTH", "Derivative", "Layout", "Term", "kernel_source"]

WIDTH = 8
"""Frequencies in a vector."""

_VECTOR = f"<{WIDTH} x double>"
_TINY_PIVOT = 1e-16
"""A pivot whose square falls below this part of its summands' has lost half of its digits."""

Term = tuple[int, str]
"""A slot and which of K, D, C, M a joint adds there."""
Derivative = tuple[int, int, str]
"""A parameter, a slot, and the part of it that depends on the parameter."""
_Complex = tuple[str | None, str | None]
"""Names of real and imaginary part; None is zero."""
_FACTOR: _Complex = ("%factor", "%factor_imaginary")
"""What turns a receptance into the quantity that is stored."""


@dataclass(frozen=True)
class Layout:
    """What the kernel's arrays hold, column by column.

    Parameters
    ----------
    static : tuple of (int, int)
        Slot and part (0 real, 1 imaginary) of each row of the substructures' contributions.
    terms : tuple of Term
        Of each column of the joints' contributions.
    general : tuple of int
        Slots to which joints that depend on frequency contribute.
    derivatives : tuple of Derivative
        Of each column of the derivatives; empty for the FRF alone.
    parameters : int
        Number of parameters by which to differentiate.
    """

    static: tuple[tuple[int, int], ...]
    terms: tuple[Term, ...]
    general: tuple[int, ...] = ()
    derivatives: tuple[Derivative, ...] = ()
    parameters: int = 0


class _Writer:
    """Instructions on vectors; an operand that is None is zero."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._count = 0

    def emit(self, line: str) -> None:
        self.lines.append(f"  {line}")

    def value(self, expression: str) -> str:
        self._count += 1
        name = f"%v{self._count}"
        self.emit(f"{name} = {expression}")
        return name

    def load(self, pointer: str, index: str | int, kind: str = _VECTOR) -> str:
        address = self.value(f"getelementptr {kind}, ptr {pointer}, i64 {index}")
        return self.value(f"load {kind}, ptr {address}, align {4 if kind == 'float' else 8}")

    def broadcast(self, scalar: str) -> str:
        first = self.value(f"insertelement {_VECTOR} poison, double {scalar}, i32 0")
        return self.value(f"shufflevector {_VECTOR} {first}, {_VECTOR} poison, <{WIDTH} x i32> zeroinitializer")

    def negative(self, x: str | None) -> str | None:
        return None if x is None else self.value(f"fneg {_VECTOR} {x}")

    def magnitude(self, x: str | None) -> str | None:
        return None if x is None else self.value(f"call {_VECTOR} @llvm.fabs.v{WIDTH}f64({_VECTOR} {x})")

    def product(self, x: str | None, y: str | None) -> str | None:
        return None if x is None or y is None else self.value(f"fmul {_VECTOR} {x}, {y}")

    def multiply_add(self, x: str | None, y: str | None, z: str | None) -> str | None:
        """X * y + z."""
        if x is None or y is None:
            return z
        if z is None:
            return self.product(x, y)
        return self.value(f"call {_VECTOR} @llvm.fma.v{WIDTH}f64({_VECTOR} {x}, {_VECTOR} {y}, {_VECTOR} {z})")

    def add(self, x: str | None, y: str | None) -> str | None:
        if x is None or y is None:
            return x if y is None else y
        return self.value(f"fadd {_VECTOR} {x}, {y}")

    def complex_product(self, x: _Complex, y: _Complex) -> _Complex:
        return self.complex_multiply_add(x, y, (None, None))

    def complex_multiply_add(self, x: _Complex, y: _Complex, z: _Complex) -> _Complex:
        """X * y + z."""
        minus = self.negative(x[1]) if y[1] is not None else None
        real = self.multiply_add(minus, y[1], self.multiply_add(x[0], y[0], z[0]))
        imaginary = self.multiply_add(x[1], y[0], self.multiply_add(x[0], y[1], z[1]))
        return real, imaginary


class _Kernel:
    """Writes one kernel for a program and a layout."""

    def __init__(self, program: Program, layout: Layout) -> None:
        self._program = program
        self._layout = layout
        self._write = _Writer()
        self._slots: dict[int, _Complex] = {}
        self._size: dict[int, str | None] = {}
        self._factors: dict[int, list[_Complex]] = {}
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
        if self._layout.derivatives:
            self._differentiate(inverse)
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
        if self._program.rows[slot] == self._program.columns[slot]:
            size = write.add(write.magnitude(real), write.magnitude(stiffness))
            self._size[slot] = write.multiply_add(write.magnitude(mass), "%omega2", size)
        real = write.multiply_add(mass, "%minus_omega2", write.add(real, stiffness))
        imaginary = write.add(imaginary, self._term(slot, "D"))
        imaginary = write.multiply_add(self._term(slot, "C"), "%omega", imaginary)
        if slot in self._general:
            added = []
            for part in (0, 1):
                row = write.value(f"add i64 %general_row, {2 * self._general[slot] + part}")
                offset = write.value(f"mul i64 {row}, %lines")
                start = write.value(f"add i64 {offset}, %line")
                address = write.value(f"getelementptr double, ptr %general, i64 {start}")
                added.append(write.value(f"load {_VECTOR}, ptr {address}, align 8"))
            real, imaginary = write.add(real, added[0]), write.add(imaginary, added[1])
        self._slots[slot] = real, imaginary

    def _term(self, slot: int, part: str) -> str | None:
        if (slot, part) not in self._terms:
            return None
        return self._write.broadcast(self._write.load("%terms_here", self._terms[slot, part], "double"))

    def _inverse(self, slot: int) -> tuple[_Complex, str]:
        """Invert a pivot, noting where it nearly vanishes; also return 1 / |pivot|^2."""
        write = self._write
        real, imaginary = self._slots[slot]
        square = write.multiply_add(real, real, write.product(imaginary, imaginary)) or "zeroinitializer"
        size = self._size[slot]
        if size is not None:
            limit = write.product(write.product(size, size), _constant(_TINY_PIVOT))
            small = write.value(f"fcmp ult {_VECTOR} {square}, {limit}")
            self._bad = small if self._bad is None else write.value(f"or <{WIDTH} x i1> {self._bad}, {small}")
        scale = write.value(f"fdiv {_VECTOR} {_constant(1.0)}, {square}")
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
        nan = _constant(float("nan"))
        return self._write.value(f"select <{WIDTH} x i1> {self._bad}, {_VECTOR} {nan}, {_VECTOR} {given}")

    def _store(self, pointer: str, place: str, value: _Complex) -> None:
        """Store a complex vector, real and imaginary parts in turn."""
        write = self._write
        mask = ", ".join(f"i32 {index + part * WIDTH}" for index in range(WIDTH) for part in (0, 1))
        parts = ", ".join(f"{_VECTOR} {part or 'zeroinitializer'}" for part in value)
        both = write.value(f"shufflevector {parts}, <{2 * WIDTH} x i32> <{mask}>")
        address = write.value(f"getelementptr {{double, double}}, ptr {pointer}, i64 {place}")
        write.emit(f"store <{2 * WIDTH} x double> {both}, ptr {address}, align 8")

    def _store_amplitude(self, scale: str) -> None:
        """Store factor * |H| in single precision."""
        write = self._write
        root = write.value(f"call {_VECTOR} @llvm.sqrt.v{WIDTH}f64({_VECTOR} {scale})")
        value = self._spoilt(write.product(root, _FACTOR[0]))
        single = write.value(f"fptrunc {_VECTOR} {value} to <{WIDTH} x float>")
        address = write.value("getelementptr float, ptr %out, i64 %place")
        write.emit(f"store <{WIDTH} x float> {single}, ptr {address}, align 4")

    def _differentiate(self, response: _Complex) -> None:
        """Substitute back for the motion x under a unit force, and store -x^T (dZ/dp) x for each parameter."""
        write, program = self._write, self._program
        motion: dict[int, _Complex] = {int(program.order[-1]): response}
        for pivot in reversed(range(program.pivots)):
            rows = program.rows[program.column[program.start[pivot] : program.start[pivot + 1]]]
            x: _Complex = (None, None)
            for factor, row in zip(self._factors[pivot], rows, strict=True):
                x = write.complex_multiply_add(factor, motion[int(row)], x)
            motion[int(program.order[pivot])] = x
        products = {
            slot: write.complex_product(motion[int(program.rows[slot])], motion[int(program.columns[slot])])
            for slot in sorted({slot for _, slot, _ in self._layout.derivatives})
        }
        by_parameter: list[dict[str, list[tuple[int, int]]]] = [{} for _ in range(self._layout.parameters)]
        for column, (parameter, slot, part) in enumerate(self._layout.derivatives):
            by_parameter[parameter].setdefault(part, []).append((column, slot))
        for parameter, parts in enumerate(by_parameter):
            row = write.value(f"add i64 %derivative_row, {parameter}")
            offset = write.value(f"mul i64 {row}, %lines")
            place = write.value(f"add i64 {offset}, %line")
            self._store("%derived", place, write.complex_product(self._derivative(parts, products), _FACTOR))

    def _derivative(self, parts: dict[str, list[tuple[int, int]]], products: dict[int, _Complex]) -> _Complex:
        """Add up K + iD + i omega C - omega^2 M, each times the product of motions at its entry."""
        write = self._write
        sums = {part: self._weighted(columns, products) for part, columns in parts.items()}
        none: _Complex = (None, None)
        (k_re, k_im), (d_re, d_im), (c_re, c_im), (m_re, m_im) = (sums.get(part, none) for part in "KDCM")
        turned_re, turned_im = write.multiply_add(c_re, "%omega", d_re), write.multiply_add(c_im, "%omega", d_im)
        real = write.add(write.multiply_add(m_re, "%minus_omega2", k_re), write.negative(turned_im))
        imaginary = write.add(write.multiply_add(m_im, "%minus_omega2", k_im), turned_re)
        return real, imaginary

    def _weighted(self, columns: Sequence[tuple[int, int]], products: dict[int, _Complex]) -> _Complex:
        write = self._write
        real: str | None = None
        imaginary: str | None = None
        for column, slot in columns:
            weight = write.broadcast(write.load("%weights_here", column, "double"))
            real = write.multiply_add(weight, products[slot][0], real)
            imaginary = write.multiply_add(weight, products[slot][1], imaginary)
        return real, imaginary


def _constant(value: float) -> str:
    text = "0x7FF8000000000000" if value != value else f"{value:.17e}"
    return "<" + ", ".join([f"double {text}"] * WIDTH) + ">"


def _frame(body: Sequence[str], layout: Layout) -> str:
    """Put the loops over vectors of frequencies and over samples around the body."""
    return "\n".join(
        [
            f"declare {_VECTOR} @llvm.fma.v{WIDTH}f64({_VECTOR}, {_VECTOR}, {_VECTOR})",
            f"declare {_VECTOR} @llvm.fabs.v{WIDTH}f64({_VECTOR})",
            f"declare {_VECTOR} @llvm.sqrt.v{WIDTH}f64({_VECTOR})",
            "define void @kernel(i64 %vectors, i64 %samples, i64 %lines, ptr noalias %omegas, ptr noalias %factors,",
            "    ptr noalias %static, ptr noalias %terms, ptr noalias %general, ptr noalias %weights,",
            "    ptr noalias %out, ptr noalias %derived) {",
            "entry:",
            "  br label %frequencies",
            "frequencies:",
            "  %vector = phi i64 [0, %entry], [%next_vector, %end]",
            f"  %omega_at = getelementptr {_VECTOR}, ptr %omegas, i64 %vector",
            f"  %omega = load {_VECTOR}, ptr %omega_at, align 8",
            f"  %minus_omega = fneg {_VECTOR} %omega",
            f"  %minus_omega2 = fmul {_VECTOR} %omega, %minus_omega",
            f"  %omega2 = fmul {_VECTOR} %omega, %omega",
            "  %factor_row = mul i64 %vector, 2",
            f"  %factor_at = getelementptr {_VECTOR}, ptr %factors, i64 %factor_row",
            f"  %factor = load {_VECTOR}, ptr %factor_at, align 8",
            f"  %factor_imaginary_at = getelementptr {_VECTOR}, ptr %factor_at, i64 1",
            f"  %factor_imaginary = load {_VECTOR}, ptr %factor_imaginary_at, align 8",
            f"  %static_row = mul i64 %vector, {len(layout.static)}",
            f"  %static_here = getelementptr {_VECTOR}, ptr %static, i64 %static_row",
            f"  %line_of_vector = mul i64 %vector, {WIDTH}",
            f"  %last_line = sub i64 %lines, {WIDTH}",
            "  %beyond = icmp sgt i64 %line_of_vector, %last_line",
            "  %line = select i1 %beyond, i64 %last_line, i64 %line_of_vector",
            "  br label %one",
            "one:",
            "  %sample = phi i64 [0, %frequencies], [%next_sample, %one]",
            f"  %term_row = mul i64 %sample, {len(layout.terms)}",
            "  %terms_here = getelementptr double, ptr %terms, i64 %term_row",
            f"  %weight_row = mul i64 %sample, {len(layout.derivatives)}",
            "  %weights_here = getelementptr double, ptr %weights, i64 %weight_row",
            f"  %general_row = mul i64 %sample, {2 * len(layout.general)}",
            f"  %derivative_row = mul i64 %sample, {layout.parameters}",
            "  %row = mul i64 %sample, %lines",
            "  %place = add i64 %row, %line",
            *body,
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
