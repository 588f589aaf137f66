"""Checks the paper against the rules of JOSS and writes it as a page: ``python docs/make_paper.py PAGE.html``.

No network and no LaTeX are needed. Citations become links to the list of references, which is made from `paper.bib`.
"""

from __future__ import annotations

import html
import re
import sys
import unicodedata
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml
from markdown_it import MarkdownIt

PAPER = Path(__file__).parents[1] / "paper" / "paper.md"
SECTIONS = (
    "Summary",
    "Statement of need",
    "State of the field",
    "Software design",
    "Research impact statement",
    "AI usage disclosure",
    "Acknowledgements",
    "References",
)
"""Sections that JOSS requires, in the order of its rules."""
WORDS = 750, 1750
"""Least and largest number of words, of the text without the metadata."""
FIELDS = {"article": ("author", "title", "journal", "year", "doi"), "software": ("author", "title", "url")}
"""What an entry of the bibliography needs."""
_CITATION = re.compile(r"\[((?:-?@[\w:-]+(?:;\s*)?)+)\]|(?<![\w\[`])@([\w:-]+)")
_ACCENT = re.compile(r"\\([\"'`^~]|[vc](?=\{))\{?(\w)\}?")
_COMBINING = {'"': "\u0308", "'": "\u0301", "`": "\u0300", "^": "\u0302", "~": "\u0303", "v": "\u030c", "c": "\u0327"}


def parts(text: str) -> tuple[dict[str, Any], str]:
    """Return the metadata and the text of a paper."""
    _, metadata, body = re.split(r"^---\s*$", text, maxsplit=2, flags=re.MULTILINE)
    return yaml.safe_load(metadata), body.strip() + "\n"


def bibliography(text: str) -> dict[str, dict[str, str]]:
    """Return the entries of a BibTeX file by their keys; a field `kind` is article, software, ..."""
    entries = {}
    for kind, key, fields in re.findall(r"^@(\w+)\{([^,\s]+),(.*?)^\}", text, flags=re.MULTILINE | re.DOTALL):
        found = re.findall(r"^\s*(\w+)\s*=\s*\{(.*)\},?\s*$", fields, flags=re.MULTILINE)
        entries[key] = {"kind": kind.lower(), **{name.lower(): _plain(value) for name, value in found}}
    return entries


def _plain(value: str) -> str:
    """Return a value without the commands of LaTeX."""
    letters = _ACCENT.sub(lambda match: unicodedata.normalize("NFC", match[2] + _COMBINING[match[1]]), value)
    return letters.replace("{", "").replace("}", "").replace("--", "\u2013")


def cited(body: str) -> list[str]:
    """Return the keys of all citations, in their order."""
    keys = (key for several, one in _CITATION.findall(body) for key in re.findall(r"@([\w:-]+)", several) or [one])
    return list(dict.fromkeys(keys))


def problems(metadata: Mapping[str, Any], body: str, entries: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    """Yield what JOSS would not accept."""
    headings = re.findall(r"^# (.+?)\s*$", body, flags=re.MULTILINE)
    if headings != list(SECTIONS):
        yield f"the sections are {headings}, not {list(SECTIONS)}"
    for number, text in enumerate(re.split(r"^# .+$", body, flags=re.MULTILINE)[1:-1]):
        if not text.strip():
            yield f"the section '{headings[number]}' is empty"
    words = len(re.sub(r"^# .+$", "", body, flags=re.MULTILINE).split())
    if not WORDS[0] <= words <= WORDS[1]:
        yield f"the paper has {words} words, not {WORDS[0]} to {WORDS[1]}"
    yield from _metadata_problems(metadata)
    keys = cited(body)
    for key in keys:
        if key not in entries:
            yield f"'@{key}' is cited and not in the bibliography"
    for key, entry in entries.items():
        if key not in keys:
            yield f"'{key}' is in the bibliography and never cited"
        for field in FIELDS.get(entry["kind"], ("author", "title")):
            if not entry.get(field):
                yield f"'{key}' has no {field}"


def _metadata_problems(metadata: Mapping[str, Any]) -> Iterator[str]:
    for field in ("title", "tags", "authors", "affiliations", "date", "bibliography"):
        if not metadata.get(field):
            yield f"the metadata has no {field}"
    if "`" in str(metadata.get("title", "")):
        yield "the title has formatting"
    known = {str(one["index"]) for one in metadata.get("affiliations") or ()}
    for author in metadata.get("authors") or ():
        for index in str(author.get("affiliation", "")).split(","):
            if index.strip() not in known:
                yield f"the affiliation '{index.strip()}' of {author.get('name')} is not listed"
    try:
        datetime.strptime(str(metadata.get("date")), "%d %B %Y")  # a date without a time
    except ValueError:
        yield f"the date is '{metadata.get('date')}', not as 9 October 2024"


def page(metadata: Mapping[str, Any], body: str, entries: Mapping[str, Mapping[str, str]]) -> str:
    """Return the paper as HTML."""
    listed = "\n\n".join(f'<p id="{key}">{_reference(entry)}</p>' for key, entry in sorted(entries.items()))
    text = _CITATION.sub(lambda match: _links(match, entries), body) + f"\n{listed}\n"
    title = html.escape(metadata["title"])
    authors = html.escape(", ".join(author["name"] for author in metadata["authors"]))
    rendered = MarkdownIt("commonmark", {"html": True}).render(text)
    style = "body{max-width:42em;margin:2em auto;padding:0 1em;font:1.05em/1.5 serif}"
    head = f'<meta charset="utf-8"><title>{title}</title><style>{style}</style>'
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}</head><body>\n'
        f"<h1>{title}</h1>\n<p>{authors}, {metadata['date']}</p>\n{rendered}</body></html>\n"
    )


def _links(match: re.Match[str], entries: Mapping[str, Mapping[str, str]]) -> str:
    several, one = match.groups()
    if one:
        entry = entries[one]
        return f'<a href="#{one}">{_names(entry)} ({entry.get("year", "n.d.")})</a>'
    keys = re.findall(r"@([\w:-]+)", several)
    links = (f'<a href="#{key}">{_names(entries[key])}, {entries[key].get("year", "n.d.")}</a>' for key in keys)
    return f"({'; '.join(links)})"


def _names(entry: Mapping[str, str]) -> str:
    """Return the authors as a citation names them."""
    surnames = [name.split(",")[0] for name in entry["author"].split(" and ")]
    return " and ".join(surnames) if len(surnames) < 3 else f"{surnames[0]} et al."


def _reference(entry: Mapping[str, str]) -> str:
    address = f"https://doi.org/{entry['doi']}" if entry.get("doi") else entry.get("url", "")
    pages = " ".join(filter(None, [entry.get("volume", ""), entry.get("pages", "")]))
    journal = f" <i>{html.escape(entry['journal'])}</i> {pages}." if entry.get("journal") else ""
    year = f" ({entry['year']})" if entry.get("year") else ""
    names = html.escape(entry["author"].replace(" and ", "; "))
    return f'{names}{year}: {html.escape(entry["title"])}.{journal} <a href="{address}">{address}</a>'


def main() -> None:
    """Check the paper, and write it to the file that the command names."""
    metadata, body = parts(PAPER.read_text(encoding="utf-8"))
    entries = bibliography(PAPER.with_name(metadata["bibliography"]).read_text(encoding="utf-8"))
    if found := list(problems(metadata, body, entries)):
        sys.exit("\n".join(f"{PAPER.name}: {problem}" for problem in found))
    Path(sys.argv[1]).write_text(page(metadata, body, entries), encoding="utf-8")


if __name__ == "__main__":
    main()
