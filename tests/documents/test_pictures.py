"""The page of pictures shows every picture of the documentation."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_every_picture_is_on_the_page_of_pictures_and_on_the_page_that_it_leads_to():
    text = (DOCS / "pictures.md").read_text(encoding="utf-8")
    shown = dict(re.findall(r"!\[[^\]]*\]\(([^)]+)\)\n[^\]]+\]\(([^)]+)\)", text))
    files = [file for suffix in ("png", "svg") for file in DOCS.rglob(f"*.{suffix}")]
    names = {file.relative_to(DOCS).as_posix() for file in files if not {"drawings", "_build"} & set(file.parts)}
    assert names == set(shown)
    explained = {name: (DOCS / page).read_text(encoding="utf-8") for name, page in shown.items()}
    assert [name for name, page in explained.items() if f"{Path(name).name})" not in page] == []
