"""The paper has the sections and the length that JOSS asks for, and every reference."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
SECTIONS = (
    *("Summary", "Statement of need", "State of the field", "Software design", "Research impact statement"),
    *("AI usage disclosure", "Acknowledgements", "References"),
)


def test_it_has_the_sections_in_their_order():
    assert re.findall(r"^# (.*)$", PAPER, flags=re.M) == list(SECTIONS)
    head = PAPER.split("---")[1]
    for key in ("title", "tags", "authors", "affiliations", "date", "bibliography"):
        assert f"\n{key}:" in head


def test_its_length_is_that_of_a_short_paper():
    assert 750 <= len(PAPER.split("---", 2)[2].split()) <= 1750


def test_what_is_cited_is_listed_and_the_reverse():
    cited = set(re.findall(r"@(\w+)", PAPER.split("---", 2)[2]))
    entries = re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"), flags=re.M)
    assert cited == set(entries)


def test_the_roadmap_is_short_and_says_what_will_not_be_built():
    text = (ROOT / "docs" / "roadmap.md").read_text(encoding="utf-8")
    assert "Not planned:" in text
    assert len([line for line in text.splitlines() if line.strip()]) <= 22
