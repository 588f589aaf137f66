"""The pages of the documentation in headless Chromium: they fit, log nothing and load nothing from elsewhere.

CI opens the main ones, in the folder that its documentation step has built; the others take minutes.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("fcntl", reason="the browser is reached over pipes, as POSIX has them")
pytest.importorskip("sphinx")
from chromium import Browser, find_chromium

CHROMIUM = find_chromium()
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="there is no Chromium on this machine"),
]

DOCS = Path(__file__).parents[2] / "docs"
AXE = Path(__file__).parent / "vendor" / "axe.min.js"
MAIN = ("index", "first_look", "method", "models", "options")
LONGEST = 40_000
"""Pixels of the longest page in a window of 1440 or more; one of all contracts had 73,600."""
SIZES = [(360, "light"), (768, "dark"), (1440, "light"), (1440, "dark")]


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if built := os.environ.get("DOVETAIL_SITE"):
        return Path(built)
    folder = tmp_path_factory.mktemp("site")
    subprocess.run([sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", DOCS, folder], check=True)
    return folder


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    assert CHROMIUM is not None
    started = Browser(CHROMIUM, tmp_path_factory.mktemp("profile"))
    yield started
    started.close()


def _pages(site: Path) -> list[Path]:
    pages = sorted(page for page in site.rglob("*.html") if "_static" not in page.parts)
    assert len(pages) > 50
    return pages


def unfit(browser: Browser, file: Path, width: int, scheme: str) -> list[tuple[str, object]]:
    """What a page says to the console, whom it asks, by how many pixels it is too wide, and how long it is."""
    with browser.page(file.as_uri(), width, 900, scheme) as page:
        wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
        tall = page.evaluate("document.documentElement.scrollHeight")
        sizes = [wide] * (wide > 0) + [f"{tall} pixels long"] * (width >= 1440 and tall > LONGEST)
        outside = [url for url in page.requests() if not url.startswith(("file:", "data:"))]
        return [(file.name, fault) for fault in [*page.errors(), *outside, *sizes]]


def kept_out(browser: Browser, file: Path, width: int, scheme: str) -> list[tuple[str, object]]:
    """What axe-core finds in a page that keeps somebody out."""
    with browser.page(file.as_uri(), width, 900, scheme) as page:
        page.evaluate(AXE.read_text(encoding="utf-8") + "; 0")
        found = page.evaluate(
            "axe.run(document.querySelector('article') || document, {resultTypes: ['violations']})"
            ".then(r => r.violations.map(v => [v.impact, v.id, v.nodes[0].html.slice(0, 160)].join(' | ')))"
        )
        return [(file.name, fault) for fault in found if fault.startswith(("serious", "critical"))]


@pytest.mark.parametrize(("width", "scheme"), SIZES)
def test_main_pages_fit_the_window_and_are_accessible(browser: Browser, site: Path, width: int, scheme: str) -> None:
    for name in MAIN:
        assert unfit(browser, site / f"{name}.html", width, scheme) == []
        assert kept_out(browser, site / f"{name}.html", width, scheme) == []


@pytest.mark.parametrize(("width", "scheme"), SIZES)
def test_every_page_fits_and_is_silent(browser: Browser, site: Path, width: int, scheme: str) -> None:
    assert [fault for file in _pages(site) for fault in unfit(browser, file, width, scheme)] == []


@pytest.mark.parametrize(("width", "scheme"), [(360, "dark"), (1440, "light")])
def test_every_page_is_accessible(browser: Browser, site: Path, width: int, scheme: str) -> None:
    assert [fault for file in _pages(site) for fault in kept_out(browser, file, width, scheme)] == []
