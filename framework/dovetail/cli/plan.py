"""``dovetail plan``: where to measure."""

from __future__ import annotations

from typing import Annotated

import typer

from dovetail.cli.options import AsJson, AssemblyFile, PluginFiles
from dovetail.cli.terminal import heading, print_json, progress_bars, say, table, title

__all__ = ["plan"]

_SHOWN = 8


def plan(
    assembly: AssemblyFile,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="SUBSTRUCTURE", help="Whose nodes may be struck. May be repeated."),
    ] = None,
    noise: Annotated[
        float, typer.Option(metavar="PART", help="Noise of every line over the described FRF's standard deviation.")
    ] = 0.01,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Rank points of measurement by what they tell.

    For each node: which part of what is unknown of each parameter the FRF at that point would take away, averaged
    over the ranges; modes with a node of vibration there; and what a second point beside the best one would add.
    """
    import dovetail
    from dovetail.evaluation import plan as run

    loaded = dovetail.load(assembly, plugins=plugin or ())
    with progress_bars() as progress:
        found = run(loaded, at or (), noise=noise, progress=progress)
    if as_json:
        print_json(found.to_dict())
        return
    names = [parameter.name for parameter in loaded.parameters]
    headers = ["point", "position [mm]", "mean", *names, "modes not seen [Hz]"]
    title(f"{loaded.name}: part of the prior variance that one FRF takes away, noise {noise:g}")
    shown = list(enumerate(found.points[:_SHOWN]))
    if found.current >= _SHOWN:
        shown.append((found.current, found.points[found.current]))
    rows = [_row(point, "  (as described)" if place == found.current else "") for place, point in shown]
    table(headers, rows, numbers=headers[1:-1])
    heading(f"Together with the first, {found.points[0].substructure} at {found.points[0].position * 1e3:g} mm")
    table(headers, [_row(point, "") for point in found.seconds[:_SHOWN]], numbers=headers[1:-1])
    say()
    say("1: the measurement tells all; 0: it tells nothing that the range does not say.")


def _row(point: object, note: str) -> list[str]:
    from dovetail.evaluation import PlannedPoint

    assert isinstance(point, PlannedPoint)
    hidden = ", ".join(f"{frequency:.0f}" for frequency in point.hidden)
    gains = [f"{gain:.2f}" for gain in point.gain.values()]
    return [f"{point.substructure}{note}", f"{point.position * 1e3:g}", f"{point.mean_gain:.3f}", *gains, hidden]
