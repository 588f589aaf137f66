"""What a command prints as notes: warnings of Dovetail and of plugins, and what looks wrong in a description."""

from __future__ import annotations

import logging
import sysconfig
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from dovetail.cli.terminal import note
from dovetail.load_observers import observing_loads

if TYPE_CHECKING:
    from dovetail.assembly import Assembly


@contextmanager
def warnings_as_notes() -> Iterator[None]:
    """Print each warning for the user as one note; log the others, which -v prints.

    A warning is for the user if its category is `UserWarning` itself and its place is in Dovetail or in a plugin. What
    a library warns of, such as an overflow or a function that will go, is about code.
    """
    printed: set[str] = set()

    def show(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: object) -> None:
        text = str(message)
        if category is UserWarning and not _is_of_a_library(filename):
            if text not in printed:
                note(f"Note: {text}")
            printed.add(text)
        else:
            logging.getLogger(__name__).info("%s:%d: %s: %s", filename, lineno, category.__name__, text)

    with warnings.catch_warnings():
        warnings.showwarning = cast("Any", show)
        yield


@contextmanager
def suspicious_values_as_notes() -> Iterator[None]:
    """Print on stderr what looks wrong in each description that a command loads, once."""
    printed: set[str] = set()

    def show(assembly: Assembly) -> None:
        from dovetail.assembly import find_warnings

        for warning in find_warnings(assembly, effects=False):  # `check` computes these: they take a tenth of a second
            if warning not in printed:
                note(f"This looks wrong: {warning}")
            printed.add(warning)

    with observing_loads(show):
        yield


def _is_of_a_library(filename: str) -> bool:
    """Return whether a file belongs to Python or to an installed package that is not a plugin."""
    file = Path(filename).absolute()
    for name in ("purelib", "platlib", "stdlib", "platstdlib"):
        folder = Path(sysconfig.get_path(name)).absolute()
        if file.is_relative_to(folder):
            return file.relative_to(folder).parts[0] not in _plugin_packages()
    return False


def _plugin_packages() -> set[str]:
    from importlib.metadata import entry_points

    return {"dovetail", *(entry.module.partition(".")[0] for entry in entry_points(group="dovetail"))}
