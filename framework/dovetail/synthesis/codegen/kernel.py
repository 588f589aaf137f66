"""What both kernels share: the loops over frequencies and samples, the check of the pivots and the stores.

The outer loop runs over vectors of frequencies and the inner loop over samples, so that the substructures' entries for
a vector of frequencies stay in the first-level cache for all samples.
"""

from __future__ import annotations

from collections.abc import Mapping

from dovetail.synthesis.codegen.layout import MATRICES, Layout
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
"""Factor from the receptance to the quantity that is stored."""
_PAIRS = f"<{2 * WIDTH} x double>"
"""A vector of complex numbers, real and imaginary parts alternating."""
_MANY_SAMPLES = 8
"""Samples whose derivatives do not stay in a cache until they are read."""
_TINY_PIVOT = 1e-16
"""Square of a pivot over the square of its summands, below which half of its digits are lost."""


class KernelWriter:
    """Writes the function ``kernel`` for one layout of its arrays.

    Parameters
    ----------
    layout : Layout

    Attributes
    ----------
    ir : VectorWriter
        Takes the instructions for one sample and one vector of frequencies.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.ir = VectorWriter()

    def invert(self, value: ComplexVector, size: str | None) -> tuple[ComplexVector, str, str]:
        """Invert a pivot; also return 1 / |pivot|^2, and where it is tiny beside the `size` of its summands."""
        ir = self.ir
        real, imaginary = value
        square = ir.multiply_add(real, real, ir.product(imaginary, imaginary)) or "zeroinitializer"
        limit = ir.product(ir.product(size, size), constant(_TINY_PIVOT)) or "zeroinitializer"
        small = ir.value(f"fcmp ule {VECTOR} {square}, {limit}")
        scale = ir.value(f"fdiv {VECTOR} {constant(1.0)}, {square}")
        return (ir.product(real, scale), ir.negative(ir.product(imaginary, scale))), scale, small

    def load_complex(self, pointer: str, row: str, index: str | int) -> ComplexVector:
        """Load a complex row of an array (samples, rows, 2, lines) at this vector of lines."""
        ir = self.ir
        real_row = ir.value(f"add i64 {row}, {ir.value(f'mul i64 {index}, 2')}")
        return self._load_row(pointer, real_row), self._load_row(pointer, ir.value(f"add i64 {real_row}, 1"))

    def _load_row(self, pointer: str, row: str) -> str:
        start = self.ir.value(f"add i64 {self.ir.value(f'mul i64 {row}, %lines')}, %line")
        address = self.ir.value(f"getelementptr double, ptr {pointer}, i64 {start}")
        return self.ir.value(f"load {VECTOR}, ptr {address}, align 8")

    def nan_where(self, bad: str, value: str | None) -> str:
        """Return a value with NaN where a pivot nearly vanished."""
        nan = constant(float("nan"))
        return self.ir.value(f"select {MASK} {bad}, {VECTOR} {nan}, {VECTOR} {value or 'zeroinitializer'}")

    def raise_flag(self, bad: str) -> None:
        """Note that a pivot nearly vanished at some line of this sample."""
        ir = self.ir
        bits = ir.value(f"bitcast {MASK} {bad} to i{WIDTH}")
        address = ir.value(f"getelementptr i{WIDTH}, ptr %flags, i64 %sample")
        before = ir.value(f"load i{WIDTH}, ptr {address}")
        ir.emit(f"store i{WIDTH} {ir.value(f'or i{WIDTH} {before}, {bits}')}, ptr {address}")

    def store(self, pointer: str, index: str, value: ComplexVector) -> None:
        """Store a complex vector from a complex element on."""
        both, address = self.interleave(pointer, index, value)
        self.ir.emit(f"store {_PAIRS} {both}, ptr {address}, align 64")

    def stream(self, pointer: str, index: str, value: ComplexVector) -> None:
        """Store a complex vector past the caches where there are many samples: it is not read again soon."""
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

    def store_derivative(self, parameter: str | int, value: ComplexVector) -> None:
        """Store the derivative of the receptance by a parameter, converted to the quantity that is stored."""
        ir = self.ir
        row = ir.value(f"add i64 %derivative_row, {parameter}")
        index = ir.value(f"add i64 {ir.value(f'mul i64 {row}, %lines')}, %line")
        self.stream("%jacobian", index, ir.complex_product(value, FACTOR))

    def store_amplitude(self, scale: str, bad: str) -> None:
        """Store factor * |H| in single precision."""
        ir = self.ir
        root = ir.value(f"call {VECTOR} @llvm.sqrt.v{WIDTH}f64({VECTOR} {scale})")
        value = self.nan_where(bad, ir.product(root, FACTOR[0]))
        single = ir.value(f"fptrunc {VECTOR} {value} to <{WIDTH} x float>")
        address = ir.value("getelementptr float, ptr %out, i64 %element")
        ir.emit(f"store <{WIDTH} x float> {single}, ptr {address}, align 4")

    def function(self) -> str:
        """Return the LLVM IR of the function: the instructions, in loops over vectors of frequencies and over samples.

        The fence at its end makes visible to other threads what was stored past the caches.
        """
        layout = self.layout
        return "\n".join(
            [
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
                "  %factor_row = mul i64 %vector, 2",
                f"  %factor_at = getelementptr {VECTOR}, ptr %factors, i64 %factor_row",
                f"  %factor = load {VECTOR}, ptr %factor_at, align 8",
                f"  %factor_imaginary_at = getelementptr {VECTOR}, ptr %factor_at, i64 1",
                f"  %factor_imaginary = load {VECTOR}, ptr %factor_imaginary_at, align 8",
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
        """Return the instructions for where a sample begins in each array."""
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
            f"  %derivative_row = mul i64 %sample, {layout.parameters}",
            "  %row = mul i64 %sample, %lines",
            "  %element = add i64 %row, %line",
        ]
