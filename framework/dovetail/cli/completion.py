"""Completion in the shell: names of models, methods and parameters, and files."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def complete_files(incomplete: str) -> list[str]:
    """Return folders and files whose paths begin with a text; hidden ones only if it begins with a dot."""
    folder = incomplete.rpartition("/")[0]
    begun = incomplete.rpartition("/")[2]
    place = Path(folder or ("/" if incomplete.startswith("/") else "."))
    prefix = incomplete[: len(incomplete) - len(begun)]
    with suppress(OSError):
        named = [path for path in sorted(place.iterdir()) if path.name.startswith(begun)]
        shown = [path for path in named if begun or not path.name.startswith(".")]
        return [f"{prefix}{path.name}{'/' if path.is_dir() else ''}" for path in shown]
    return []


def complete_methods(incomplete: str) -> list[str]:
    """Return the methods of identification that begin with a text."""
    from dovetail.registry import components

    return [name for name in components().names("method") if name.startswith(incomplete)]


def complete_models(incomplete: str) -> list[str]:
    """Return the available models that begin with a text."""
    from dovetail.interfaces import KINDS
    from dovetail.registry import components

    registry = components(())
    return sorted({name for kind in KINDS for name in registry.names(kind) if name.startswith(incomplete)})


def complete_parameters(incomplete: str) -> list[str]:
    """Return ``name=`` for the parameters of the description that precedes on the command line.

    An option without its value prevents parsing of the command line, so that the description is searched for among its
    words.
    """
    from dovetail import DovetailError, load

    words = os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS", "")
    for word in words.split():
        if word.endswith((".yaml", ".yml")) and Path(word).is_file():
            with suppress(DovetailError):
                return [f"{p.name}=" for p in load(word).parameters if p.name.startswith(incomplete)]
    return []
