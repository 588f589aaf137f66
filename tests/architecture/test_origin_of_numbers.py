"""Numbers that were measured stand in a section with their origin: a command, a generated block, or a link to it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
EVERY = [*DOCS.rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
PAGES = sorted(page for page in EVERY if page.read_text(encoding="utf-8").startswith("# "))
"""Files without a title are tables that commands wrote, and that pages include."""
MEASURED = re.compile(
    r"\b(?:took|takes?|needs?|in|within|of) (?:about |some |under |less than )?\d[\d.,]*(?: (?:to|and) \d[\d.,]*)?"
    r" (?:ms|s|min|minutes?|seconds?|hours?|GB|MB|kB)\b"
    r"|\d+\.\d+ ?%"
    r"|\b\d+ of \d+ "
)
"""Durations, sizes, percentages and counts of cases, as reports of measurements have them."""
ORIGIN = re.compile(
    r"`[^`]*(?:dovetail |python |\.py|pytest|pip )[^`]*`|```|\{include\}|doi\.org|<!-- |\]\([\w/]*\.?md[#)]|\.md[#)]"
)
"""A command or script, a block of code or output, an included or generated block, a publication, another page."""
LIMITS_OF_THE_CODE = {("identification.md", "How the fit works"), ("security.md", "Limits")}
"""Sections whose numbers are settings that the code has, and no measurements."""


def sections(text: str) -> Iterator[tuple[str, str]]:
    """Yield the heading and the text of each section."""
    for section in re.split(r"^(?=#+ )", text, flags=re.M):
        yield section.partition("\n")[0].lstrip("# "), section


def without_origin(text: str) -> dict[str, list[str]]:
    """Return the numbers of each section that has no origin for them."""
    found = {}
    for heading, section in sections(text):
        numbers = MEASURED.findall(re.sub(r"```.*?```", "", section, flags=re.S))
        if numbers and not ORIGIN.search(section):
            found[heading] = numbers
    return found


def test_every_measured_number_has_an_origin_in_its_section():
    found = {
        (page.name, heading): numbers
        for page in PAGES
        for heading, numbers in without_origin(page.read_text(encoding="utf-8")).items()
    }
    assert {place: numbers for place, numbers in found.items() if place not in LIMITS_OF_THE_CODE} == {}


@pytest.mark.parametrize("number", ["It took 16 s.", "The error is 2.5 %.", "right in 39 of 40 cases", "needs 1.5 GB"])
def test_a_number_without_an_origin_is_found(number):
    assert list(without_origin(f"# Page\n\n## One\n\n{number}\n")) == ["One"]
    for origin in ("`dovetail identify x`", "`python tests/benchmarks/cost.py`", "[here](speed.md)", "<!-- made -->"):
        assert without_origin(f"# Page\n\n## One\n\n{number} {origin}\n") == {}


def test_the_exceptions_exist():
    for page, heading in LIMITS_OF_THE_CODE:
        assert heading in dict(sections((DOCS / page).read_text(encoding="utf-8")))
