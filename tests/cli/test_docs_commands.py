"""The commands of docs/first_look.md, run from top to bottom as a reader would."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```(bash|yaml)\n(.*?)^```", flags=re.S | re.M)


def test_the_first_look_runs_from_top_to_bottom(tmp_path, type_line):
    shutil.copytree(ROOT / "assemblies", tmp_path / "assemblies")
    commands = 0
    for language, text in BLOCK.findall((ROOT / "docs" / "first_look.md").read_text(encoding="utf-8")):
        if language == "yaml":
            name = re.match(r"# (\S+)\n", text)[1]
            (tmp_path / name).write_text(text, encoding="utf-8")
            continue
        for command in text.strip().splitlines():
            type_line(command)
            commands += 1
    assert commands >= 10
    made = {"frf.csv", "frf.png", "measured.uff", "small.zarr", "small_model", "predicted.csv"}
    assert made <= {path.name for path in tmp_path.iterdir()}
    assert {"report.html", "result.json", "parameters.csv"} <= {p.name for p in (tmp_path / "results").iterdir()}
    assert {"robustness.csv", "robustness.png"} <= {p.name for p in (tmp_path / "robustness").iterdir()}
