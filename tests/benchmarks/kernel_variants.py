"""Attempts to make the kernel faster: variants of its code, on the collet assembly, one thread, kernel alone.

    python tests/benchmarks/kernel_variants.py

Some variants compute nonsense: they show what a part of the code costs. The reciprocal needs a processor with AVX-512.
"""

from __future__ import annotations

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1")

import random
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import dovetail
from dovetail.dataset import latin_hypercube
from dovetail.synthesis import Engine
from dovetail.synthesis.codegen.compiler import VECTOR, WIDTH, MachineKernel, aligned_empty, as_vectors, constant
from dovetail.synthesis.codegen.looped import looped_kernel_source
from dovetail.synthesis.codegen.straight_line import kernel_source

ASSEMBLY = Path(__file__).resolve().parents[2] / "assemblies" / "bt40_er32.yaml"


def without_division(source: str) -> str:
    """Multiply where the code divides: what division costs."""
    return source.replace("fdiv", "fmul")


def without_guard(source: str) -> str:
    """Compare pivots with zero: what the guard costs."""
    return re.sub(rf"fcmp ule {re.escape(VECTOR)} (%\w+), %\w+", rf"fcmp ule {VECTOR} \1, zeroinitializer", source)


def with_reciprocal(source: str) -> str:
    """Replace each division by the processor's estimate of 14 bits and two Newton steps."""
    number = 0

    def steps(division: re.Match[str]) -> str:
        nonlocal number
        number += 1
        value, n = division[2], number
        fma = f"call {VECTOR} @llvm.fma.v{WIDTH}f64({VECTOR} "
        estimate = f"call {VECTOR} @llvm.x86.avx512.rcp14.pd.512({VECTOR} {value}, {VECTOR} undef, i8 -1)"
        return (
            f"%estimate{n} = {estimate}\n  %minus{n} = fneg {VECTOR} {value}\n"
            f"  %error{n} = {fma}%minus{n}, {VECTOR} %estimate{n}, {VECTOR} {constant(1.0)})\n"
            f"  %better{n} = {fma}%estimate{n}, {VECTOR} %error{n}, {VECTOR} %estimate{n})\n"
            f"  %rest{n} = {fma}%minus{n}, {VECTOR} %better{n}, {VECTOR} {constant(1.0)})\n"
            f"  {division[1]} = {fma}%better{n}, {VECTOR} %rest{n}, {VECTOR} %better{n})"
        )

    replaced = re.sub(rf"(%\w+) = fdiv {re.escape(VECTOR)} <[^>]*>, (%\w+)", steps, source)
    return f"{replaced}\ndeclare {VECTOR} @llvm.x86.avx512.rcp14.pd.512({VECTOR}, {VECTOR}, i8)\n"


def two_samples(source: str) -> str:
    """Work on two samples in turn, so that one goes on while the other waits for a pivot."""
    lines = source.split("\n")
    first = next(i for i, line in enumerate(lines) if line.startswith("begin:")) + 2
    last = next(i for i, line in enumerate(lines) if "br label %after" in line)
    body = lines[first:last]
    results = set(re.findall(r"^\s+(%\w+) =", "\n".join(body), flags=re.M)) | {"%sample"}
    other = [re.sub(r"%\w+", lambda m: f"{m[0]}_b" if m[0] in results else m[0], line) for line in body]
    lines[first:last] = [
        "  %sample_b = add i64 %sample, 1",
        *(x for pair in zip(body, other, strict=True) for x in pair),
    ]
    return "\n".join(lines).replace("%next_sample = add i64 %sample, 1", "%next_sample = add i64 %sample, 2")


def optimised(source: str) -> str:
    """Run LLVM's own optimisations (-O3) on the code."""
    import llvmlite.binding as llvm

    from dovetail.synthesis.codegen.compiler import _target_machine

    module = llvm.parse_assembly(source)
    builder = llvm.create_pass_builder(_target_machine(), llvm.create_pipeline_tuning_options(speed_level=3))
    builder.getModulePassManager().run(module, builder)
    return str(module)


def kept_in_caches(source: str) -> str:
    """Store derivatives as everything else, through the caches."""
    return source.replace("%many = icmp sge i64 %samples, 8", "%many = icmp slt i64 %samples, 0")


def one_place(source: str) -> str:
    """Store the derivatives of all samples at one place: what writing them costs."""
    return re.sub(r"%derivative_row = mul i64 %sample, \d+", "%derivative_row = mul i64 %sample, 0", source)


class Bench:
    """Kernels of the collet assembly on arrays that are reused, so that neither gathering nor fresh memory counts."""

    def __init__(self, samples: int, rounds: int) -> None:
        self.samples, self.rounds = samples, rounds
        assembly = dovetail.load(ASSEMBLY)
        self.engine = engine = assembly.engine
        theta = assembly.by_joint(latin_hypercube(assembly, samples, seed=0))
        engine.frfs_jacobian(theta)  # plans for all entries of the derivatives
        self.lines = len(engine.system.frequency)
        factor = as_vectors(np.stack([np.ones(self.lines), np.zeros(self.lines)]))
        terms = engine.plan.inputs.gather(theta, samples)
        weights, none = engine.plan.inputs.gather_weights(theta, samples), np.empty((samples, 0))
        result = aligned_empty((samples, self.lines), np.complex128)
        derived = aligned_empty((samples, engine.plan.inputs.parameters, self.lines), np.complex128)
        flags = np.zeros(samples, dtype=np.uint8)
        omega, static = engine.plan.omega, engine.plan.static
        self.arrays = (omega, factor, static, terms, none, weights, none, result, derived, flags)

    def show_instructions(self, label: str, source: str) -> None:
        """Print how many floating-point instructions on vectors the processor gets."""
        import llvmlite.binding as llvm

        from dovetail.synthesis.codegen.compiler import _target_machine

        code = _target_machine().emit_assembly(llvm.parse_assembly(source))
        count = len(re.findall(r"^\s+v(?:f|mul|add|sub|div|sqrt|xor|and|cmp)\w*\s", code, flags=re.M))
        print(f"{label}: {count} floating-point instructions for {WIDTH} lines")

    def show(self, label: str, source: str, scratch: int = 0) -> None:
        """Compile, run and print the milliseconds an FRF."""
        start = time.perf_counter()
        kernel = MachineKernel(source, scratch)
        compiled, times = time.perf_counter() - start, []
        for _ in range(self.rounds):
            start = time.perf_counter()
            kernel(len(self.engine.plan.omega), self.samples, self.lines, self.arrays)
            times.append(time.perf_counter() - start)
        print(f"{label:52}{1e3 * min(times) / self.samples:8.3f} ms, compiled in {compiled:.2f} s", flush=True)


def random_orders(engine: Engine, tries: int) -> int:
    """Return the fewest multiplications among random orders, each pivot with nearly the fewest neighbours."""
    draw, best = random.Random(0), 10**9
    keep = engine.system.index(engine.system.points[0])
    for _ in range(tries):
        graph = {dof: set(np.flatnonzero(row).tolist()) - {dof} for dof, row in enumerate(engine.system.pattern)}
        total = 1
        while len(graph) > 1:
            few = min(len(graph[dof]) for dof in graph if dof != keep) + draw.choice([0, 0, 0, 1])
            pivot = draw.choice([dof for dof in graph if dof != keep and len(graph[dof]) <= few])
            adjacent = graph.pop(pivot)
            total += len(adjacent) + len(adjacent) * (len(adjacent) + 1) // 2 + 1
            for dof in adjacent:
                graph[dof] = (graph[dof] | adjacent) - {dof, pivot}
        best = min(best, total)
    return best


def main(samples: int = 64, rounds: int = 40, tries: int = 2000) -> None:
    """Print every variant."""
    bench = Bench(samples, rounds)
    program, layout = bench.engine.program, bench.engine.plan.layout()
    derived = bench.engine.plan.layout(derivatives=True)
    plain, jacobian = kernel_source(program, layout)[0], kernel_source(program, derived)[0]
    changes: tuple[tuple[str, Callable[[str], str]], ...] = (
        ("as it is", lambda source: source),
        ("without division", without_division),
        ("without guard", without_guard),
        ("reciprocal and two Newton steps", with_reciprocal),
        ("two samples in turn", two_samples),
        ("LLVM -O3", optimised),
    )
    for label, change in changes:
        bench.show(f"FRF, {label}", change(plain))
    bench.show("FRF, loops", *looped_kernel_source(program, layout))
    bench.show("amplitude, as it is", *kernel_source(program, layout, amplitude=True))
    bench.show("with Jacobian, as it is", jacobian)
    bench.show("with Jacobian, stored through the caches", kept_in_caches(jacobian))
    bench.show("with Jacobian, all stored at one place", one_place(jacobian))
    bench.show("with Jacobian, LLVM -O3", optimised(jacobian))
    bench.show_instructions("FRF", plain)
    bench.show_instructions("with Jacobian", jacobian)
    print(f"multiplications: {program.multiplications}; the fewest of {tries} random orders: ", end="")
    print(random_orders(bench.engine, tries))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
