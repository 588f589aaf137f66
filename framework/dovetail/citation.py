"""How to cite Dovetail: the content of CITATION.cff, and the same for BibTeX."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from dovetail.errors import DovetailError, Fault
from dovetail.version import __version__

_PLACES = (Path(__file__).with_name("CITATION.cff"), Path(__file__).parents[2] / "CITATION.cff")
"""In an installed package, and in a clone of the repository, from which the package takes it."""


def citation_file() -> str:
    """Return the text of CITATION.cff."""
    for place in _PLACES:
        if place.is_file():
            return place.read_text(encoding="utf-8")
    raise DovetailError(Fault("CITATION.cff", "the file is not installed.", remedy="Install Dovetail anew."))


def bibtex() -> str:
    """Return entries for BibTeX: the program, with its version, and the article of the method it starts from."""
    content = yaml.safe_load(citation_file())
    software = {
        "author": _authors(content),
        "title": f"{{{content['title']}}}",
        "version": __version__,
        "year": str(content["date-released"])[:4],
        "url": content["url"],
    }
    entries = [_entry("software", "dovetail", software)]
    for reference in content["references"]:
        fields = {
            "author": _authors(reference),
            "title": f"{{{reference['title']}}}",
            "journal": reference["journal"],
            "volume": reference["volume"],
            "pages": reference["start"],
            "year": reference["year"],
            "doi": reference["doi"],
        }
        entries.append(_entry("article", f"{reference['journal'].lower()}{reference['year']}", fields))
    return "\n\n".join(entries)


def plain() -> str:
    """Return the same as sentences, each with what it is cited for."""
    content = yaml.safe_load(citation_file())
    year = str(content["date-released"])[:4]
    lines = [f"{_authors(content, plain=True)} ({year}). {content['title']}. Version {__version__}. {content['url']}"]
    for reference in content["references"]:
        where = f"{reference['journal']} {reference['volume']}, {reference['start']}"
        author = _authors(reference, plain=True)
        doi = f"https://doi.org/{reference['doi']}"
        lines.append(f"{author} ({reference['year']}). {reference['title']}. {where}. {doi}")
    return "\n\n".join(lines)


def _authors(content: Mapping[str, Any], *, plain: bool = False) -> str:
    names = [entry.get("name") or f"{entry['family-names']}, {entry['given-names']}" for entry in content["authors"]]
    return "; ".join(names) if plain else " and ".join(name if "," in name else f"{{{name}}}" for name in names)


def _entry(kind: str, key: str, fields: Mapping[str, object]) -> str:
    rows = ",\n".join(f"  {name:<8}= {{{value}}}" for name, value in fields.items())
    return f"@{kind}{{{key},\n{rows}\n}}"
