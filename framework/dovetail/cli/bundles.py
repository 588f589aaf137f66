"""Options that belong together, as one parameter of a command."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

Command = Callable[..., None]


def bundled(
    parameter: str, options: Mapping[str, tuple[Any, Any]], make: Callable[[dict[str, Any]], object]
) -> Callable[[Command], Command]:
    """Give a command several options as one of its parameters.

    Parameters
    ----------
    parameter : str
        The parameter of the command, in whose place its help lists the options.
    options : mapping
        The annotation for typer and the default of each option.
    make : callable
        Returns the parameter's value from those of the options.
    """
    kind = inspect.Parameter.KEYWORD_ONLY
    those = [inspect.Parameter(name, kind, default=d, annotation=a) for name, (a, d) in options.items()]

    def decorate(command: Command) -> Command:
        signature = inspect.signature(command, eval_str=True)
        every: list[inspect.Parameter] = []
        for known in signature.parameters.values():
            every += those if known.name == parameter else [known.replace(kind=kind)]

        @wraps(command)
        def run(**values: Any) -> None:
            taken = {name: values.pop(name) for name in options}
            command(**values, **{parameter: make(taken)})

        vars(run)["__signature__"] = signature.replace(parameters=every)  # by which typer knows the options
        run.__annotations__ = {known.name: known.annotation for known in every}
        return run

    return decorate
