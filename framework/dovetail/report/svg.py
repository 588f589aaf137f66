"""Figures as SVG inside an HTML page."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

from dovetail.plain_text import html_text
from dovetail.report.figures import AGREEMENT, GRID, INK, LINES, MEASURED, MUTED, OCHRE, RECONSTRUCTED, png_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURE_SUFFIXES = (".png", ".svg", ".html")

_REFERENCE = re.compile(r'(\bid="|url\(#|href="#)')
_PATH = re.compile(r'\bd="[^"]*"')
_DIGITS = re.compile(r"(\.\d\d)\d+")
_THEMED = {
    **{colour: f"var(--method-{number})" for number, colour in enumerate(LINES)},
    **{GRID: "var(--grid)", MUTED: "var(--muted)", OCHRE: "var(--ochre)", AGREEMENT: "var(--agreement)"},
    **{MEASURED: "var(--measured)", RECONSTRUCTED: "var(--model)"},
    **{INK: "currentColor", "#000000": "currentColor", "#ffffff": "none"},
}
"""Colours of figures, as `web/charts.css` has them for light and for dark pages."""


def inline_svg(figure: Figure, name: str, title: str, *, themed: bool = False) -> str:
    """Return a figure as an ``<svg>`` element.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    name : str
        Prefix of every id, so that a page can have several figures.
    title : str
        Text for screen readers.
    themed : bool
        Use the colours of the page, which may be dark, and no white background.

    Returns
    -------
    str
        With text as paths, coordinates to a hundredth of a point, no metadata and no external references.
    """
    import matplotlib

    buffer = io.StringIO()
    metadata = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    # These two can be set for the whole process only; without the salt every run would give other ids.
    with matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": "dovetail"}):
        figure.savefig(buffer, format="svg", metadata=metadata)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    start = re.match(r'<svg[^>]*?viewBox="([^"]*)"[^>]*>', text)
    assert start is not None
    text = f'<svg viewBox="{start[1]}" role="img" aria-label="{html_text(title)}">{text[start.end() :]}'
    text = text.replace("xlink:href", "href")
    text = _REFERENCE.sub(rf"\g<1>{name}-", text)
    if themed:  # what has no colour of its own is black, and would stay so
        text = text.replace("<svg ", '<svg fill="currentColor" ', 1)
        for colour, themed_colour in _THEMED.items():
            text = text.replace(colour, themed_colour)
    return _PATH.sub(lambda path: _DIGITS.sub(r"\1", path[0]), text)


def page_figure(figure: Figure, name: str, title: str) -> Any:
    """Return a figure in the colours of a page, as markup for its template; parameters as in `inline_svg`."""
    from markupsafe import Markup

    return Markup(inline_svg(figure, name, title, themed=True))


def figure_bytes(figure: Figure, suffix: str, title: str) -> bytes:
    """Return a figure as a file in the format of one of `FIGURE_SUFFIXES`; the HTML page contains SVG and no script."""
    title = title or figure.get_suptitle() or "FRF"
    if suffix == ".png":
        return png_bytes(figure, title)
    drawing = inline_svg(figure, "frf", title)
    if suffix == ".svg":
        return drawing.replace("<svg ", '<svg xmlns="http://www.w3.org/2000/svg" ', 1).encode()
    style = "body { margin: 1rem auto; max-width: 60rem }"
    head = f'<meta charset="utf-8"><title>{html_text(title)}</title><style>{style}</style>'
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>{drawing}</body></html>\n'.encode()
