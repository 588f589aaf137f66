"""The benchmark runs, and prints a ratio for each route; how fast is for its reader to judge."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path


def test_the_synthesis_benchmark_prints_a_ratio_for_each_route():
    script = Path(__file__).parent / "synthesis.py"
    done = subprocess.run([sys.executable, str(script), "16", "1", "64"], capture_output=True, text=True, check=True)
    rows = re.findall(r"^(literal|engine|64 FRFs).*?(\d+\.\d+) +(\d+) +(\d+)$", done.stdout, flags=re.M)
    assert len(rows) >= 5
    assert rows[0][0] == "literal"
    assert rows[0][3] == "1"
