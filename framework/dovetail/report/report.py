"""The report of an identification: one HTML file that needs nothing else."""

from __future__ import annotations

import json
import shlex
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dovetail.assembly import Assembly
from dovetail.atomic_files import write_whole
from dovetail.errors import DovetailError, Fault
from dovetail.identification import Identification
from dovetail.plain_text import terminal_text
from dovetail.report import content
from dovetail.report.charts import as_data, chart_data, chart_scripts
from dovetail.report.drawing import assembly_figure, drawing_text, mode_shapes
from dovetail.report.pair_plot import pair_plot
from dovetail.report.svg import inline_svg
from dovetail.report.truth import Truth
from dovetail.report.wording import number
from dovetail.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["environment", "write_report"]

_MOST_SHAPES = 10
_MOST_LINES = 3000
"""Of an FRF, which a screen can show; peaks and dips are among them."""


def write_report(
    result: Identification, path: str | Path, *, truth: Truth | None = None, assembly: Assembly | None = None
) -> Path:
    """Write an identification as one self-contained HTML file, with its own scripts and nothing loaded from anywhere.

    Parameters
    ----------
    result : Identification
        If its ``provenance`` holds ``evaluation`` (`Evaluation.to_dict`) and ``description`` (the description's
        text), the report shows them in sections of their own; all else it lists as it is.
    path : str or Path
        A file that is there is replaced; it is written whole or not at all.
    truth : Truth, optional
        Shown beside what was identified, with the errors.
    assembly : Assembly, optional
        Of which the parameters were identified; it is drawn.

    Returns
    -------
    Path

    Raises
    ------
    DovetailError
        The file cannot be written, or the result is one from modal parameters.
    """
    if not isinstance(result, Identification):
        problem = "a result from modal parameters has no FRF, and no report."
        raise DovetailError(Fault(type(result).__name__, problem, remedy="Show its 'table' and its 'modes'."))
    drawing = None if assembly is None else _drawing(assembly)
    page = (
        environment()
        .get_template("report.html.jinja")
        .render(
            _context(result, truth), drawing=drawing, shapes=None if assembly is None else _shapes(result, assembly)
        )
    )
    write_whole(Path(path), page.encode("utf-8", errors="replace"), overwrite=True)
    return Path(path)


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


def _context(result: Identification, truth: Truth | None) -> dict[str, Any]:
    axes = [response.frf.frequency for response in result.responses]
    rows = content.parameter_rows(result, truth)
    low, high = min(axis[0] for axis in axes), max(axis[-1] for axis in axes)
    evaluation = result.provenance.get("evaluation")
    mark, verdict = content.verdict(result)
    return {
        "assembly": str(result.provenance.get("assembly", result.frf.label)),
        "measurement": _measurements(result),
        "measurements": len(result.responses),
        "method": result.method,
        "quantity": result.frf.quantity,
        "has_phase": result.measured.has_phase,
        "band": f"{number(low, 5, padded=False)} to {number(high, 5, padded=False)} Hz",
        "lines": " + ".join(str(size) for size in dict.fromkeys(axis.size for axis in axes)),
        "mean_coherence": _mean_coherence(result),
        "fit": "" if result.fit is None else content.fit_sentence(result.fit),
        "joints": list(dict.fromkeys(row.joint for row in result.table)),
        "believable": result.believable,
        "adequacy": content.adequacy_sentences(result),
        "warnings": content.warnings_of(result, truth),
        "truth": truth,
        "posterior_sentence": "" if result.posterior is None else content.posterior_sentence(result.posterior),
        "parameters": rows,
        "has_intervals": result.posterior is not None,
        "has_network": result.network is not None,
        "columns_sentence": content.columns_sentence(result),
        "truth_sentence": content.truth_sentence(rows),
        "known": content.known_rows(result),
        "modes": content.mode_rows(result, truth),
        "figures": _figures(result),
        **chart_scripts(),
        "mark": mark,
        "verdict": verdict,
        "misfit": content.misfit_sentence(result),
        "pairs": pair_plot(result),
        "again": _again(result),
        "evaluation": content.evaluation_rows(result),
        "test_samples": evaluation.get("test_samples") if isinstance(evaluation, dict) else None,
        "provenance": content.provenance_rows(result.provenance),
        "description": _pretty(result.provenance.get("description")),
        "version": __version__,
        "written": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
    }


def _measurements(result: Identification) -> str:
    first = str(result.provenance.get("measurement", result.measured.label))
    return ", ".join(dict.fromkeys([first, *(response.measured.label for response in result.further)]))


def _mean_coherence(result: Identification) -> str:
    if not result.further:
        return f"{result.mean_coherence:.3f}"
    return ", ".join(f"{at_point.mean_coherence:.3f} ({at_point.point})" for at_point in result.responses)


def _figures(result: Identification) -> list[tuple[str, str, Any, bool]]:
    """Return of each response the name of its chart, its point (empty if there is one only), its data and its phase."""
    natural = [mode.natural_frequency for mode in result.modes]
    bands = result.adequacy.bands if result.adequacy is not None and not result.believable else ()
    figures = []
    for index, response in enumerate(result.responses):
        both = {"measured": ("measured", response.measured), "model": ("reconstructed", response.frf)}
        title = f"Measured and reconstructed FRF and their agreement, {response.point or 'the response'}"
        content = chart_data(title, both, coherence=response.coherence, natural=natural, bands=bands, most=_MOST_LINES)
        point = response.point if result.further else ""
        figures.append((f"chart-{index + 1}", point, as_data(content), response.measured.has_phase))
    return figures


def _again(result: Identification) -> str:
    """Return the lines of Python that make a result again, and the command; empty where the program did not make it."""
    origin, options = result.provenance, ""
    if result.method not in ("refined", "multistart", "posterior") or "description" not in origin:
        return ""
    if origin.get("posterior_form") == "laplace":
        options += ', form="laplace"'
    if "start" in origin:
        options += f", start={dict(origin['start'])!r}"
    labels = [str(response.measured.label) for response in result.responses]
    known = "".join(f"# held: {name} = {value:.9g}\n" for name, value in dict(origin.get("locked", {})).items())
    files = list(dict.fromkeys(labels))
    if len(files) < len(labels):
        known += "# read the FRF of each response from its file: dovetail.read_frf(file, index=1), and so on\n"
    lines = [
        "import dovetail",
        'assembly = dovetail.load("assembly.yaml")',
        f'result = dovetail.identify(assembly, {labels!r}, "{result.method}"{options}, seed={origin.get("seed", 0)})',
        'dovetail.write_report(result, "report.html", assembly=assembly)',
    ]
    command = f"dovetail identify assembly.yaml {shlex.join(files)} --method {result.method} -o results/"
    return known + "\n".join(lines) + ("" if "start" in origin else f"\n\n# or, on the command line:\n# {command}")


def _drawing(assembly: Assembly) -> Any:
    """Return the drawing of an assembly as markup, its text for those who cannot see it."""
    from markupsafe import Markup

    return Markup(inline_svg(assembly_figure(assembly), "assembly", drawing_text(assembly), themed=True))


def _shapes(result: Identification, assembly: Assembly) -> Any:
    """Return the shapes of the modes that are listed, as data of the page; None without any."""
    if [parameter.name for parameter in assembly.parameters] != list(result.parameters):
        return None
    listed = [mode.natural_frequency for mode in result.modes]
    computed = mode_shapes(assembly, result.theta, _MOST_SHAPES)
    shapes = [mode for mode in computed if np.isclose(mode["frequency"], listed, rtol=1e-4).any()]
    return as_data(shapes) if shapes else None


def _pretty(description: object) -> str | None:
    """Return a description's text, laid out for reading if it is JSON on one line."""
    if not isinstance(description, str):
        return None
    try:
        return json.dumps(json.loads(description), indent=2, ensure_ascii=False)
    except (ValueError, RecursionError):
        return description
