"""The hooks by which Dovetail finds the commands and the defaults of this package."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import dovetail

_COMMANDS = {
    "calibrate": "Check intervals against simulated joints whose parameters are known.",
    "compare": "Compare methods of identification.",
    "robustness": "Show how the accuracy of networks falls with noise.",
    "study": "Try out training settings.",
    "validate": "Compare predictions of models with measurements.",
}


@dovetail.hookimpl
def dovetail_commands() -> list[dovetail.Command]:
    """Return the commands."""
    return [
        dovetail.Command(f"dovetail_bench.commands.{name}:{name}", summary, "Evaluate")
        for name, summary in _COMMANDS.items()
    ]


@dovetail.hookimpl
def dovetail_defaults() -> dict[str, Any]:
    """Return the contents of ``defaults.yaml``."""
    import yaml

    text = (files("dovetail_bench") / "defaults.yaml").read_text(encoding="utf-8")
    defaults: dict[str, Any] = yaml.safe_load(text)
    return defaults
