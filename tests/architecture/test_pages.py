"""The pages of the documentation name files and headings that are there."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted([*(ROOT / "docs").rglob("*.md"), *ROOT.glob("*.md")])


def headings(page: Path) -> set[str]:
    """The anchors of a page, as Sphinx and GitHub make them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken_links(page: Path) -> Iterator[str]:
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        if link.startswith("http"):
            continue
        if not target.exists() or (anchor and anchor not in headings(target)):
            yield link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    assert list(broken_links(page)) == []


def test_the_architecture_names_files_that_are_there():
    table = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").partition("## Where to make a change")[2]
    rows = [row.split("|")[2:4] for row in table.splitlines() if row.startswith("| a")]
    names = [name for row in rows for cell in row for name in re.findall(r"`([\w/]+(?:\.py|/))`", cell)]
    assert len(rows) >= 10
    assert [name for name in names if not (ROOT / "framework" / "dovetail" / name).exists()] == []


def test_contributing_names_files_that_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    names = re.findall(r"`((?:framework|plugins|tests|docs)/[\w/.]+)`", text)
    assert len(names) > 20
    assert [name for name in names if not (ROOT / name).exists()] == []
