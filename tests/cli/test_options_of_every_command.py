"""Each option of each command is called as its parameter, with every version of typer, and its help lists it."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

import pytest
import typer

from dovetail.cli.command_group import OWN
from dovetail.registry import CommandTable

COMMANDS = CommandTable(OWN).offers


def options(name: str) -> Iterator[tuple[str, typer.models.OptionInfo, list[str]]]:
    """Yield each option of a command: its parameter, its annotation, and the names that the annotation declares."""
    signature = inspect.signature(COMMANDS[name].command.load(), eval_str=True)
    for parameter, annotated in signature.parameters.items():
        for info in getattr(annotated.annotation, "__metadata__", ()):
            if isinstance(info, typer.models.OptionInfo):
                first = [info.default] if isinstance(info.default, str) else []  # where typer puts the first name
                yield parameter, info, [*first, *(info.param_decls or ())]


@pytest.mark.parametrize("name", COMMANDS)
def test_help_lists_every_annotated_option(run, name):
    listed = re.findall(r"^  (?:-\w, )?(--[\w-]+)", run(name, "--help").stdout, flags=re.M)
    expected = [
        next((word.split("/")[0] for word in declared if word.startswith("--")), "--" + parameter.replace("_", "-"))
        for parameter, _, declared in options(name)
    ]
    assert [option for option in expected if option not in listed] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_an_option_whose_placeholder_spells_its_name_declares_its_name(name):
    """Typer 0.26 and 0.27 call an option without a declared name as its placeholder: ``--METHOD``."""
    for parameter, info, declared in options(name):
        assert declared or (info.metavar or "").replace("-", "_").lower() != parameter, parameter


@pytest.mark.parametrize("name", COMMANDS)
def test_the_summary_in_the_list_of_commands_is_the_first_sentence_of_the_help(name):
    command = COMMANDS[name].command
    assert (command.load().__doc__ or "").splitlines()[0].strip() == command.summary
    assert len(command.summary) <= 90
