"""Instructions on vectors of frequencies (LLVM IR), real and imaginary parts in separate vectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence

WIDTH = 8
"""Number of frequencies in a vector."""
VECTOR = f"<{WIDTH} x double>"
MASK = f"<{WIDTH} x i1>"

ComplexVector = tuple[str | None, str | None]
"""Names of real and imaginary part; None means zero."""


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
