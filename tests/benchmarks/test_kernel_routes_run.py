"""The benchmark of the kernel's two routes runs, and prints a row for each system."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path


def test_the_benchmark_prints_a_row_for_each_system():
    script = Path(__file__).parent / "kernel_routes.py"
    done = subprocess.run([sys.executable, str(script), "16", "2", "10"], capture_output=True, text=True, check=True)
    rows = re.findall(r"^(beams|blocks) +(\d+) +(\d+) +\d+ +(\S+) .* \d+$", done.stdout, flags=re.M)
    assert [row[:2] for row in rows] == [("beams", "8"), ("beams", "40"), ("blocks", "8"), ("blocks", "40")]
    assert [row[3] == "-" for row in rows] == [False, False, False, True]  # too large for straight-line code
