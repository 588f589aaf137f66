"""Processes in which packages that are installed cannot be imported."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path

_TOOLS = {"all", "test", "docs", "mutation"}
_PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS: dict[str, list[str]] = {
    extra: [re.split(r"[><=\[ ]", line)[0] for line in lines]
    for extra, lines in _PROJECT["optional-dependencies"].items()
    if extra not in _TOOLS
}
"""The packages of each extra that users install for a feature."""
_IMPORTED = {"ansys-mapdl-reader": "ansys"}
"""Names by which packages are imported that are not those of the packages."""

_HIDE = """\
import sys


class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {names!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)


sys.meta_path.insert(0, Hidden())
"""
CALL = """\
import contextlib, io, json, sys, warnings
import numpy as np
import dovetail
import dovetail_bench
from typer.testing import CliRunner
from dovetail.cli.app import app

answers = []
for door in json.loads(sys.argv[1]):
    if isinstance(door, list):
        done = CliRunner().invoke(app, door)
        code, text = done.exit_code, done.output
        if done.exception is not None and not isinstance(done.exception, SystemExit):
            text += f"Traceback: {done.exception!r}"
    else:
        code, shown = 0, io.StringIO()
        with contextlib.redirect_stderr(shown):
            try:
                exec(door)
            except dovetail.DovetailError as error:
                code = 1
                shown.write(str(error))
            except Exception as error:
                code = 2
                shown.write(f"Traceback: {error!r}")
        text = shown.getvalue()
    answers.append((" ".join(door) if isinstance(door, list) else door, code, text))
print()
print(json.dumps(answers))
"""
"""A program that uses the doors of its argument, commands as lists of words and Python as text; it prints answers."""


def import_names(extra: str) -> set[str]:
    """Return the names by which the packages of an extra are imported."""
    return {_IMPORTED.get(name, name.replace("-", "_")) for name in EXTRAS[extra]}


def hide(names: set[str], folder: Path) -> dict[str, str]:
    """Return an environment for processes that cannot import these packages; `folder` is for what hides them."""
    (folder / "sitecustomize.py").write_text(_HIDE.format(names=sorted(names)), encoding="utf-8")
    path = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path), "OMP_NUM_THREADS": "1"}
