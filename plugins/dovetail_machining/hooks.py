"""The hook by which Dovetail finds the command of this package."""

from __future__ import annotations

import dovetail


@dovetail.hookimpl
def dovetail_commands() -> list[dovetail.Command]:
    """Return the commands."""
    return [
        dovetail.Command(
            "dovetail_machining.command:spindle",
            "Determine the receptance of a spindle's flange from impact tests.",
            "Measure",
        )
    ]
