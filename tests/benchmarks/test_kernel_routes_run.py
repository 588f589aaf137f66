"""The benchmarks of the kernel's routes and variants run, and print a row for each."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from support.scripts import run_script

FOLDER = Path(__file__).parent


def features() -> str:
    """Return what this processor can do, where the system shows."""
    reported = Path("/proc/cpuinfo")
    return reported.read_text() if reported.exists() else ""


def test_the_benchmark_prints_a_row_for_each_system():
    printed = run_script(FOLDER / "kernel_routes.py", 16, 2, 10)
    rows = re.findall(r"^(beams|blocks) +(\d+) +(\d+) +\d+ +(\S+) .* \d+$", printed, flags=re.M)
    assert [row[:2] for row in rows] == [("beams", "8"), ("beams", "40"), ("blocks", "8"), ("blocks", "40")]
    assert [row[3] == "-" for row in rows] == [False, False, False, True]  # too large for straight-line code


@pytest.mark.slow
@pytest.mark.skipif("avx512f" not in features(), reason="the reciprocal needs AVX-512")
def test_the_variants_of_the_kernel_print_a_time_each():
    printed = run_script(FOLDER / "kernel_variants.py", 2, 1, 3)
    assert len(re.findall(r"^(?:FRF|amplitude|with Jacobian), .* \d+\.\d+ ms, compiled in \d", printed, re.M)) == 12
    assert "multiplications: 306" in printed
