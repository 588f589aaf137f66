"""Runs the cells of a notebook from top to bottom: ``python docs/run_notebook.py NOTEBOOK``.

What each cell shows is printed as a line of JSON: a list of pairs, kind ("text", "html", "png" as base64) and content.
"""

from __future__ import annotations

import ast
import base64
import contextlib
import io
import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

ROOT = Path(__file__).resolve().parents[1]


def shown(value: Any) -> list[tuple[str, str]]:
    """Return what a notebook shows of the value that a cell ends with."""
    if value is None:
        return []
    if hasattr(value, "savefig"):
        picture = io.BytesIO()
        value.savefig(picture, format="png", dpi=90)
        return [("png", base64.b64encode(picture.getvalue()).decode())]
    if hasattr(value, "_repr_html_"):
        return [("html", value._repr_html_())]
    return [("text", repr(value))]


def run_cell(source: str, names: dict[str, Any]) -> list[tuple[str, str]]:
    """Run a cell's code, and return what it prints and what the value of its last expression looks like."""
    first, _, rest = source.partition("\n")
    if first.startswith("%%writefile "):
        Path(first.split()[1]).write_text(rest, encoding="utf-8")
        return [("text", f"Writing {first.split()[1]}")]
    tree, printed, value = ast.parse(source), io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    text = printed.getvalue().rstrip()
    return [*([("text", text)] if text else []), *shown(value)]


def outputs_of(notebook: Path) -> list[list[tuple[str, str]]]:
    """Run a notebook in a process and a folder of its own, and return the outputs of its code cells.

    Raises
    ------
    RuntimeError
        A cell failed; the message has its traceback.
    """
    with TemporaryDirectory() as folder:
        place = Path(folder) / "docs" / "notebooks"
        place.mkdir(parents=True)
        (Path(folder) / "assemblies").symlink_to(ROOT / "assemblies")
        environment = {**os.environ, "MPLBACKEND": "Agg", "OMP_NUM_THREADS": "1"}
        words = [sys.executable, __file__, str(notebook.resolve())]
        ran = subprocess.run(words, cwd=place, env=environment, capture_output=True, text=True)
    if ran.returncode:
        raise RuntimeError(f"{notebook.name}:\n{ran.stderr}")
    return [json.loads(line) for line in ran.stdout.splitlines()]


if __name__ == "__main__":
    shared: dict[str, Any] = {"__name__": "__main__"}
    sys.path.insert(0, "")
    for each in json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))["cells"]:
        if each["cell_type"] == "code":
            sys.stdout.write(json.dumps(run_cell("".join(each["source"]), shared)) + "\n")
            sys.stdout.flush()
