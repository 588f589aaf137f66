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
import matplotlib.pyplot as plt
from chromium import Browser, Page, find_chromium

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
SIZES = [(360, "light"), (390, "light"), (390, "dark"), (768, "dark"), (1440, "light"), (1440, "dark")]
CUT_OFF = """
[...document.querySelectorAll("article *")].filter((part) => {
  const box = part.getBoundingClientRect();
  if (!box.width || !box.height || box.right <= innerWidth + 1 || box.left >= innerWidth) return false;
  for (let around = part.parentElement; around; around = around.parentElement) {
    if (["auto", "scroll"].includes(getComputedStyle(around).overflowX) && around.tabIndex === 0) return false;
  }
  return true;
}).slice(0, 3).map((part) => "cut off: " + part.outerHTML.slice(0, 120))
"""
"""What is wider than the window, and in nothing that scrolls and that the keyboard reaches."""
SQUEEZED = """
[...document.querySelectorAll("article td")].filter((cell) => {
  const text = document.createRange();
  text.selectNodeContents(cell);
  const box = text.getBoundingClientRect();
  return cell.clientWidth < 130 && box.height > 8 * parseFloat(getComputedStyle(cell).lineHeight);
}).slice(0, 3).map((cell) => "squeezed: " + cell.textContent.slice(0, 120))
"""
"""Cells of tables with a word or two in each of many lines."""
GLARING = """
[...document.querySelectorAll("article img")].filter((image) => /\\.png$|^data:/.test(image.src)
  && matchMedia("(prefers-color-scheme: dark)").matches !== getComputedStyle(image).filter.includes("invert"))
  .map((image) => "does not suit the colours of the page: " + image.src.slice(-60))
"""
"""Figures on white paper in a dark page, or on black in a light one; drawings choose their own colours."""


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


def faults(browser: Browser, file: Path, width: int, scheme: str) -> list[tuple[str, object]]:
    """What a page says to the console, whom it asks, what does not fit or suit, and whom axe-core finds kept out."""
    with browser.page(file.as_uri(), width, 900, scheme) as page:
        wide = page.evaluate("document.documentElement.scrollWidth - window.innerWidth")
        tall = page.evaluate("document.documentElement.scrollHeight")
        sizes = [f"{wide} pixels too wide"] * (wide > 0)
        sizes += [f"{tall} pixels long"] * (width >= 1440 and tall > LONGEST)
        broken = page.evaluate("[...document.images].filter((i) => !i.naturalWidth).map((i) => 'no picture: ' + i.src)")
        shown = [fault for question in (CUT_OFF, SQUEEZED, GLARING) for fault in page.evaluate(question)]
        outside = [url for url in page.requests() if not url.startswith(("file:", "data:"))]
        found = [*page.errors(), *outside, *sizes, *broken, *shown, *_kept_out(page)]
    return [(f"{file.name}, {width} pixels, {scheme}", fault) for fault in found]


def _kept_out(page: Page) -> list[str]:
    """What axe-core finds in a page that keeps somebody out."""
    page.evaluate(AXE.read_text(encoding="utf-8") + "; 0")
    found = page.evaluate(
        "axe.run(document, {resultTypes: ['violations']})"
        ".then(r => r.violations.map(v => [v.impact, v.id, v.nodes[0].html.slice(0, 160)].join(' | ')))"
    )
    return [fault for fault in found if fault.startswith(("serious", "critical"))]


@pytest.mark.parametrize(("width", "scheme"), SIZES)
def test_main_pages_are_in_order(browser: Browser, site: Path, width: int, scheme: str) -> None:
    assert [fault for name in MAIN for fault in faults(browser, site / f"{name}.html", width, scheme)] == []


@pytest.mark.parametrize(("width", "scheme"), SIZES)
def test_every_page_is_in_order(browser: Browser, site: Path, width: int, scheme: str) -> None:
    assert [fault for file in _pages(site) for fault in faults(browser, file, width, scheme)] == []


def test_drawings_follow_the_button_for_the_colours(browser: Browser, site: Path, tmp_path: Path) -> None:
    """The button of the theme changes the page alone, not what the system prefers."""
    dark = []
    with browser.page((site / "models.html").as_uri(), 1440, 900, "light") as page:
        for theme in ("light", "dark"):
            page.evaluate(f"document.body.dataset.theme = '{theme}'")
            page.evaluate("document.querySelector('article img').scrollIntoView()")
            page.screenshot(tmp_path / "window.png")
            box = page.box("article img")
            left, top = int(box["left"]) + 10, int(box["top"]) + 10
            dark.append(plt.imread(tmp_path / "window.png")[top, left, :3].mean() < 0.5)
    assert dark == [False, True]
