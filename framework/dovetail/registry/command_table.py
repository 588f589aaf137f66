"""Commands that packages and plugin files add to the command line; what they run is imported when they are run."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from dovetail.errors import Fault, PluginError, contained
from dovetail.registry.command import Command
from dovetail.registry.loading import (
    COMMANDS,
    LoadFailure,
    hooks_of,
    installed_plugins,
    is_shipped,
    load_entry,
    load_module,
    returned_list,
)

_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_PLACE = re.compile(r"\w+(\.\w+)*:\w+")


@dataclass(frozen=True)
class CommandOffer:
    """A command and its source: a distribution with its version, or a file."""

    command: Command
    source: str

    @property
    def place(self) -> str:
        """Source and function of the command, for messages."""
        return f"{self.source} ({self.command.place})"


class CommandTable:
    """The commands of the program, of packages and of plugin files, by name.

    Parameters
    ----------
    own : iterable of CommandOffer
        Commands of the program itself, which no other may replace.
    files : iterable of Path
        Plugin files.

    Notes
    -----
    A name belongs to whoever comes first: the program, the packages that ship with it, other packages by name, files.
    A package that fails, or a command of a taken name, is listed in `failures`.

    Raises
    ------
    PluginError
        A plugin file fails, or has a command of a taken name.
    """

    def __init__(self, own: Iterable[CommandOffer], files: Iterable[Path] = ()) -> None:
        self.offers: dict[str, CommandOffer] = {offer.command.called: offer for offer in own}
        self.failures: list[LoadFailure] = []
        for owner, entry in sorted(installed_plugins(), key=lambda plugin: not is_shipped(plugin[1])):
            try:
                self._add(load_entry(owner, entry), owner)
            except PluginError as error:
                self.failures.append(LoadFailure(owner, error.faults[0].problem))
        for file in files:
            self._add(load_module(file), str(file), strict=True)

    def _add(self, plugin: ModuleType | object, source: str, *, strict: bool = False) -> None:
        for command in commands_of(plugin, source):
            offer = CommandOffer(command, source)
            first = self.offers.setdefault(command.called, offer)
            if first != offer:
                problem = f"the command '{command.called}' of {offer.place} is refused: {first.place} has that name."
                if strict:
                    raise PluginError(Fault(source, problem, remedy="Give it another name."))
                self.failures.append(LoadFailure(source, problem))

    def panels(self) -> Mapping[str, list[CommandOffer]]:
        """Return the commands by the headings under which they are listed."""
        panels: dict[str, list[CommandOffer]] = {}
        for offer in self.offers.values():
            panels.setdefault(offer.command.panel, []).append(offer)
        return panels


def commands_of(plugin: ModuleType | object, source: str) -> list[Command]:
    """Return the commands from a plugin's hook; none if it has no such hook.

    Raises
    ------
    PluginError
        The hook fails, or returns something else than commands.
    """
    hooks = hooks_of(plugin, source)
    commands = returned_list(hooks, COMMANDS, source, "dovetail.Command")
    for command in commands:
        with contained(source, f"its hook '{COMMANDS}' returned a command that cannot be examined: "):
            reason = next(_reasons_against(command), "")
        if reason:
            raise PluginError(Fault(source, f"its hook '{COMMANDS}' returned {reason}", "a list of dovetail.Command"))
    return commands


def _reasons_against(command: Any) -> Iterator[str]:
    """Yield what is wrong with a command that a hook returned."""
    if not isinstance(command, Command):
        yield f"{command!r:.60}, not a dovetail.Command."
    elif isinstance(command.function, str) and not _PLACE.fullmatch(command.function):
        yield f"a command with the function {command.function!r:.60}, not 'package.module:function'."
    elif not isinstance(command.function, str) and not hasattr(command.function, "__name__"):
        yield f"a command with the function {command.function!r:.60}, which is neither a function nor its place."
    elif not _NAME.fullmatch(command.called):
        yield f"a command with the name {command.called!r:.60}, not small letters and digits with hyphens."
    elif not all(
        isinstance(text, str) and text.strip() and "\n" not in text for text in (command.summary, command.panel)
    ):
        yield f"the command '{command.called}' without a summary or without a panel."
