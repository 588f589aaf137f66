"""The report of an identification: one self-contained HTML file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from dovetail.assembly import Assembly
from dovetail.errors import is_decisive
from dovetail.identification import Identification, Posterior
from dovetail.identification.truth import TrueValues
from dovetail.interfaces import Parameter
from dovetail.plain_text import DisplayUnit, display_unit, fixed, number
from dovetail.report import content
from dovetail.report.drawing import assembly_figure, drawing_text, mode_shapes
from dovetail.report.pages import as_data, chart_data, residual_over_noise, write_page
from dovetail.report.svg import page_figure

_MOST_SHAPES = 10
"""Lowest modes whose shapes are drawn."""
_MOST_LINES, _ALL_LINES, _FEWEST_LINES = 3000, 6000, 300
"""Largest number of lines of an FRF in a chart, including peaks and dips, those of all charts, from which a page
becomes slow to load, and the smallest number in a chart of many."""

_MOST_TRADING, _SAMPLES, _SIZE, _GAP, _MARGIN, _NAMES = 6, 150, 96, 10, 48, 110
"""Parameters and samples in the pair plot; pixels of a panel, between panels, and for numbers and names."""
_LEAST_CORRELATION = 0.3
"""Correlation from which two parameters are shown in the pair plot."""


_LABELS = {
    "measurement": "Measurement",
    "measured_quantity": "Quantity measured",
    "assembly": "Assembly",
    "description_sha256": "Description, SHA-256",
    "training_samples": "Training samples",
}
_ELSEWHERE = ("description", "evaluation")
"""Entries of the provenance that have separate sections in the report."""


@dataclass(frozen=True)
class EvaluationRow:
    """Accuracy of the network for one parameter on the test part."""

    name: str
    r2: str
    mae: str
    unit: str
    mae_of_range: str


def write_report(
    result: Identification,
    path: str | Path,
    *,
    truth: TrueValues | None = None,
    assembly: Assembly | None = None,
    command: str = "",
) -> Path:
    """Write an identification as one self-contained HTML file, which loads nothing.

    Parameters
    ----------
    result : Identification
        If its ``provenance`` contains ``evaluation`` (`Evaluation.to_dict`) and ``description`` (the description's
        text), the report shows them in separate sections; all other entries are listed.
    path : str or Path
        An existing file is replaced; the file is written atomically.
    truth : TrueValues, optional
        Shown next to the identified values, with the errors.
    assembly : Assembly, optional
        The identified assembly, which is then drawn.
    command : str, optional
        The command line that computed it, shown below the same in Python.

    Returns
    -------
    Path

    Raises
    ------
    DovetailError
        The file cannot be written.
    """
    context = _context(result, truth, command) | {"drawing": None, "shapes": None}
    if assembly is not None:
        context["drawing"] = _drawing(assembly)
        context["shapes"] = _shapes(result, assembly)
    return write_page(path, "report.html.jinja", context)


@lru_cache(maxsize=1)
def _drawing(assembly: Assembly) -> Any:
    """Return the drawing of an assembly, which is that of all reports of a batch."""
    return page_figure(assembly_figure(assembly), "assembly", drawing_text(assembly))


def _context(result: Identification, truth: TrueValues | None, command: str) -> dict[str, Any]:
    axes = [response.frf.frequency for response in result.responses]
    rows = content.parameter_rows(result, truth)
    low, high = min((axis[0] for axis in axes), default=0.0), max((axis[-1] for axis in axes), default=0.0)
    evaluation = result.provenance.get("evaluation")
    mark, verdict = content.verdict_on(result)
    warnings = content.warnings_of(result, truth)
    return {
        "assembly": str(result.provenance.get("assembly", result.measured.label)),
        "measurement": _measurements(result),
        "measurements": len(result.responses),
        "method": result.method,
        "quantity": "modal parameters" if result.frf is None else result.frf.quantity,
        "has_phase": all(response.measured.has_phase for response in result.responses[:1]),
        "band": f"{number(low, 5, padded=False)} to {number(high, 5, padded=False)} Hz",
        "lines": " + ".join(str(size) for size in dict.fromkeys(axis.size for axis in axes)),
        "mean_coherence": _mean_coherence(result),
        "fit": "" if result.fit is None else content.fit_sentence(result.fit, has_lines=bool(axes)),
        "joints": list(dict.fromkeys(row.joint for row in result.table)),
        "is_trustworthy": result.is_trustworthy,
        "adequacy": content.adequacy_sentences(result),
        "decisive": [warning for warning in warnings if is_decisive(warning)],
        "warnings": [warning for warning in warnings if not is_decisive(warning)],
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
        "mark": mark,
        "verdict": verdict,
        "misfit": content.misfit_sentence(result),
        "pairs": _pair_plot(result),
        "again": _how_to_reproduce(result, command),
        "evaluation": evaluation_rows(result),
        "test_samples": evaluation.get("test_samples") if isinstance(evaluation, dict) else None,
        "provenance": provenance_rows(result.provenance),
        "description": _pretty(result.provenance.get("description")),
    }


def _measurements(result: Identification) -> str:
    first = str(result.provenance.get("measurement", result.measured.label))
    return ", ".join(dict.fromkeys([first, *(response.measured.label for response in result.further)]))


def _mean_coherence(result: Identification) -> str:
    if not result.further:
        return f"{result.mean_coherence:.3f}"
    return ", ".join(f"{at_point.mean_coherence:.3f} ({at_point.point})" for at_point in result.responses)


def _figures(result: Identification) -> list[tuple[str, str, Any, bool]]:
    """Return for each response the chart's name, the point (empty for a single one), data, and if there is a phase."""
    natural = [mode.natural_frequency for mode in result.modes]
    most = max(_FEWEST_LINES, min(_MOST_LINES, _ALL_LINES // max(1, len(result.responses))))
    figures = []
    for index, response in enumerate(result.responses):
        bands = () if result.is_trustworthy else response.poor_bands
        both = {"measured": ("measured", response.measured), "model": ("reconstructed", response.frf)}
        title = f"Measured and reconstructed FRF and their residual, {response.point or 'the response'}"
        residual = residual_over_noise(response.measured, response.frf.values)
        content = chart_data(title, both, residual=residual, natural=natural, bands=bands, most=most)
        point = response.point if result.further else ""
        figures.append((f"chart-{index + 1}", point, as_data(content), response.measured.has_phase))
    return figures


def _pair_plot(result: Identification) -> dict[str, Any] | None:
    """Return panels with samples of pairs of the most correlated parameters, as plain numbers.

    None without samples or correlated parameters, and for a result that is not trustworthy.
    """
    posterior = result.posterior
    if posterior is None or not result.is_trustworthy or not (chosen := _correlated_parameters(posterior)):
        return None
    definitions = [parameter.definition for parameter in result.parameters.values()]
    parameters = [definitions[column] for column in chosen]
    theta = posterior.sample(_SAMPLES)[:, chosen]
    drawn = np.stack([each.to_unit(theta[:, place]) for place, each in enumerate(parameters)], axis=1)
    panels, step, last = [], _SIZE + _GAP, len(chosen) - 1
    for row in range(1, len(chosen)):
        for column in range(row):
            x, y = _MARGIN + column * step, (row - 1) * step
            dots = zip(x + _SIZE * drawn[:, column], y + _SIZE * (1.0 - drawn[:, row]), strict=True)
            path = "".join(f"M{across:.1f} {down:.1f}h0" for across, down in dots)
            value = posterior.correlation[chosen[row], chosen[column]]
            panels.append({"x": x, "y": y, "path": path, "correlation": fixed(float(value), 2, signed=True)})
    labels, ticks, floor = [], [], last * step - _GAP
    for place, parameter in enumerate(parameters):
        shown = display_unit(parameter.unit, parameter.lower, parameter.upper)
        text = f"{parameter.name} [{shown.text}]" if shown.text else parameter.name
        at = _MARGIN + place * step
        if place:
            labels.append({"x": at - _GAP + 6, "y": (place - 1) * step + 12, "anchor": "start", "text": text})
            ticks += _ticks(parameter, shown, at=(place - 1) * step, upright=True)
        if place < last:
            labels.append({"x": at, "y": floor + 30, "anchor": "start", "text": text})
            ticks += _ticks(parameter, shown, at=at, upright=False, floor=floor)
    size = {"width": _MARGIN + last * step + _NAMES, "height": floor + 36, "size": _SIZE}
    words = f"Samples of {', '.join(parameter.name for parameter in parameters)}, two a panel"
    return {**size, "panels": panels, "labels": labels, "ticks": ticks, "words": words}


def _ticks(parameter: Parameter, shown: DisplayUnit, *, at: int, upright: bool, floor: int = 0) -> list[dict[str, Any]]:
    """Return ticks at the ends and in the middle of a parameter's range, left of a panel or below it."""
    ticks = []
    for part, anchor in ((0.0, "start"), (0.5, "middle"), (1.0, "end")):
        text = number(float(parameter.from_unit(np.array(part))) * shown.factor, 2, padded=False)
        if upright:
            y = at + _SIZE * (1.0 - part)
            tick = {"path": f"M{_MARGIN} {y:g}h-4", "x": _MARGIN - 6, "y": y + 8 * part, "anchor": "end"}
        else:
            x = at + _SIZE * part
            tick = {"path": f"M{x:g} {floor}v4", "x": x, "y": floor + 15, "anchor": anchor}
        ticks.append({**tick, "text": text})
    return ticks


def _correlated_parameters(posterior: Posterior) -> list[int]:
    """Return the numbers of the most correlated parameters, in order; none if the correlations are small."""
    correlation = np.abs(np.nan_to_num(posterior.correlation)) - np.eye(len(posterior.names))
    largest = correlation.max(axis=1)
    strongest = np.argsort(-largest, kind="stable")[:_MOST_TRADING]
    return sorted(strongest[largest[strongest] >= _LEAST_CORRELATION].tolist())


def evaluation_rows(result: Identification) -> list[EvaluationRow]:
    """Return the network's accuracy on the test part, if the provenance contains it."""
    evaluation = result.provenance.get("evaluation")
    evaluated = evaluation.get("parameters", {}) if isinstance(evaluation, Mapping) else {}
    rows = []
    for name, metrics in evaluated.items():
        unit, factor = str(metrics["unit"]), 1.0
        if name in result.parameters:
            parameter = result.parameters[name]
            shown = display_unit(parameter.unit, parameter.lower, parameter.upper)
            unit, factor = shown.text, shown.factor
        rows.append(
            EvaluationRow(
                name=name,
                r2=fixed(metrics["r2"], 2),
                mae=number(metrics["mae_si"] * factor, 3),
                unit=unit,
                mae_of_range=fixed(100.0 * metrics["mae"], 1),
            )
        )
    return rows


def _how_to_reproduce(result: Identification, command: str) -> str:
    """Return Python code and the command that reproduce a result; empty if the program did not compute it."""
    origin, options = result.provenance, ""
    if result.method not in ("refined", "multistart", "posterior") or "description" not in origin:
        return ""
    chosen = {name: value for name, value in dict(origin.get("options", {})).items() if name != "seed"}
    options += "".join(f", {name}={value!r}" for name, value in chosen.items())
    if "start" in origin:
        options += f", start={dict(origin['start'])!r}"
    labels = [str(response.measured.label) for response in result.responses] or [str(result.measured.label)]
    measured = labels if result.responses else labels[0]
    known = "".join(f"# held: {name} = {value:.9g}\n" for name, value in dict(origin.get("locked", {})).items())
    files = list(dict.fromkeys(labels))
    if len(files) < len(labels):
        known += "# read the FRF of each response from its file: dovetail.read_frf(file, index=1), and so on\n"
    lines = [
        "import dovetail",
        'assembly = dovetail.load("assembly.yaml")',
        f'result = dovetail.identify(assembly, {measured!r}, "{result.method}"{options}, seed={origin.get("seed", 0)})',
        'dovetail.write_report(result, "report.html", assembly=assembly)',
    ]
    return known + "\n".join(lines) + (f"\n\n# or, on the command line:\n# {command}" if command else "")


def _shapes(result: Identification, assembly: Assembly) -> Any:
    """Return the shapes of the listed modes as data of the page, or None if there are none."""
    if [parameter.name for parameter in assembly.parameters] != list(result.parameters):
        return None
    listed = [mode.natural_frequency for mode in result.modes]
    computed = mode_shapes(assembly, result.theta, _MOST_SHAPES)
    shapes = [mode for mode in computed if np.isclose(mode["frequency"], listed, rtol=1e-4).any()]
    return as_data(shapes) if shapes else None


def _pretty(description: object) -> str | None:
    """Return a description's text, indented if it is JSON."""
    if not isinstance(description, str):
        return None
    try:
        return json.dumps(json.loads(description), indent=2, ensure_ascii=False)
    except (ValueError, RecursionError):
        return description


def provenance_rows(provenance: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return labels and lines of all entries of the provenance that no other section shows."""
    rows = []
    for key, value in provenance.items():
        if key in _ELSEWHERE or value is None:
            continue
        rows.append((_LABELS.get(key, key.replace("_", " ").capitalize()), _lines(value)))
    return rows


def _lines(value: object) -> list[str]:
    if isinstance(value, Mapping):
        return [f"{name}: {entry}" for name, entry in value.items()]
    if isinstance(value, Sequence) and not isinstance(value, str):
        return [str(entry) for entry in value]
    return [str(value)]
