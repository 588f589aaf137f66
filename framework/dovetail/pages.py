"""What HTML pages, figures and tables of packages are made of."""

from __future__ import annotations

from dovetail.plain_text import ABSENT, display_unit, fixed, hertz, markdown_cell, markdown_table, number, terminal_text
from dovetail.report.figures import (
    DASHES,
    INK,
    LINES,
    MARKERS,
    MEASURED,
    RECONSTRUCTED,
    draw_amplitude,
    new_figure,
    panel_grid,
    png_bytes,
    save_png,
    set_title,
    style_axes,
)
from dovetail.report.pages import as_data, chart_data, write_page
from dovetail.report.svg import page_figure
from dovetail.report.tables import Column, Table
from dovetail.units import format_quantity

__all__ = [
    "ABSENT",
    "DASHES",
    "INK",
    "LINES",
    "MARKERS",
    "MEASURED",
    "RECONSTRUCTED",
    "Column",
    "Table",
    "as_data",
    "chart_data",
    "display_unit",
    "draw_amplitude",
    "fixed",
    "format_quantity",
    "hertz",
    "markdown_cell",
    "markdown_table",
    "new_figure",
    "number",
    "page_figure",
    "panel_grid",
    "png_bytes",
    "save_png",
    "set_title",
    "style_axes",
    "terminal_text",
    "write_page",
]
