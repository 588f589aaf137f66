"""``dovetail plan``: where to measure."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.options import AsJson, AssemblyFile, PluginFiles, load_assembly, part
from dovetail.cli.terminal import heading, print_json, progress_bars, say, table, title

if TYPE_CHECKING:
    from dovetail.design import MeasurementPlan, PlannedPoint

_SHOWN = 8


def plan(
    assembly: AssemblyFile,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="SUBSTRUCTURE", help="Substructure whose nodes are considered. May be repeated."),
    ] = None,
    noise: Annotated[
        float,
        typer.Option(
            metavar="PART",
            parser=part,
            help="Noise of every line relative to the standard deviation of the described FRF.",
        ),
    ] = 0.01,
    with_described: Annotated[
        bool,
        typer.Option(
            "--with-described", help="Rank second points given the described response instead of the best one."
        ),
    ] = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Rank measurement points by how much they would reveal.

    For each node: by how much an FRF there would reduce the uncertainty of each parameter, averaged over the ranges;
    the modes that have a node of vibration there; and what a second point would add to the best one.
    """
    import dovetail

    loaded = load_assembly(assembly, plugin)
    with progress_bars() as progress:
        ranking = dovetail.plan_measurements(
            loaded, at or (), noise=noise, with_described=with_described, progress=progress
        )
    if as_json:
        print_json(ranking.to_dict())
        return
    names = [parameter.name for parameter in loaded.parameters]
    headers = ["point", "position [mm]", "mean", *names, "modes not seen [Hz]"]
    title(f"{loaded.name}: part of the prior variance that one FRF takes away, noise {noise:g}")
    substructures = loaded.description.substructures
    nodes = [(r.substructure, substructures[r.substructure].nodes[r.node]) for r in loaded.description.responses]
    described = {(name, node.position, label) for name, node in nodes for label in ("", node.label)}
    rows = []
    for rank, point in enumerate(ranking.points):
        is_described = (point.substructure, point.position, point.label) in described
        if rank < _SHOWN or is_described:
            rows.append(_row(point, "  (as described)" if is_described else ""))
    table(headers, rows, numbers=headers[1:-1])
    first = ranking.points[ranking.first]
    if ranking.seconds:
        heading(f"Together with {first.substructure} at {first.place}")
        table(headers, [_row(point, "") for point in ranking.seconds[:_SHOWN]], numbers=headers[1:-1])
    say()
    say("1: the measurement determines it; 0: the measurement adds nothing to its range.")
    if ranking.responses:
        _print_pair(ranking, assembly)


def _print_pair(ranking: MeasurementPlan, assembly: Path) -> None:
    points = (ranking.points[ranking.first], ranking.seconds[0])
    heading(" and ".join(f"{point.substructure} at {point.place}" for point in points))
    table(
        ["parameter", "interval, of that from the first alone"],
        [(name, f"{share:.2f}") for name, share in ranking.narrowing.items()],
        numbers=["interval, of that from the first alone"],
    )
    say()
    say("To measure at both, write a description of these lines and give 'dovetail identify' one FRF for each:")
    say()
    say(f"dovetail: 1\nextends: {assembly.name}\n{ranking.responses}")


def _row(point: PlannedPoint, note: str) -> list[str]:
    hidden = ", ".join(f"{frequency:.0f}" for frequency in point.hidden)
    gains = [f"{gain:.2f}" for gain in point.gain.values()]
    return [f"{point.substructure}{note}", point.place.replace(" mm", ""), f"{point.mean_gain:.3f}", *gains, hidden]
