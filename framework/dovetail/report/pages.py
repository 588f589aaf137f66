"""Self-contained HTML pages from the templates, which load nothing, and the data and scripts of their charts."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dovetail.atomic_files import write_whole
from dovetail.frf import Frf
from dovetail.plain_text import terminal_text, unit_text
from dovetail.problem.random_error import random_error_variance
from dovetail.report.figures import PHASE_CENTRE
from dovetail.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment

_WEB = Path(__file__).parent / "web"


@cache  # it keeps compiled templates: a batch writes the same page many times
def environment(*packages: str) -> Environment:
    """Return the environment of the templates, which escapes all inserted values; also with those of other packages."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=ChoiceLoader([PackageLoader(package, "templates") for package in ("dovetail.report", *packages)]),
        autoescape=True,
        finalize=lambda value: terminal_text(value) if type(value) is str else value,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def write_page(
    path: str | Path, template: str, content: dict[str, Any], *, charts: bool = True, package: str = "dovetail.report"
) -> Path:
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
    package : str
        The package whose folder ``templates`` has the template.

    Returns
    -------
    Path
    """
    written = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    around = chart_scripts(charts=charts) | {"version": __version__, "written": written}
    page = environment(package).get_template(template).render(content | around)
    write_whole(Path(path), page.encode("utf-8", errors="replace"), overwrite=True)
    return Path(path)


def chart_data(
    title: str,
    curves: Mapping[str, tuple[str, Frf]],
    *,
    coherence: Mapping[str, ArrayLike] | None = None,
    residual: ArrayLike | None = None,
    natural: Iterable[float] = (),
    bands: Iterable[tuple[float, float]] = (),
    most: int | None = None,
) -> dict[str, Any]:
    """Return the data for `DovetailCharts.FrfChart` as plain values.

    Parameters
    ----------
    title : str
        Text for screen readers.
    curves : mapping of str to (str, Frf)
        Label and FRF by role: "measured", "model", "before", or "method-0", "method-1" and so on; all of the same
        quantity and on the same lines.
    coherence : mapping of str to (n_freq,) array, optional
        Of the measured FRF and each of the others, by role.
    residual : (n_freq,) array, optional
        Of the role "model" in units of the noise (`residual_over_noise`).
    natural : iterable of float
        Natural frequencies [Hz], which are marked.
    bands : iterable of (float, float)
        Bands [Hz], which are shaded.
    most : int, optional
        Approximate number of lines that are kept, including peaks and dips.

    Returns
    -------
    dict
    """
    first = next(iter(curves.values()))[1]
    lines = np.arange(first.frequency.size)
    if most is not None:
        lines = thinned([frf.amplitude for _, frf in curves.values()], most)
    agreement = coherence or {}
    return {
        "title": terminal_text(title),
        "frequency": packed(first.frequency[lines]),
        "quantity": first.quantity.capitalize(),
        "unit": unit_text(first.unit),
        "centre": PHASE_CENTRE[first.quantity],
        "curves": [
            {"role": role, "label": terminal_text(label), **curve_data(frf.values[lines], phase=frf.has_phase)}
            | ({"coherence": packed(np.asarray(agreement[role])[lines])} if role in agreement else {})
            | ({} if residual is None or role != "model" else {"residual": packed(np.asarray(residual)[lines])})
            for role, (label, frf) in curves.items()
        ],
        "natural": [round(float(frequency), 2) for frequency in natural if np.isfinite(frequency)],
        "bands": [[float(low), float(high)] for low, high in bands],
    }


def curve_data(values: NDArray[np.complex128], *, phase: bool = True) -> dict[str, str | None]:
    """Return amplitude and phase [deg] of complex values, packed."""
    return {
        "amplitude": packed(np.abs(values)),
        "phase": packed(np.rad2deg(np.angle(values))) if phase else None,
    }


def residual_over_noise(measured: Frf, model: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the residual of each line (n_freq,) over the standard deviation of its random error.

    Its root mean square is 1 where a model is right. Without a phase, amplitudes are compared. The random error is that
    of the file, or is estimated from the scatter of neighbouring lines.
    """
    deviation = np.sqrt(random_error_variance(measured))
    if measured.has_phase:
        return np.asarray(np.abs(measured.values - model) / deviation)
    return np.asarray(np.sqrt(2.0) * np.abs(measured.amplitude - np.abs(model)) / deviation)


def packed(values: ArrayLike) -> str:
    """Encode numbers as base64 of little-endian 32-bit floats."""
    return base64.b64encode(np.asarray(values).astype("<f4").tobytes()).decode("ascii")


def thinned(amplitudes: Sequence[NDArray[np.float64]], most: int) -> NDArray[np.intp]:
    """Return the indices of the lines to draw: the highest and the lowest of each curve in each bin.

    Parameters
    ----------
    amplitudes : sequence of (n_freq,) arrays
    most : int
        Approximate number of lines that are kept.

    Returns
    -------
    (<= most,) array
        Increasing, including the first and the last line; all lines if there are no more than `most`.
    """
    count = amplitudes[0].size
    if count <= most:
        return np.arange(count)
    bins = np.array_split(np.arange(count), max(1, (most - 2) // (2 * len(amplitudes))))
    kept = {0, count - 1}
    for values in amplitudes:
        for lines in bins:
            kept |= {int(lines[np.argmin(values[lines])]), int(lines[np.argmax(values[lines])])}
    return np.array(sorted(kept), dtype=np.intp)


def as_data(content: object) -> Any:
    """Return plain values as JSON that is safe inside an element of a page."""
    from markupsafe import Markup

    return Markup(json.dumps(content, ensure_ascii=True, allow_nan=False).replace("<", "\\u003c"))


def chart_scripts(*, charts: bool) -> dict[str, Any]:
    """Return the scripts that draw the charts, their hashes for the page's content security policy, and the styles.

    Without charts there are no scripts, and only the styles that all pages share.
    """
    from markupsafe import Markup

    if not charts:
        return {"scripts": [], "hashes": Markup("'none'"), "chart_styles": Markup(web_text("charts.css"))}
    scripts = [web_text("vendor/uPlot.iife.min.js"), web_text("charts.js"), "DovetailCharts.drawAll();\n"]
    styles = web_text("vendor/uPlot.min.css") + "\n" + web_text("charts.css")
    hashes = Markup(" ".join(script_hash(script) for script in scripts))
    return {"scripts": [Markup(s) for s in scripts], "hashes": hashes, "chart_styles": Markup(styles)}


@cache
def web_text(name: str) -> str:
    """Return the text of a bundled script or style, such as ``"charts.js"``."""
    return (_WEB / name).read_text(encoding="utf-8")


def script_hash(script: str) -> str:
    """Return the hash of a script for a content security policy."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
