"""Messages of the library on the command line, with options instead of arguments."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Mapping

_ARGUMENT = re.compile(r"`(?P<name>\w+)=(?P<value>[^`]*)`")
"""An argument in a message, as `dovetail.errors.argument` writes it."""
_OPTIONS = {
    "drive": "--drive-point",
    "mass": "--accelerometer-mass",
    "names": "--name",
    "plugins": "--plugin",
}
"""Options that are not called like their arguments."""


def with_options(text: str) -> str:
    """Return a message with options instead of arguments: ``"`columns='a,b'`"`` becomes ``"--columns a,b"``."""
    return _ARGUMENT.sub(_option, text)


def _option(match: re.Match[str]) -> str:
    option = _OPTIONS.get(match["name"], f"--{match['name'].replace('_', '-')}")
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
