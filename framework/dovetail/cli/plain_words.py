"""Help and refusals in the words of this program, whichever version of typer prints them."""

from __future__ import annotations

from typing import Any

_PROBLEMS = {
    "int_parsing": "{input!r} is not a whole number.",
    "int_from_float": "{input!r} is not a whole number.",
    "float_parsing": "{input!r} is not a number.",
    "greater_than_equal": "{input} is not {ge} or more.",
    "less_than_equal": "{input} is not {le} or less.",
    "value_error": "{error}.",
}
"""What is wrong with a value, by the type of pydantic's error."""


def plain_arguments(command: Any) -> None:
    """Show the arguments of a command as ``ASSEMBLY`` or ``MEASURED...`` in its help, without Python's types."""
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            _show_plainly(parameter)


def _show_plainly(argument: Any) -> None:
    shown = str(argument.metavar or argument.name.upper())
    help_text = f"{argument.help or ''}  [required]" if argument.required else argument.help or ""
    argument.get_usage_pieces = lambda _: [shown]
    argument.make_metavar = lambda *_, **__: shown
    argument.get_help_record = lambda _: (shown, help_text)


def refused_value(error: BaseException) -> str:
    """Return why an option's value was refused, or an empty text if pydantic, which typer uses, did not refuse it."""
    find = getattr(error.__cause__, "errors", None)
    if find is None:
        return ""
    first = find(include_url=False)[0]
    problem = _PROBLEMS.get(first["type"])
    if problem is None:
        return f"{first['input']!r} is refused: {first['msg']}."
    return problem.format(input=first["input"], **first.get("ctx", {})).replace("..", ".")
