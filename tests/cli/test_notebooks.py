"""The notebooks of the documentation, their cells run from top to bottom in a process of its own."""

from __future__ import annotations

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NOTEBOOKS = ROOT / "docs" / "notebooks"


def script(notebook: Path) -> str:
    """Return the code of a notebook as a script; what a cell ends with is shown as a notebook does."""
    lines = ["from pathlib import Path", "def show(value): print(getattr(value, '_repr_html_', value.__repr__)())"]
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        first, _, rest = "".join(cell["source"]).partition("\n")
        if first.startswith("%%writefile "):
            lines.append(f"Path({first.split()[1]!r}).write_text({rest!r}, encoding='utf-8')")
            continue
        tree = ast.parse(f"{first}\n{rest}")
        if isinstance(last := tree.body[-1], ast.Expr):
            last.value = ast.Call(ast.Name("show"), [last.value], [])
        lines.append(ast.unparse(ast.fix_missing_locations(tree)))
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("identification", ["to the noise", "k: 2.5", "identified", "178 Hz"]),
        ("plugin", ["'passed': ", "k: 2", "identified"]),
        pytest.param("campaign", ["20 N m: good", "100 N m: good", "changed", "predicted 29"], marks=pytest.mark.slow),
    ],
)
def test_a_notebook_runs_from_top_to_bottom(name, printed, tmp_path):
    shutil.copytree(ROOT / "assemblies", tmp_path / "assemblies")
    folder = tmp_path / "docs" / "notebooks"
    folder.mkdir(parents=True)
    (folder / "script.py").write_text(script(NOTEBOOKS / f"{name}.ipynb"), encoding="utf-8")
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    words = [sys.executable, "script.py"]
    ran = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert [text for text in printed if text not in ran.stdout] == [], ran.stdout


def test_there_are_no_other_notebooks_and_none_holds_old_output():
    assert {file.stem for file in NOTEBOOKS.iterdir()} == {"identification", "plugin", "campaign"}
    for file in NOTEBOOKS.iterdir():
        cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
        assert [cell["source"] for cell in cells if cell.get("outputs")] == []
