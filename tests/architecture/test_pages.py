"""The files and headings that the documentation pages refer to exist, and their lines are short."""

from __future__ import annotations

import re
import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.rglob("*.md"), *ROOT.glob("*.md")])


def headings(page: Path) -> set[str]:
    """The anchors of a page, as Sphinx and GitHub make them."""
    titles = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken_links(page: Path) -> Iterator[str]:
    for link in re.findall(r"\]\(([^)\s]+)\)|<img src=\"([^\"]+)\"", page.read_text(encoding="utf-8")):
        link = "".join(link)
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        if link.startswith("http"):
            continue
        if not target.exists() or (anchor and anchor not in headings(target)):
            yield link


def test_links_lead_somewhere():
    assert {page: broken for page in PAGES if (broken := list(broken_links(page)))} == {}


def test_the_architecture_names_files_that_are_there():
    table = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").partition("## Where to make a change")[2]
    rows = [row.split("|")[2:4] for row in table.splitlines() if row.startswith("| a")]
    names = [name for row in rows for cell in row for name in re.findall(r"`([\w/]+(?:\.py|/))`", cell)]
    assert len(rows) >= 10
    assert [name for name in names if not (ROOT / "framework" / "dovetail" / name).exists()] == []


def test_the_architecture_lists_every_package_and_module_of_the_framework():
    tree = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8").partition("```\n")[2].partition("```")[0]
    listed = {name.rstrip("/") for name in re.findall(r"[\w.]+/|\w+\.py", tree)}
    folder = ROOT / "framework" / "dovetail"
    entries = {entry.name for entry in folder.iterdir() if entry.suffix == ".py" or (entry / "__init__.py").is_file()}
    plugins = {init.parent.name for init in (ROOT / "plugins").glob("*/__init__.py")}
    assert sorted((entries | plugins) - {"__init__.py"} - listed) == []
    known = {path.name for root in (folder, ROOT / "plugins") for path in root.rglob("*")}
    assert sorted(listed - known - {"framework", "dovetail", "plugins", "assemblies", "tests", "benchmarks"}) == []


def test_contributing_names_files_that_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    names = re.findall(r"`((?:framework|plugins|tests|docs)/[\w/.]+)`", text)
    assert len(names) > 20
    assert [name for name in names if not (ROOT / name).exists()] == []


def test_the_pages_of_the_site_say_at_their_top_what_the_reader_will_have():
    quiet = {"index.md", "learn.md", "do.md", "understand.md", "look_up.md", "contribute.md"}
    pages = [page for page in site_pages() if str(page.relative_to(DOCS)) not in quiet]
    tops = {str(page.relative_to(DOCS)): page.read_text(encoding="utf-8")[:400] for page in pages}
    said = re.compile(r"\A# .*\n\n(At the end of this page|Here you find) ")
    assert len(tops) > 40
    assert [name for name, top in tops.items() if not said.match(top)] == []


def site_pages() -> list[Path]:
    """The front page and all that it leads to."""
    pages = [DOCS / "index.md"]
    for page in pages:
        trees = re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.S)
        names = [name for tree in trees for name in tree.split() if not name.startswith(":")]
        pages += [page.parent / f"{name}.md" for name in names if not name.startswith("notebooks/")]
    return pages


@pytest.mark.parametrize(
    "page", [DOCS / f"{name}.md" for name in ("learn", "understand", "look_up")], ids=lambda p: p.stem
)
def test_a_section_names_each_of_its_pages_where_the_code_host_shows_it(page):
    text = page.read_text(encoding="utf-8")
    (tree,) = re.findall(r"```\{toctree\}\n(.*?)```", text, flags=re.S)
    names = [name for name in tree.split() if not name.startswith(":")]
    assert [name for name in names if f"]({name}.md)" not in text and f"]({name}.ipynb)" not in text] == []


def test_tables_in_pages_are_those_that_the_commands_wrote():
    made = runpy.run_path(str(DOCS / "make_tables.py"))
    assert len(made["pages"]()) >= 15
    for page in made["pages"]():
        assert page.read_text(encoding="utf-8") == made["filled"](page), (
            f"{page.name}: run 'python docs/make_tables.py'"
        )


def test_tables_can_be_read_on_the_code_host():
    table = re.compile(r"^```\{(include|csv-table|list-table)\}", flags=re.M)
    assert [page for page in PAGES if table.search(page.read_text(encoding="utf-8"))] == []


def long_lines(page: str) -> Iterator[str]:
    """Lines of 120 characters or more. What a program printed, and tables that it wrote, cannot be broken."""
    language, written = None, False
    for line in page.splitlines():
        if line.startswith("```"):
            language = line[3:] if language is None else None
        written = line.startswith("<!-- table: ") or (written and not line.startswith("<!-- end of table"))
        row = line.startswith("|")
        typed = language in {"bash", "python", "yaml"} or re.match(r"(\$|dovetail|python) ", line)
        cannot_be_broken = (written and row) or (language is not None and not typed)
        shown = re.sub(r"\]\([^)]*\)", "]", line) if row else line  # the address of a link cannot be broken
        if len(shown) >= 120 and not cannot_be_broken:
            yield line


def test_lines_are_shorter_than_120_characters():
    pages = (*site_pages(), ROOT / "README.md", ROOT / "CONTRIBUTING.md")
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    assert {page: lines for page, text in texts.items() if (lines := list(long_lines(text)))} == {}


def test_a_long_line_is_found_in_a_paragraph_a_row_and_a_command():
    long = "word " * 24
    assert list(long_lines(f"{long}\n\n| {long} |\n\n```console\n$ dovetail {long}\n{long}\n```\n")) == [
        long,
        f"| {long} |",
        f"$ dovetail {long}",
    ]
