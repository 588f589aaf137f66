"""The notebooks of the documentation, their cells run from top to bottom in a process of its own."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "docs" / "notebooks"


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("identification", ["to the noise", "k: 2.5", "identified", "178 Hz"]),
        ("plugin", ["'passed': ", "k: 2", "identified"]),
        pytest.param("campaign", ["20 N m: good", "100 N m: good", "changed", "predicted 29"], marks=pytest.mark.slow),
    ],
)
def test_a_notebook_runs_from_top_to_bottom(name, printed):
    outputs_of = runpy.run_path(str(ROOT / "docs" / "run_notebook.py"))["outputs_of"]
    outputs = outputs_of(NOTEBOOKS / f"{name}.ipynb")  # raises an error if a cell fails
    shown = "\n".join(content for cell in outputs for kind, content in cell if kind != "png")
    assert [text for text in printed if text not in shown] == [], shown


def test_there_are_no_other_notebooks_and_none_holds_old_output():
    assert {file.stem for file in NOTEBOOKS.iterdir()} == {"identification", "plugin", "campaign"}
    for file in NOTEBOOKS.iterdir():
        cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
        assert [cell["source"] for cell in cells if cell.get("outputs")] == []
