"""Self-contained HTML pages from the templates, with their styles and scripts; they load nothing."""

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
    """Return the environment of the templates, which escapes all inserted values."""
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
    """Write a page atomically; an existing file is replaced.

    Parameters
    ----------
    path : str or Path
    template : str
        A template that extends `page.html.jinja`.
    content : dict
        Variables of the template.
    charts : bool
        Whether it has interactive charts; without them the page has no scripts.

    Returns
    -------
    Path
    """
    written = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    around = chart_scripts(charts=charts) | {"version": __version__, "written": written}
    page = environment().get_template(template).render(content | around)
    write_whole(Path(path), page.encode("utf-8", errors="replace"), overwrite=True)
    return Path(path)
