"""Instructions on vectors of frequencies as LLVM IR, and their compilation to machine code at run time."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

WIDTH = 8
"""Number of frequencies in a vector."""
VECTOR = f"<{WIDTH} x double>"
MASK = f"<{WIDTH} x i1>"

ComplexVector = tuple[str | None, str | None]
"""Names of real and imaginary part; None means zero."""
_INTEGERS, _ARRAYS = 3, 11
_CACHE_LINE = 64
"""Bytes."""


class VectorWriter:
    """Writer of instructions on vectors; an operand None means zero."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._count = 0

    def emit(self, line: str) -> None:
        """Append an instruction without a result."""
        self.lines.append(f"  {line}")

    def value(self, expression: str) -> str:
        """Append an expression and return the name of its result."""
        self._count += 1
        name = f"%v{self._count}"
        self.emit(f"{name} = {expression}")
        return name

    def load(self, pointer: str, index: str | int, kind: str = VECTOR) -> str:
        """Load the element at an index of an array."""
        address = self.value(f"getelementptr {kind}, ptr {pointer}, i64 {index}")
        return self.value(f"load {kind}, ptr {address}, align {4 if kind == 'float' else 8}")

    def broadcast(self, scalar: str) -> str:
        """Return a vector with all elements equal to a scalar."""
        first = self.value(f"insertelement {VECTOR} poison, double {scalar}, i32 0")
        return self.value(f"shufflevector {VECTOR} {first}, {VECTOR} poison, <{WIDTH} x i32> zeroinitializer")

    def negative(self, x: str | None) -> str | None:
        """Return -x."""
        return None if x is None else self.value(f"fneg {VECTOR} {x}")

    def magnitude(self, x: str | None) -> str | None:
        """Return |x|."""
        return None if x is None else self.value(f"call {VECTOR} @llvm.fabs.v{WIDTH}f64({VECTOR} {x})")

    def product(self, x: str | None, y: str | None) -> str | None:
        """Return x * y."""
        return None if x is None or y is None else self.value(f"fmul {VECTOR} {x}, {y}")

    def multiply_add(self, x: str | None, y: str | None, z: str | None) -> str | None:
        """Return x * y + z."""
        if x is None or y is None:
            return z
        if z is None:
            return self.product(x, y)
        return self.value(f"call {VECTOR} @llvm.fma.v{WIDTH}f64({VECTOR} {x}, {VECTOR} {y}, {VECTOR} {z})")

    def add(self, x: str | None, y: str | None) -> str | None:
        """Return x + y."""
        if x is None or y is None:
            return x if y is None else y
        return self.value(f"fadd {VECTOR} {x}, {y}")

    def complex_product(self, x: ComplexVector, y: ComplexVector) -> ComplexVector:
        """Return x * y."""
        return self.complex_multiply_add(x, y, (None, None))

    def complex_multiply_add(self, x: ComplexVector, y: ComplexVector, z: ComplexVector) -> ComplexVector:
        """Return x * y + z."""
        minus = self.negative(x[1]) if y[1] is not None else None
        real = self.multiply_add(minus, y[1], self.multiply_add(x[0], y[0], z[0]))
        imaginary = self.multiply_add(x[1], y[0], self.multiply_add(x[0], y[1], z[1]))
        return real, imaginary

    def loop(
        self,
        first: str | int,
        last: str | int,
        body: Callable[[str, list[str]], Sequence[str]],
        carried: Sequence[tuple[str, str]] = (),
    ) -> list[str]:
        """Repeat instructions for each index from `first` to before `last`.

        Parameters
        ----------
        first, last : str or int
        body : callable
            Takes the names of the index and of the carried values, and returns the values for the next iteration.
        carried : sequence of (str, str)
            Type and initial value of each value that an iteration passes to the next.

        Returns
        -------
        list of str
            The carried values after the last iteration.
        """
        self._count += 1
        number = self._count
        names = [f"%carried{number}_{position}" for position in range(len(carried))]
        self.emit(f"br label %enter{number}")
        self.lines.append(f"enter{number}:")
        self.emit(f"br label %test{number}")
        self.lines.append(f"test{number}:")
        start = len(self.lines)
        self.emit(f"%go{number} = icmp slt i64 %index{number}, {last}")
        self.emit(f"br i1 %go{number}, label %round{number}, label %leave{number}")
        self.lines.append(f"round{number}:")
        after = body(f"%index{number}", names)
        self.emit(f"br label %close{number}")
        self.lines.append(f"close{number}:")
        self.emit(f"%next{number} = add i64 %index{number}, 1")
        self.emit(f"br label %test{number}")
        self.lines.append(f"leave{number}:")
        self.lines[start:start] = [
            f"  %index{number} = phi i64 [{first}, %enter{number}], [%next{number}, %close{number}]",
            *(
                f"  {name} = phi {kind} [{start}, %enter{number}], [{value}, %close{number}]"
                for name, (kind, start), value in zip(names, carried, after, strict=True)
            ),
        ]
        return names


def constant(value: float) -> str:
    """Return a vector with all elements equal to a number."""
    text = "0x7FF8000000000000" if value != value else f"{value:.17e}"
    return "<" + ", ".join([f"double {text}"] * WIDTH) + ">"


def declarations() -> list[str]:
    """Return the declarations of the vector functions that the instructions call."""
    return [
        f"declare {VECTOR} @llvm.fma.v{WIDTH}f64({VECTOR}, {VECTOR}, {VECTOR})",
        f"declare {VECTOR} @llvm.fabs.v{WIDTH}f64({VECTOR})",
        f"declare {VECTOR} @llvm.sqrt.v{WIDTH}f64({VECTOR})",
    ]


class MachineKernel:
    """A compiled kernel; calling it releases the interpreter lock.

    Parameters
    ----------
    source : str
        LLVM IR of a function ``kernel`` of three integers and eleven arrays; the last array is its scratch memory.
    scratch : int
        Number of doubles in the scratch memory.

    Notes
    -----
    Compilation takes about a tenth of a second, because the code already consists of vector instructions: there is
    nothing to infer or to vectorise, and no cache on disk is needed.
    """

    def __init__(self, source: str, scratch: int) -> None:
        import llvmlite.binding as llvm

        module = llvm.parse_assembly(source)
        module.verify()
        self.scratch = scratch
        self._engine = llvm.create_mcjit_compiler(module, _target_machine())
        self._engine.finalize_object()
        signature = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * _INTEGERS, *[ctypes.c_void_p] * _ARRAYS)
        self._function: Callable[..., None] = signature(self._engine.get_function_address("kernel"))

    def __call__(self, vectors: int, samples: int, lines: int, arrays: Sequence[NDArray[Any]]) -> None:
        """Run the kernel on C-contiguous arrays, in the order of its arguments, without the scratch memory."""
        if not all(array.flags.c_contiguous for array in arrays):
            raise ValueError("the kernel takes contiguous arrays only.")
        scratch = aligned_empty((self.scratch,), np.float64)
        self._function(vectors, samples, lines, *[array.ctypes.data for array in (*arrays, scratch)])


@lru_cache(maxsize=64)
def compiled(source: str, scratch: int = 0) -> MachineKernel:
    """Return the kernel of an LLVM IR text; the same text, as for other frequencies, is compiled only once."""
    return MachineKernel(source, scratch)


def _target_machine() -> Any:
    """Return a description of this processor; each compiled module takes ownership of one."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    features = llvm.get_host_cpu_features().flatten()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=llvm.get_host_cpu_name(), features=features, opt=3, jit=True)


def as_vectors(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Arrange rows (n_rows, n_lines), a whole number of vectors long, as (n_vectors, n_rows, WIDTH)."""
    vectors = rows.shape[-1] // WIDTH  # as a number, since there may be no rows
    return np.ascontiguousarray(np.moveaxis(rows.reshape(*rows.shape[:-1], vectors, WIDTH), -2, 0))


def aligned_empty(shape: tuple[int, ...], dtype: type[np.generic]) -> NDArray[Any]:
    """Return an array that starts on a boundary of 64 bytes, since the kernel stores whole cache lines."""
    size = math.prod(shape) * np.dtype(dtype).itemsize
    raw = np.empty(size + _CACHE_LINE, dtype=np.uint8)
    first = -raw.ctypes.data % _CACHE_LINE
    return raw[first : first + size].view(dtype).reshape(shape)
