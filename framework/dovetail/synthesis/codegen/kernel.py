"""What the kernels share: the loops over frequencies and samples, the guard of the pivots, and how results are stored.

Frequencies run in the outer loop, a vector at a time, and samples in the inner one, so that what the substructures
contribute to a vector of frequencies stays in the first-level cache for all samples.
"""

from __future__ import annotations

from collections.abc import Mapping

from dovetail.synthesis.codegen.layout import Layout
from dovetail.synthesis.codegen.vector_ir import (
    MASK,
    VECTOR,
    WIDTH,
    ComplexVector,
    VectorWriter,
    constant,
    declarations,
)

__all__ = ["FACTOR", "KernelWriter"]

FACTOR: ComplexVector = ("%factor", "%factor_imaginary")
"""What turns a receptance into the quantity that is stored."""
_PAIRS = f"<{2 * WIDTH} x double>"
"""As many complex numbers."""
_MANY_SAMPLES = 8
"""Samples whose derivatives are too much to stay in a cache until they are read."""
_TINY_PIVOT = 1e-16
"""A pivot whose square falls below this part of its summands' has lost half of its digits."""


class KernelWriter:
    """Writes the function ``kernel`` for one layout of its arrays.

    Parameters
    ----------
    layout : Layout

    Attributes
    ----------
    write : VectorWriter
        Takes the instructions for one sample and one vector of frequencies.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.write = VectorWriter()

    def inverse(self, value: ComplexVector, size: str | None) -> tuple[ComplexVector, str, str]:
        """Invert a pivot; also return 1 / |pivot|^2, and where it is tiny beside the `size` of its summands."""
        write = self.write
        real, imaginary = value
        square = write.multiply_add(real, real, write.product(imaginary, imaginary)) or "zeroinitializer"
        limit = write.product(write.product(size, size), constant(_TINY_PIVOT)) or "zeroinitializer"
        small = write.value(f"fcmp ule {VECTOR} {square}, {limit}")
        scale = write.value(f"fdiv {VECTOR} {constant(1.0)}, {square}")
        return (write.product(real, scale), write.negative(write.product(imaginary, scale))), scale, small

    def load_pair(self, pointer: str, row: str, place: str | int) -> ComplexVector:
        """Load a pair of rows of an array (samples, pairs, 2, lines) at this vector of lines."""
        write = self.write
        parts = []
        first = write.value(f"add i64 {row}, {write.value(f'mul i64 {place}, 2')}")
        for part in (0, 1):
            line = write.value(f"add i64 {first}, {part}")
            offset = write.value(f"mul i64 {line}, %lines")
            start = write.value(f"add i64 {offset}, %line")
            address = write.value(f"getelementptr double, ptr {pointer}, i64 {start}")
            parts.append(write.value(f"load {VECTOR}, ptr {address}, align 8"))
        return parts[0], parts[1]

    def spoilt(self, value: str | None, bad: str) -> str:
        """Put NaN where a pivot nearly vanished."""
        nan = constant(float("nan"))
        return self.write.value(f"select {MASK} {bad}, {VECTOR} {nan}, {VECTOR} {value or 'zeroinitializer'}")

    def raise_flag(self, bad: str) -> None:
        """Note that a pivot nearly vanished at some line of this sample."""
        write = self.write
        bits = write.value(f"bitcast {MASK} {bad} to i{WIDTH}")
        address = write.value(f"getelementptr i{WIDTH}, ptr %flags, i64 %sample")
        before = write.value(f"load i{WIDTH}, ptr {address}")
        write.emit(f"store i{WIDTH} {write.value(f'or i{WIDTH} {before}, {bits}')}, ptr {address}")

    def store(self, pointer: str, place: str, value: ComplexVector) -> None:
        """Store a complex vector, real and imaginary parts in turn."""
        both, address = self.in_turn(pointer, place, value)
        self.write.emit(f"store {_PAIRS} {both}, ptr {address}, align 64")

    def stream(self, pointer: str, place: str, value: ComplexVector) -> None:
        """Store a complex vector past the caches where there are many samples, since it is not read again soon."""
        write = self.write
        both, address = self.in_turn(pointer, place, value)
        label = both.strip("%")
        write.emit(f"br i1 %many, label %past_{label}, label %kept_{label}")
        write.lines.append(f"past_{label}:")
        write.emit(f"store {_PAIRS} {both}, ptr {address}, align 64, !nontemporal !0")
        write.emit(f"br label %stored_{label}")
        write.lines.append(f"kept_{label}:")
        write.emit(f"store {_PAIRS} {both}, ptr {address}, align 64")
        write.emit(f"br label %stored_{label}")
        write.lines.append(f"stored_{label}:")

    def in_turn(self, pointer: str, place: str, value: ComplexVector) -> tuple[str, str]:
        """Return a vector of real and imaginary parts in turn, and the address of a complex element."""
        write = self.write
        mask = ", ".join(f"i32 {index + part * WIDTH}" for index in range(WIDTH) for part in (0, 1))
        parts = ", ".join(f"{VECTOR} {part or 'zeroinitializer'}" for part in value)
        both = write.value(f"shufflevector {parts}, <{2 * WIDTH} x i32> <{mask}>")
        return both, write.value(f"getelementptr {{double, double}}, ptr {pointer}, i64 {place}")

    def combined(self, sums: Mapping[str, ComplexVector]) -> ComplexVector:
        """Add up K + iD + i omega C - omega^2 M of the parts that there are."""
        write = self.write
        none: ComplexVector = (None, None)
        (k_re, k_im), (d_re, d_im), (c_re, c_im), (m_re, m_im) = (sums.get(part, none) for part in "KDCM")
        turned_re, turned_im = write.multiply_add(c_re, "%omega", d_re), write.multiply_add(c_im, "%omega", d_im)
        real = write.add(write.multiply_add(m_re, "%minus_omega2", k_re), write.negative(turned_im))
        imaginary = write.add(write.multiply_add(m_im, "%minus_omega2", k_im), turned_re)
        return real, imaginary

    def store_derivative(self, parameter: str | int, value: ComplexVector) -> None:
        """Store the derivative of the receptance by a parameter, as one of the wanted quantity."""
        write = self.write
        row = write.value(f"add i64 %derivative_row, {parameter}")
        place = write.value(f"add i64 {write.value(f'mul i64 {row}, %lines')}, %line")
        self.stream("%derived", place, write.complex_product(value, FACTOR))

    def store_amplitude(self, scale: str, bad: str) -> None:
        """Store factor * |H| in single precision."""
        write = self.write
        root = write.value(f"call {VECTOR} @llvm.sqrt.v{WIDTH}f64({VECTOR} {scale})")
        value = self.spoilt(write.product(root, FACTOR[0]), bad)
        single = write.value(f"fptrunc {VECTOR} {value} to <{WIDTH} x float>")
        address = write.value("getelementptr float, ptr %out, i64 %place")
        write.emit(f"store <{WIDTH} x float> {single}, ptr {address}, align 4")

    def frame(self) -> str:
        """Return the function: what was written, in loops over vectors of frequencies and over samples.

        The fence at its end lets other threads see what was stored past the caches.
        """
        layout = self.layout
        return "\n".join(
            [
                "!0 = !{i32 1}",
                *declarations(),
                "define void @kernel(i64 %vectors, i64 %samples, i64 %lines,",
                "    ptr noalias %omegas, ptr noalias %factors,",
                "    ptr noalias %static, ptr noalias %terms, ptr noalias %general, ptr noalias %weights,",
                "    ptr noalias %general_weights, ptr noalias %out, ptr noalias %derived, ptr noalias %flags,",
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
                *self._sample_begins(),
                *self.write.lines,
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
                "  fence seq_cst",
                "  ret void",
                "}",
            ]
        )

    def _sample_begins(self) -> list[str]:
        """Return where a sample's part of each array begins."""
        layout = self.layout
        return [
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
        ]
