"""What would a GPU gain in synthesis? The elimination written in torch, next to the engine, in one run.

    python tests/benchmarks/gpu_synthesis.py [--samples 64] [--lines 4451] [--device cuda] [--compile]

FRFs of random joints of the collet assembly on 4451 lines. The prototype carries out the engine's elimination with
torch, all samples and lines at once, in double and in single precision; `--compile` has torch.compile fuse the
operations (it needs a C++ compiler on a processor). Its FRFs are compared with the engine's. What a GPU cannot take
over, the evaluation of joint models by their plugins, is not included; copying the FRFs to the processor is counted.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import torch

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import Engine
from dovetail.synthesis.elimination import Program

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"
ROUNDS = 3
FLOP = 8
"""Floating-point operations of a complex multiplication with the subtraction that follows it."""

Number = tuple[torch.Tensor, torch.Tensor]
"""Real and imaginary part: torch.compile does not fuse complex numbers."""


def times(one: Number, other: Number) -> Number:
    """Multiply."""
    return one[0] * other[0] - one[1] * other[1], one[0] * other[1] + one[1] * other[0]


def inverse(number: Number) -> Number:
    """Return 1 / number."""
    size = number[0] ** 2 + number[1] ** 2
    return number[0] / size, -number[1] / size


def eliminate(program: Program, slots: list[Number]) -> Number:
    """Return the receptance of the last DOF; the steps are those of `run_elimination`."""
    for pivot in range(program.pivots):
        column = program.column[program.start[pivot] : program.start[pivot + 1]]
        reciprocal = inverse(slots[program.diagonal[pivot]])
        factors = [times(slots[slot], reciprocal) for slot in column]
        for target, row, other in program.update[program.update_start[pivot] : program.update_start[pivot + 1]]:
            real, imaginary = times(factors[row], slots[column[other]])
            slots[target] = slots[target][0] - real, slots[target][1] - imaginary
    return inverse(slots[program.diagonal[-1]])


class Prototype:
    """Drive-point receptance of an engine's only pair, for joints with constant matrices.

    Parameters
    ----------
    engine : Engine
    device : str
    precision : torch.dtype
    """

    def __init__(self, engine: Engine, device: str, precision: torch.dtype) -> None:
        self.engine, self.program = engine, engine.program
        self._as_tensor = lambda values: torch.tensor(values, dtype=precision, device=device)
        self._keys, static = engine.system.substructure_rows(engine.program)
        rows = np.array(list(static))
        self._rows = self._as_tensor(rows[:, : len(engine.frequency)])
        self._omega = self._as_tensor(2.0 * np.pi * engine.frequency)

    def __call__(self, terms: torch.Tensor) -> Number:
        """Return the receptance (n, n_freq) for the joints' terms (n_terms, n, 1)."""
        zero, omega = torch.zeros_like(terms[0] * self._omega), self._omega
        parts = [[zero, zero] for _ in range(self.program.slots)]
        for (slot, half), row in zip(self._keys, self._rows, strict=True):
            parts[slot][half] = parts[slot][half] + row
        share = {"K": (0, 1.0), "D": (1, 1.0), "C": (1, omega), "M": (0, -(omega**2))}
        for (slot, matrix), term in zip(self.engine.plan.inputs.terms, terms, strict=True):
            half, factor = share[matrix]
            parts[slot][half] = parts[slot][half] + factor * term
        return eliminate(self.program, [(real, imaginary) for real, imaginary in parts])

    def terms(self, theta: dict[str, np.ndarray], count: int) -> torch.Tensor:
        """Return the entries of the joints' matrices for parameters, (n_terms, n, 1)."""
        return self._as_tensor(self.engine.plan.inputs.gather(theta, count).T[:, :, np.newaxis])


def shortest(work: Callable[[], object]) -> float:
    """Return the shortest time of several rounds [s], after one that is not timed."""
    work()
    spent = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        spent.append(time.perf_counter() - start)
    return min(spent)


def as_complex(parts: Number) -> np.ndarray:
    """Return the numbers on the processor."""
    return np.asarray(parts[0].cpu()) + 1j * np.asarray(parts[1].cpu())


def main(samples: int, devices: Iterable[str], *, fused: bool, lines: int | None = None) -> None:
    """Print a row for the engine and for each device and precision."""
    assembly = dovetail.load(ASSEMBLY)
    if lines:
        assembly = assembly.on(np.linspace(*assembly.frequency[[0, -1]], lines))
    points = [assembly.description.response.point]
    theta = assembly.by_joint(latin_hypercube(assembly, samples, seed=0))
    engine = assembly.engine_of(points)
    exact = engine.frfs(theta)[:, 0]
    joints = shortest(lambda: engine.plan.inputs.gather(theta, samples))
    whole = shortest(lambda: engine.frfs(theta))
    print(f"{samples} samples, {exact.shape[1]} lines, {engine.threads} threads; joint models {1e3 * joints:.1f} ms")
    operations = FLOP * engine.program.multiplications * exact.shape[1]
    print(f"Per FRF: {operations / 1e6:.1f} million floating-point operations, and {exact[0].nbytes / 1e3:.0f} kB.")
    print("| | FRFs per second | time, engine = 1 | largest relative error |\n|---|---|---|---|")
    print(f"| engine, double, with the joint models | {samples / whole:.0f} | 1 | - |")
    for device in devices:
        for precision in (torch.float64, torch.float32):
            prototype = Prototype(engine, device, precision)
            compute = torch.compile(prototype) if fused else prototype
            terms = prototype.terms(theta, samples)
            spent = shortest(lambda: as_complex(compute(terms)))  # noqa: B023
            error = np.max(np.abs(as_complex(compute(terms)) / exact - 1.0))
            name = f"torch on {device}, {'double' if precision == torch.float64 else 'single'}"
            print(f"| {name} | {samples / spent:.0f} | {spent / whole:.2f} | {error:.1e} |", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--lines", type=int, help="those of the assembly by default")
    parser.add_argument("--device", action="append", help="cpu, and cuda if there is one, by default")
    parser.add_argument("--compile", action="store_true", help="fuse the operations with torch.compile")
    given = parser.parse_args()
    present = ["cpu", *(["cuda"] if torch.cuda.is_available() else [])]
    main(given.samples, given.device or present, fused=given.compile, lines=given.lines)
