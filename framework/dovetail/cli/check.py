"""``dovetail check``: the contents of a description, before any work is done with it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.cli.natural_frequencies import say_natural_frequencies
from dovetail.cli.options import AsJson, AssemblyFile, Overwrite, PluginFiles
from dovetail.cli.output_files import check_new_files
from dovetail.cli.terminal import heading, note, print_json, range_text, say, table, title
from dovetail.errors import listing

if TYPE_CHECKING:
    from dovetail.assembly import Assembly


def check(
    assembly: AssemblyFile,
    output: Annotated[
        list[Path] | None,
        typer.Option("--output", "-o", metavar="FILE", help="Drawing: .png, .svg or .html. May be repeated."),
    ] = None,
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
    as_json: AsJson = False,
) -> None:
    """Check a description and show its DOFs, nodes and modes.

    Prints the degrees of freedom, the nodes, the parameters with their ranges, and the natural frequencies in the
    middle of the ranges. All faults of a description are reported at once. A drawing shows the parts to scale with
    nodes, joints, force and response.
    """
    import dovetail
    from dovetail.assembly.summary import assembly_summary
    from dovetail.load_observers import unobserved

    if output:
        from dovetail.report.svg import FIGURE_SUFFIXES

        check_new_files(output, FIGURE_SUFFIXES, overwrite)
    with unobserved():  # its warnings are part of the summary
        loaded = dovetail.load(assembly, plugins=plugin or ())
    summary = assembly_summary(loaded)
    if as_json:
        print_json(summary)
    else:
        _print(loaded, summary)
    if output:
        from dovetail.report.drawing import drawing_text
        from dovetail.report.frf_files import write_figure

        write_figure(dovetail.plot_assembly(loaded), output, drawing_text(loaded), overwrite=overwrite)
        for file in output:
            note(f"Written: {file}")


_NORMAL = {"linear": "normal", "log": "log-normal"}
"""Words for a normal prior, shown instead of the scale."""


def _print(assembly: Assembly, summary: dict[str, Any]) -> None:
    from dovetail.description.placed_parts import direction_text
    from dovetail.units import format_quantity

    title(f"{summary['name']}  ({summary['source']})")
    frequency = summary["frequency"]
    for index, response in enumerate((summary["response"], *summary["further_responses"])):
        ends_of = [response, *([response["force"]] if "force" in response else [])]
        ends = [f"{p['point']}, direction {direction_text(p['direction'])}" for p in ends_of]
        say(f"{'' if index else 'Response':9}  {response['quantity']} at {'; force at '.join(ends)}")
    say(f"Frequency  {frequency['first']:g} to {frequency['last']:g} Hz, {frequency['lines']} lines")
    _print_dofs(summary)
    heading("Nodes")
    table(
        ["substructure", "positions [mm]"], [(_oriented(part), _positions(part)) for part in summary["substructures"]]
    )
    heading("Parameters to identify")
    scales = [p.scale if p.prior == "uniform" else _NORMAL[p.scale] for p in assembly.parameters]
    rows = [(p.name, range_text(p), scale, p.description) for p, scale in zip(assembly.parameters, scales, strict=True)]
    if rows:
        table(["parameter", "range", "scale", "description"], rows)
    else:
        say("none: every parameter is fixed" if summary["fixed"] else "none: the joints have no parameters")
    if summary["fixed"]:
        heading("Parameters fixed")
        table(["parameter", "value"], [(p["name"], format_quantity(p["value"], p["unit"])) for p in summary["fixed"]])
    heading("Natural frequencies in the middle of the ranges")
    modes = summary["natural_frequencies"], summary["damping_ratios"]
    say_natural_frequencies(*modes, summary["without_natural_frequencies"])
    if summary["omissions"]:
        heading("What the model leaves out")
        for omission in summary["omissions"]:
            say(omission)
    if summary["warnings"]:
        heading("What looks wrong")
        for warning in summary["warnings"]:
            say(warning)


def _print_dofs(summary: dict[str, Any]) -> None:
    heading("Degrees of freedom")
    rows = [
        (f"substructure {part['name']}", part["model"], "held" if part["held"] else str(part["dofs"]))
        for part in summary["substructures"]
    ]
    rows += [
        (f"joint {joint['name']}, internal", joint["model"], str(joint["internal_dofs"])) for joint in summary["joints"]
    ]
    rows.append(("assembly, merged DOFs counted once", "", str(summary["dofs"]["assembly"])))
    rows.append(("condensed system of the engine", "", str(summary["dofs"]["condensed"])))
    table(["part", "model", "DOFs"], rows, numbers=["DOFs"])


def _oriented(part: dict[str, Any]) -> str:
    return f"{part['name']}, reversed" if part["reversed"] else str(part["name"])


def _positions(part: dict[str, Any]) -> str:
    """Write positions [mm], evenly spaced ones as ``first to last by step``; labels if positions repeat."""
    positions = [node["position"] * 1e3 for node in part["nodes"]]
    if len(set(positions)) < len(positions):
        return f"by label: {listing(node['label'] for node in part['nodes'])}"
    runs: list[list[float]] = []
    for position in positions:
        run = runs[-1] if runs else []
        if not runs or (len(run) > 1 and abs((position - run[-1]) - (run[1] - run[0])) > 1e-6):
            runs.append([position])
        else:
            run.append(position)
    return ", ".join(_run(run) for run in runs)


def _run(run: list[float]) -> str:
    if len(run) < 4:
        return ", ".join(f"{position:.5g}" for position in run)
    return f"{run[0]:.5g} to {run[-1]:.5g} by {run[1] - run[0]:.5g}"
