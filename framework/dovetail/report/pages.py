"""Self-contained HTML pages from the templates: their own styles and scripts, nothing loaded from anywhere."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dovetail.atomic_files import write_whole
from dovetail.plain_text import terminal_text
from dovetail.report.charts import chart_scripts
from dovetail.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["environment", "write_page"]


def environment() -> Environment:
    """Return where the templates are, escaping whatever is set in them."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("dovetail.report", "templates"),
        autoescape=True,
        finalize=lambda value: terminal_text(value) if type(value) is str else value,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def write_page(path: str | Path, template: str, content: dict[str, Any], *, charts: bool = True) -> Path:
    """Write a page, whole or not at all; a file that is there is replaced.

    Parameters
    ----------
    path : str or Path
    template : str
        Which extends `page.html.jinja`.
    content : dict
        What the template asks for.
    charts : bool
        Whether interactive charts stand in it; without them the page has no script.

    Returns
    -------
    Path
    """
    written = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    around = chart_scripts(charts=charts) | {"version": __version__, "written": written}
    page = environment().get_template(template).render(content | around)
    write_whole(Path(path), page.encode("utf-8", errors="replace"), overwrite=True)
    return Path(path)
