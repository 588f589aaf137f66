"""Notebooks become pages with what their cells print and draw."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("myst_parser")
DOCS = Path(__file__).parents[2] / "docs"
notebook_pages, run_notebook = (
    SimpleNamespace(**runpy.run_path(str(DOCS / name))) for name in ("notebook_pages.py", "run_notebook.py")
)


def notebook(folder: Path, *cells: str) -> Path:
    """Write a notebook: a cell that begins with # is text."""
    kinds = [("markdown" if cell.startswith("# ") else "code", cell) for cell in cells]
    content = {"cells": [{"cell_type": kind, "source": cell.splitlines(keepends=True)} for kind, cell in kinds]}
    file = folder / "some.ipynb"
    file.write_text(json.dumps(content), encoding="utf-8")
    return file


def test_a_page_shows_code_with_what_it_prints_returns_and_draws(tmp_path):
    cells = (
        "# Title",
        "x = 2\nprint('two')\nx + 1",
        "class Table:\n    def _repr_html_(self):\n        return '<b>bold</b>'\nTable()",
        "import matplotlib.pyplot as plt\nplt.figure(figsize=(1, 1))",
        "y = x",
    )
    text = notebook_pages.page(notebook(tmp_path, *cells))
    assert text.startswith("# Title\n\nDownload it: {download}`some.ipynb`")
    assert "``````text\ntwo\n``````\n\n``````text\n3\n``````" in text
    assert '``````{raw} html\n<div class="cell-output"><b>bold</b></div>\n``````' in text
    assert text.count('src="data:image/png;base64,iVBOR') == 1
    assert text.endswith("``````python\ny = x\n``````")


def test_a_cell_may_write_a_file_that_the_next_one_imports(tmp_path):
    outputs = run_notebook.outputs_of(notebook(tmp_path, "%%writefile half.py\nHALF = 0.5", "import half\nhalf.HALF"))
    assert outputs == [[["text", "Writing half.py"]], [["text", "0.5"]]]


def test_a_cell_that_fails_stops_the_build_with_its_traceback(tmp_path):
    with pytest.raises(RuntimeError, match=r"some.ipynb:(?s:.*)ZeroDivisionError"):
        run_notebook.outputs_of(notebook(tmp_path, "1 / 0"))
