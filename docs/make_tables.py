"""Puts the tables that commands wrote into the pages that show them: ``python docs/make_tables.py``.

A page names its table's file between two comments, and the table stands there in full, so that the code host shows it
as the site does:

    <!-- table: joints/shaft_hub.md -->
    ...
    <!-- end of table -->
"""

import csv
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from line_length import wrapped

FOLDER = Path(__file__).parent
MARKED = re.compile(r"<!-- table: (\S+) -->\n.*?<!-- end of table -->", flags=re.S)


def filled(page: Path) -> str:
    """Return the text of a page with its tables as the files have them now."""
    return MARKED.sub(lambda mark: _block(page.parent, mark[1]), page.read_text(encoding="utf-8"))


def _block(folder: Path, name: str) -> str:
    file = folder / name
    text = _from_csv(file) if file.suffix == ".csv" else file.read_text(encoding="utf-8").strip()
    return f"<!-- table: {name} -->\n\n{wrapped(text)}\n\n<!-- end of table -->"


def _from_csv(file: Path) -> str:
    with file.open(encoding="utf-8", newline="") as stream:
        head, *rows = csv.reader(stream)
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, rule, *rows))


def pages() -> list[Path]:
    """Return the pages that show a table of a file."""
    return [page for page in sorted(FOLDER.rglob("*.md")) if MARKED.search(page.read_text(encoding="utf-8"))]


if __name__ == "__main__":
    for page in pages():
        page.write_text(filled(page), encoding="utf-8")
