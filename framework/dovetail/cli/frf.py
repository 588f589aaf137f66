"""``dovetail frf``: the FRF from the time records of an impact test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import typer

from dovetail.cli.bundles import bundled
from dovetail.cli.options import Overwrite, PluginFiles, one_of, quantity_in
from dovetail.cli.output_files import RequiredFrfFiles, check_frf_files
from dovetail.cli.reading import Columns, ForceDof, Names, ResponseDof, columns_of, names_of
from dovetail.cli.terminal import note, say, title

_seconds = quantity_in("s")


_RECORD: dict[str, tuple[Any, Any]] = {
    "force_unit": (
        Annotated[str | None, typer.Option(metavar="UNIT", help="Unit of the force, if the file does not say.")],
        None,
    ),
    "response_unit": (
        Annotated[
            str | None,
            typer.Option(
                metavar="UNIT", help="Unit of the response, such as m/s^2, g or mm/s, if the file does not say."
            ),
        ],
        None,
    ),
    "force_sensitivity": (
        Annotated[
            str | None,
            typer.Option(
                metavar="VALUE", help="Sensitivity of the hammer, such as '2.25 mV/N', if the force is a voltage."
            ),
        ],
        None,
    ),
    "response_sensitivity": (
        Annotated[
            str | None,
            typer.Option(
                metavar="VALUE", help="Sensitivity of the sensor, such as '100 mV/g', if the response is a voltage."
            ),
        ],
        None,
    ),
    "rate": (
        Annotated[float | None, typer.Option(metavar="HZ", help="Samples per second, if the file does not say.")],
        None,
    ),
    "response": (ResponseDof, None),
    "force": (ForceDof, None),
    "names": (Names, None),
    "columns": (Columns, None),
}
"""Options that say what the file holds."""
_ESTIMATE: dict[str, tuple[Any, Any]] = {
    "estimator": (
        Annotated[str, typer.Option(metavar="NAME", help="H1 (noise on the response) or H2 (noise on the force).")],
        "H1",
    ),
    "force_window": (
        Annotated[
            float | None,
            typer.Option(
                metavar="TIME", parser=_seconds, help="Set the force to zero after this time, such as '20 ms'."
            ),
        ],
        None,
    ),
    "exponential_window": (
        Annotated[
            float | None,
            typer.Option(
                metavar="VALUE", help="Exponential window on both signals that falls to VALUE at the end, such as 0.01."
            ),
        ],
        None,
    ),
    "leave_out_bad": (
        Annotated[bool, typer.Option("--leave-out-bad", help="Leave out impacts with an overload or a second hit.")],
        False,
    ),
}


def _record(values: dict[str, Any]) -> dict[str, Any]:
    return values | {"names": names_of(values["names"] or []), "columns": columns_of(values["columns"])}


def _estimate(values: dict[str, Any]) -> dict[str, Any]:
    from dovetail.measurement.impact_test.frf_estimation import ESTIMATORS

    return values | {"estimator": one_of(ESTIMATORS, values["estimator"], "--estimator")}


@bundled("record", _RECORD, _record)
@bundled("estimate", _ESTIMATE, _estimate)
def frf(
    signals: Annotated[
        Path, typer.Argument(metavar="SIGNALS", help="Force and response: .npz, .npy, .mat, .h5, .csv, .uff or .lvm.")
    ],
    output: RequiredFrfFiles,
    record: Mapping[str, Any] = MappingProxyType({}),
    estimate: Mapping[str, Any] = MappingProxyType({}),
    overwrite: Overwrite = False,
    plugin: PluginFiles = None,
) -> None:
    """Estimate an FRF with its coherence from hammer signals.

    The file contains the force and the response of one or more impacts, which are averaged. Faulty impacts (overload, a
    second hit, a response that has not decayed) are reported.
    """
    import dovetail
    from dovetail.measurement.impact_test.signal_files import read_signals
    from dovetail.measurement.recording import point_fields
    from dovetail.report.frf_files import describe_frf, write_frf_files

    check_frf_files(output, overwrite, plugin)
    read = read_signals(signals, **record, plugins=plugin or ())
    note(f"Read {signals.name}: {read.origin}")
    name = f"{estimate['estimator']} of {signals.name}"
    options = {"quantity": read.quantity, "label": signals.name, **estimate}
    estimated = dovetail.frf_from_signals(read.force, read.response, read.rate, **options)
    given = {"response": read.response_point, "force": read.force_point, "note": name}
    frf = replace(estimated.frf, **point_fields(given, read.named_points))
    write_frf_files(frf, output, (), {}, overwrite=overwrite, plugins=plugin or ())
    title(f"{estimate['estimator']} from {signals.name}")
    say(describe_frf(frf))
    for warning in (*read.warnings, *estimated.warnings):
        say(f"Note: {warning}")
    for file in output:
        note(f"Written: {file}")
