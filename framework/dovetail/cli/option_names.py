"""Messages of the library on the command line, with options instead of arguments."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from dovetail.errors import DovetailError, Fault

_ARGUMENT = re.compile(r"`(?P<name>\w+)=(?P<value>[^`]*)`")
"""An argument in a message, as `dovetail.errors.argument` writes it."""
_OPTIONS = {
    "drive": "--drive-point",
    "mass": "--accelerometer-mass",
    "names": "--name",
    "plugins": "--plugin",
    "substructures": "--at",
}
"""Options that are not called like their arguments."""
_ARGUMENT_PLACE = "the argument "
"""Begins the place of a fault in an argument of the library."""


def with_options(text: str) -> str:
    """Return a message with options instead of arguments: ``"`columns='a,b'`"`` becomes ``"--columns a,b"``."""
    return _ARGUMENT.sub(_option, text)


def message_of(error: DovetailError | Fault, command: Any = None) -> str:
    """Return the text of an error, with the options of the command that was run in place of arguments.

    Parameters
    ----------
    error : DovetailError or Fault
    command : click.Command, optional
        Faults without a place are printed under its name.
    """
    faults = [error] if isinstance(error, Fault) else error.faults
    placed = [replace(fault, where=_place(fault.where, command)) for fault in faults]
    return with_options("\n".join(map(str, placed)))


def _place(where: str, command: Any) -> str:
    """Return the option or argument of a command that a place in the library's arguments means, or else the place."""
    if command is None:
        return where
    if not where:
        return f"dovetail {command.name}"
    name = where.removeprefix(_ARGUMENT_PLACE)
    option = _option_called(name)
    for parameter in command.params:
        if option in parameter.opts:
            return option
        if parameter.name == name and parameter.param_type_name == "argument":
            return str(parameter.metavar or name).strip("[]").removesuffix("...")
    return where


def _option_called(argument: str) -> str:
    return _OPTIONS.get(argument, f"--{argument.replace('_', '-')}")


def _option(match: re.Match[str]) -> str:
    option = _option_called(match["name"])
    if match["value"] in ("", "True"):
        return option
    try:
        value = ast.literal_eval(match["value"])
    except (ValueError, SyntaxError):  # not of `argument`
        return match[0]
    if isinstance(value, Mapping):
        return " ".join(f"{option} {shlex.quote(f'{part}={name}')}" for part, name in value.items())
    text = ",".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)
    return f"{option} {shlex.quote(text)}"
