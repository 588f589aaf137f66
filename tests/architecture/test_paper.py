"""The paper has what JOSS asks for, and can be rendered; the roadmap is short."""

from __future__ import annotations

import re
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("markdown_it")
ROOT = Path(__file__).parents[2]
make_paper = SimpleNamespace(**runpy.run_path(str(ROOT / "docs" / "make_paper.py")))
TEXT = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
BIBLIOGRAPHY = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")


def found(text: str = TEXT, bibliography: str = BIBLIOGRAPHY) -> list[str]:
    metadata, body = make_paper.parts(text)
    return list(make_paper.problems(metadata, body, make_paper.bibliography(bibliography)))


def test_the_paper_is_as_joss_asks():
    assert found() == []


WRONG = {
    "a section is missing": (TEXT.replace("# Software design", "## Software design"), "the sections are"),
    "a section is empty": (re.sub(r"(# Acknowledgements\n).*?(?=# Ref)", r"\1\n", TEXT, flags=re.S), "is empty"),
    "too short": (re.sub(r"(# Statement of need\n).*?(?=# State of)", r"\1\nShort.\n\n", TEXT, flags=re.S), "words"),
    "too long": (TEXT.replace("# References", "word " * 1000 + "\n\n# References"), "words"),
    "an unknown citation": (TEXT.replace("@klerk2008", "@klerk2009"), "'@klerk2009' is cited and not in"),
    "an entry that is not cited": (TEXT.replace(" [@emcee]", ""), "'emcee' is in the bibliography and never cited"),
    "an unknown affiliation": (TEXT.replace("affiliation: 1", "affiliation: 2"), "the affiliation '2' of"),
    "a date of another form": (re.sub(r"date: .*", "date: 2026-11-27", TEXT, count=1), "the date is"),
    "a title with formatting": (TEXT.replace("title: 'Dovetail:", "title: '`Dovetail`:"), "the title has formatting"),
    "no tags": (re.sub(r"tags:\n(  - .*\n)+", "", TEXT), "the metadata has no tags"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_joss_would_not_accept_is_found(case):
    text, problem = WRONG[case]
    assert text != TEXT
    assert any(problem in one for one in found(text))


def test_an_entry_without_a_doi_is_found():
    shortened = re.sub(r",\n  doi     = \{10.2514/1.33274\}", "", BIBLIOGRAPHY)
    assert found(bibliography=shortened) == ["'klerk2008' has no doi"]


def test_the_page_links_every_citation_to_a_reference(tmp_path):
    page = tmp_path / "paper.html"
    subprocess.run([sys.executable, str(ROOT / "docs" / "make_paper.py"), str(page)], check=True)
    text = page.read_text(encoding="utf-8")
    links = set(re.findall(r'href="#([\w:-]+)"', text))
    assert links == set(re.findall(r'<p id="([\w:-]+)"', text)) == set(make_paper.bibliography(BIBLIOGRAPHY))
    assert "@" not in re.sub(r"<style>.*?</style>", "", text)
    assert "Göldeli" in text
    assert not re.search(r"[{\\]", re.sub(r"<style>.*?</style>", "", text))
    assert "<h1>Statement of need</h1>" in text
    assert "(Bregar et al., 2022)" in re.sub(r"</?a[^>]*>", "", text)


def test_the_roadmap_is_short_and_says_what_will_not_be_built():
    text = (ROOT / "docs" / "roadmap.md").read_text(encoding="utf-8")
    assert "Not planned:" in text
    assert len([line for line in text.splitlines() if line.strip()]) <= 22
