"""``dovetail explore``: a page with a slider for each parameter, which shows the FRF."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.completion import complete_files
from dovetail.cli.options import AssemblyFile, load_assembly
from dovetail.cli.reading import NOTHING_SET, Reading, with_reading
from dovetail.cli.terminal import note, say


@with_reading()
def explore(
    assembly: AssemblyFile,
    measured: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[MEASURED]...",
            help="Measured FRFs to compare with, one per response.",
            autocompletion=complete_files,
            show_default=False,
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(metavar="N", min=0, max=65535, help="Port on this machine; 0 for any free one.")
    ] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    reading: Reading = NOTHING_SET,
) -> None:
    """Change parameters in a web page and watch the FRF.

    The page opens in the browser of this machine and cannot be reached from others. It has a slider and a number field
    for each parameter. Measured FRFs are drawn behind the computed one; "Fit from here" fits the parameters to them and
    shows intervals. The values can be saved as JSON, as a description or as a report. The command ends with Ctrl-C, or
    when the page is closed.
    """
    from dovetail.identification.one_measurement import check_mass
    from dovetail.report.explorer import Explorer
    from dovetail.report.page_server import PageServer

    loaded = load_assembly(assembly, reading.plugins)
    check_mass(loaded, reading.accelerometer_mass)
    frfs = reading.read_selected(measured) if measured else []
    explorer = Explorer(loaded, frfs)
    try:
        server = PageServer(explorer, port)
    except OSError as error:
        from dovetail.errors import DovetailError, Fault

        problem = f"this port cannot be had: {error.strerror}."
        raise DovetailError(Fault(f"--port {port}", problem, remedy="Choose another, or leave it out.")) from None
    with server, server.redirect_file() as file:
        say(server.address)
        note("Open this address in a browser on this machine. End with Ctrl-C, or close the page.")
        if browser:
            webbrowser.open(file.as_uri())  # not the address: other users can read a command line
        try:
            server.serve_forever(poll_interval=0.2)
            note("The page was closed.")
        except KeyboardInterrupt:
            note("Ended.")
