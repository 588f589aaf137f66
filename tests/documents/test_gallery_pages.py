"""All pages of the gallery have the same form, and the overview leads to each."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
PAGES = sorted(page for page in GALLERY.glob("*.md") if page.stem != "index")
SECTIONS = [
    "What was known",
    "What was identified",
    "What was predicted, and how well",
    "What the verdict said",
    "Data",
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_of_the_gallery_has_the_sections_of_all(page):
    sections = re.findall(r"^## (.*)$", page.read_text(encoding="utf-8"), flags=re.M)
    assert [section for section in sections if section != "Why not better"] == SECTIONS
    if "Why not better" in sections:
        assert sections[-2:] == ["Why not better", "Data"]


def test_the_overview_leads_to_each_page():
    overview = (GALLERY / "index.md").read_text(encoding="utf-8")
    assert [page.stem for page in PAGES if f"]({page.name})" not in overview] == []
    hidden = overview.partition("{toctree}")[2].split()
    assert [page.stem for page in PAGES if page.stem not in hidden] == []
