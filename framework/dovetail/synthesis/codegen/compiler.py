"""Compilation of LLVM IR to machine code at run time."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.synthesis.codegen.vector_ir import WIDTH

_INTEGERS, _ARRAYS = 3, 11
_CACHE_LINE = 64
"""Bytes."""


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
