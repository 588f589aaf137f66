"""The declaration of a command that a package adds to the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module


@dataclass(frozen=True)
class Command:
    """A command that a package adds to the command line.

    Parameters
    ----------
    function : str or callable
        The function that Typer makes a command of, or its place, ``"package.module:function"``. A place is better in a
        package: its module is imported only when the command is run, and the list of commands stays fast.
    summary : str
        One sentence for the list of commands, up to 90 characters.
    panel : str
        Heading under which it is listed: an existing one, or a new one.
    name : str, optional
        As it is typed, such as ``"my-command"``; by default the function's name, with hyphens.
    """

    function: str | Callable[..., object]
    summary: str
    panel: str = "Commands of packages"
    name: str = ""

    @property
    def called(self) -> str:
        """The name as it is typed."""
        return self.name or self.place.rpartition(":")[2].replace("_", "-")

    @property
    def place(self) -> str:
        """Where its function is defined, ``module:function``."""
        if isinstance(self.function, str):
            return self.function
        return f"{self.function.__module__}:{self.function.__name__}"

    def load(self) -> Callable[..., object]:
        """Return the function; its module is imported."""
        if not isinstance(self.function, str):
            return self.function
        module, _, name = self.function.partition(":")
        function: Callable[..., object] = getattr(import_module(module), name)
        return function
