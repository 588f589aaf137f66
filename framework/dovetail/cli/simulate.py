"""``dovetail simulate``: the FRF of an assembly with chosen parameters."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.completion import complete_parameters
from dovetail.cli.natural_frequencies import say_natural_frequencies
from dovetail.cli.options import (
    AsJson,
    AssemblyFile,
    Overwrite,
    PluginFiles,
    PointNumber,
    at_point,
    part,
)
from dovetail.cli.output_files import FrfFiles, check_frf_files, check_new_files
from dovetail.cli.terminal import heading, note, print_json, quantity_text, range_text, table, title

if TYPE_CHECKING:
    from dovetail.assembly import Assembly

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Value of a parameter, such as Dc=30mm. May be repeated.",
        autocompletion=complete_parameters,
    ),
]


def simulate(
    assembly: AssemblyFile,
    settings: Settings = None,
    noise: Annotated[
        float,
        typer.Option(
            metavar="FRACTION",
            parser=part,
            show_default=False,
            help="Standard deviation of complex noise relative to that of the FRF, such as 1%.",
        ),
    ] = 0.0,
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Seed of the noise; 0 by default.")] = None,
    truth_output: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="JSON file for the values and natural frequencies, as 'identify --truth' reads it."
        ),
    ] = None,
    point: PointNumber = 1,
    output: FrfFiles = None,
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Compute the FRF for chosen parameters.

    Parameters that are not set are in the middle of their ranges. The suffix of a file determines its format. With
    noise, the file can be used as a measurement whose parameters are known.
    """
    import dovetail
    from dovetail.assembly.summary import natural_frequencies
    from dovetail.identification.response_points import with_points
    from dovetail.identification.truth import truth_text
    from dovetail.measurement import noisy_frf
    from dovetail.report.frf_files import write_frf_files

    if seed is not None and not noise:
        raise typer.BadParameter("no noise is drawn without '--noise', such as '--noise 1%'.", param_hint="--seed")
    files = output or []
    check_frf_files(files, overwrite, plugin)
    if truth_output is not None:
        check_new_files([truth_output], [".json"], overwrite, option="--truth-output")
    chosen = _settings(settings or [])
    loaded = at_point(dovetail.load(assembly, plugins=plugin or ()), point)
    theta = _theta(loaded, chosen)
    _note_missing_units(loaded, theta, chosen)
    frf = with_points(loaded.description, loaded.simulate(theta))
    if noise:
        frf = noisy_frf(frf, noise, seed or 0)
    natural, damping, reason = natural_frequencies(loaded, theta)
    texts = {} if truth_output is None else {truth_output: truth_text(loaded, theta, natural, noise)}
    write_frf_files(frf, files, natural, texts, overwrite=overwrite, plugins=plugin or ())
    if as_json:
        print_json(
            {"name": loaded.name, "parameters": theta, "natural_frequencies": natural, "damping_ratios": damping}
        )
    else:
        _print(loaded, theta)
        say_natural_frequencies(natural, damping, reason)
    for file in (*files, *texts):
        note(f"Written: {file}")


def _settings(texts: list[str]) -> dict[str, str]:
    chosen: dict[str, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise typer.BadParameter(f"'{text}' is not NAME=VALUE, such as Dc=30mm.", param_hint="--set")
        if name in chosen:
            raise typer.BadParameter(f"'{name}' is set twice.", param_hint="--set")
        chosen[name] = value
    return chosen


def _theta(assembly: Assembly, chosen: dict[str, str]) -> dict[str, float]:
    """Return SI values of all parameters by name: the chosen ones, and the middle of the range for others."""
    names = [parameter.name for parameter in assembly.parameters]
    return dict(zip(names, assembly.vector(chosen).tolist(), strict=True))


def _note_missing_units(assembly: Assembly, theta: dict[str, float], chosen: dict[str, str]) -> None:
    """Say what a number without a unit means where it is outside the range."""
    from dovetail.identification.parameters import is_in_range

    for p in assembly.parameters:
        text = chosen.get(p.name, "")
        if p.unit != "1" and text[-1:].isdigit() and not is_in_range(theta[p.name], p.lower, p.upper, p.scale):
            note(f"'{p.name}={text}' has no unit, so that it is {text} {p.unit}: outside the range {range_text(p)}.")


def _print(assembly: Assembly, theta: dict[str, float]) -> None:
    from dovetail.identification.parameters import is_in_range

    title(assembly.name)
    rows = []
    for p in assembly.parameters:
        remark = "" if is_in_range(theta[p.name], p.lower, p.upper, p.scale) else "outside the range"
        rows.append((p.name, quantity_text(theta[p.name], p), range_text(p), remark))
    if rows:
        table(["parameter", "value", "range", "note"], rows)
    heading("Natural frequencies")
