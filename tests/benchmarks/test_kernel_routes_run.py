"""The benchmarks of the kernel's routes and variants run, and print a row for each."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest


def features() -> str:
    """Return what this processor can do, where the system shows."""
    reported = Path("/proc/cpuinfo")
    return reported.read_text() if reported.exists() else ""


def test_the_benchmark_prints_a_row_for_each_system():
    script = Path(__file__).parent / "kernel_routes.py"
    done = subprocess.run([sys.executable, str(script), "16", "2", "10"], capture_output=True, text=True, check=True)
    rows = re.findall(r"^(beams|blocks) +(\d+) +(\d+) +\d+ +(\S+) .* \d+$", done.stdout, flags=re.M)
    assert [row[:2] for row in rows] == [("beams", "8"), ("beams", "40"), ("blocks", "8"), ("blocks", "40")]
    assert [row[3] == "-" for row in rows] == [False, False, False, True]  # too large for straight-line code


@pytest.mark.skipif("avx512f" not in features(), reason="the reciprocal needs AVX-512")
def test_the_variants_of_the_kernel_print_a_time_each():
    script = Path(__file__).parent / "kernel_variants.py"
    done = subprocess.run([sys.executable, str(script), "2", "1", "3"], capture_output=True, text=True, check=True)
    assert len(re.findall(r"^(?:FRF|amplitude|with Jacobian), .* \d+\.\d+ ms, compiled in \d", done.stdout, re.M)) == 12
    assert "multiplications: 306" in done.stdout
