"""Sphinx extension: notebooks as pages with what their cells print and draw, run while the pages are built."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from docutils import nodes
from myst_parser.parsers.sphinx_ import MystParser
from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))
from run_notebook import outputs_of


def markdown(output: tuple[str, str]) -> str:
    """Return an output as a block of Markdown."""
    kind, content = output
    if kind == "png":
        content = f'<img alt="The figure that the cell above draws" src="data:image/png;base64,{content}">'
    if kind == "text":
        return f"``````text\n{content}\n``````"
    return f'``````{{raw}} html\n<div class="cell-output">{content}</div>\n``````'


def page(notebook: Path) -> str:
    """Return a notebook with its outputs as a page in Markdown."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    outputs, parts = iter(outputs_of(notebook)), []
    for cell in cells:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts += [f"``````python\n{source}\n``````", *map(markdown, next(outputs))]
    parts.insert(1, f"Download it: {{download}}`{notebook.name}`. The outputs are those of this version.")
    return "\n\n".join(parts)


class NotebookParser(MystParser):
    """Reads a notebook as the page in Markdown that it becomes."""

    supported = ("notebook",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Run the notebook and parse the page."""
        super().parse(page(Path(document["source"])), document)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_source_suffix(".ipynb", "notebook")
    app.add_source_parser(NotebookParser)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
