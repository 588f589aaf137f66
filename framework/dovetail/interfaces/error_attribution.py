"""Errors in the code of a component, reported as faults of that component with file and line."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FunctionType, TracebackType

from dovetail.errors import DovetailError, Fault, PluginError

__all__ = ["plugin_errors", "source_file"]


@contextmanager
def plugin_errors(component: object, label: str) -> Iterator[None]:
    """Convert an error in the code of a component to a `PluginError` that names the component, its file and the line.

    Parameters
    ----------
    component : Component, FittedReducer or FittedRegressor
    label : str
        The component's name in messages.

    Raises
    ------
    PluginError
        The component's code, or code that it called, raised an exception other than a `DovetailError`. Exceptions
        that do not come from the component's code pass unchanged.
    """
    try:
        yield
    except DovetailError:
        raise
    except Exception as error:
        where = _failing_line(component, error.__traceback__)
        if not where:
            raise
        problem = f"{label} failed: {type(error).__name__}: {error}".rstrip(": ")
        raise PluginError(Fault(where, problem, remedy="The fault is in the code of the model.")) from error


def source_file(component: object) -> str:
    """Return the file with the source code of a component or its class; an empty text if there is none."""
    model = component if isinstance(component, type) else type(component)
    for member in vars(model).values():
        function = member.fget if isinstance(member, property) else member
        if isinstance(function, FunctionType) and not function.__code__.co_filename.startswith("<"):
            return function.__code__.co_filename
    module = sys.modules.get(model.__module__)
    return str(getattr(module, "__file__", None) or "")


def _failing_line(component: object, trace: TracebackType | None) -> str:
    """Return file and line of the innermost call in the files of the component's classes."""
    bases = [model for model in type(component).__mro__ if not model.__module__.startswith(f"{__package__}.")]
    files = {source_file(model) for model in bases if model is not object}
    where = ""
    while trace:
        if (file := trace.tb_frame.f_code.co_filename) in files:
            where = f"{file}:{trace.tb_lineno}"
        trace = trace.tb_next
    return where
