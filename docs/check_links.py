"""Checks every link of the built site: ``python docs/check_links.py FOLDER``, with ``--outside`` other sites' too.

A link within the site has to lead to a file, and to an element of that page if it names one. ``--outside`` asks each
other address once, and lists those that do not answer.
"""

import argparse
import sys
import urllib.request
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit


class Links(HTMLParser):
    """The names of a page's elements, and the addresses to which it leads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.addresses: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect names and addresses."""
        given = {key: value for key, value in attrs if value}
        self.names |= {given[key] for key in ("id", "name") if key in given}
        self.addresses |= {given[key] for key in ("href", "src") if key in given}


def pages_of(site: Path) -> dict[Path, Links]:
    """Return the pages of a site."""
    return {page.resolve(): Links(page.read_text(encoding="utf-8")) for page in sorted(site.rglob("*.html"))}


def broken(pages: dict[Path, Links]) -> Iterator[tuple[Path, str]]:
    """Yield each page and its links within the site that lead nowhere."""
    for page, links in pages.items():
        for address in sorted(links.addresses):
            parts = urlsplit(address)
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            target = target / "index.html" if target.is_dir() else target
            named = target not in pages or not parts.fragment or unquote(parts.fragment) in pages[target].names
            if not target.exists() or not named:
                yield page, address


def unanswered(pages: dict[Path, Links]) -> Iterator[tuple[str, str]]:
    """Yield each address of another site that does not answer, and why."""
    every = {address for links in pages.values() for address in links.addresses}
    for address in sorted({each.partition("#")[0] for each in every if each.startswith(("http:", "https:"))}):
        request = urllib.request.Request(address, headers={"User-Agent": "Mozilla/5.0"})
        try:
            urllib.request.urlopen(request, timeout=20).close()
        except OSError as error:
            yield address, str(error)


def main() -> None:
    """Print what is broken, and end with 1 if anything is."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("site", type=Path)
    parser.add_argument("--outside", action="store_true", help="ask other sites too")
    given = parser.parse_args()
    pages = pages_of(given.site)
    found = [f"{page.name}: {address} leads nowhere" for page, address in broken(pages)]
    found += [f"{address}: {why}" for address, why in unanswered(pages)] if given.outside else []
    print(*found, f"{len(pages)} pages, {sum(len(links.addresses) for links in pages.values())} links", sep="\n")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
