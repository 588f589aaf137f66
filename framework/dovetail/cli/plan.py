"""``dovetail plan``: where to measure, or which test of a series to make next."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from dovetail.cli.commands import exit_unless_trustworthy
from dovetail.cli.options import AsJson, PluginFiles, load_assembly, part
from dovetail.cli.terminal import heading, print_json, progress_bars, say, table, title
from dovetail.errors import Fault, ParameterError

if TYPE_CHECKING:
    from dovetail import Assembly
    from dovetail.design import MeasurementPlan, PlannedPoint, SeriesPlan

_SHOWN = 8
"""Points of a ranking that are printed, besides the described one."""
_INTERVAL = 3.29
"""Width of a 90 % interval over the standard deviation."""


def plan(
    assembly: Annotated[
        Path,
        typer.Argument(metavar="ASSEMBLY", help="Description of the assembly, or of a series of tests (YAML)."),
    ],
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="SUBSTRUCTURE", help="Substructure whose nodes are considered. May be repeated."),
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(
            metavar="FRACTION",
            parser=part,
            help="Noise of every line relative to the standard deviation of the described FRF; by default 0.01, or "
            "that of the series' first test.",
            show_default=False,
        ),
    ] = None,
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

    Of a series, rank the tests that it lists under 'candidates', or else its own, by how much they would narrow the
    interval of each unknown. The series is identified first.
    """
    import dovetail
    from dovetail.series.series_file import is_series

    if is_series(assembly):
        _plan_series(assembly, at, noise, plugin, with_described=with_described, as_json=as_json)
        return
    loaded, size = load_assembly(assembly, plugin), 0.01 if noise is None else noise
    with progress_bars() as progress:
        ranking = dovetail.plan_measurements(
            loaded, at or (), noise=size, with_described=with_described, progress=progress
        )
    if as_json:
        print_json(ranking.to_dict())
        return
    _print_ranking(loaded, ranking, size)
    if ranking.responses:
        _print_pair(ranking, assembly)


def _print_ranking(assembly: Assembly, ranking: MeasurementPlan, noise: float) -> None:
    """Print the best points and the described ones, and the best second points."""
    names = [parameter.name for parameter in assembly.parameters]
    headers = ["point", "position [mm]", "mean", *names, "modes not seen [Hz]"]
    title(f"{assembly.name}: part of the prior variance that one FRF takes away, noise {noise:g}")
    substructures = assembly.description.substructures
    nodes = [(r.substructure, substructures[r.substructure].nodes[r.node]) for r in assembly.description.responses]
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


def _plan_series(
    path: Path,
    at: list[str] | None,
    noise: float | None,
    plugin: list[Path] | None,
    *,
    with_described: bool,
    as_json: bool,
) -> None:
    """Identify a series, and print by how much each candidate would narrow its intervals."""
    import dovetail

    if at or with_described:
        problem = "this is a series, whose next test is planned, not the points of an assembly."
        remedy = "Leave out --at and --with-described, and list tests under 'candidates' in the series."
        raise ParameterError(Fault(str(path), problem, remedy=remedy))
    with progress_bars() as progress:
        result = dovetail.identify_series(path, plugins=plugin or (), progress=progress)
        planned = dovetail.plan_next_test(result, noise=noise, progress=progress)
    if as_json:
        print_json(planned.to_dict())
    else:
        _print_series(planned)
    exit_unless_trustworthy(result)


def _print_series(planned: SeriesPlan) -> None:
    title(f"{planned.name}: width of each interval with one more test, of that without it; noise {planned.noise:.2g}")
    headers = ["unknown", "width now, of the range", *(test.name for test in planned.tests)]
    rows = [
        [name, f"{100.0 * _INTERVAL * known:.2g} %", *(f"{test.narrowing[name]:.2f}" for test in planned.tests)]
        for name, known in planned.known.items()
    ]
    rows.append(["all, geometric mean", "", *(f"{test.mean_narrowing:.2f}" for test in planned.tests)])
    table(headers, rows, numbers=headers[1:])
    say()
    say(f"The next test that reveals most is '{planned.tests[0].name}'. 1.00: the test adds nothing.")


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
