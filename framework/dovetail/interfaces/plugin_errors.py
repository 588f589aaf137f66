"""An exception in a component's own code, told as what it is: a fault of that component."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FunctionType, TracebackType

from dovetail.errors import DovetailError, Fault, PluginError

__all__ = ["blamed_on", "source_file"]


@contextmanager
def blamed_on(component: object, label: str) -> Iterator[None]:
    """Turn what a component's own code raises into an error that names the component, its file and the line.

    Parameters
    ----------
    component : Component, or what one was fitted to
    label : str
        How messages name it.

    Raises
    ------
    PluginError
        The component's code, or what it called, raised something else than a `DovetailError`. What the caller's own
        code raises passes as it is.
    """
    try:
        yield
    except DovetailError:
        raise
    except Exception as error:
        place = _place(component, error.__traceback__)
        if not place:
            raise
        problem = f"{label} failed: {type(error).__name__}: {error}".rstrip(": ")
        raise PluginError(Fault(place, problem, remedy="The fault is in the code of the model.")) from error


def source_file(component: object) -> str:
    """Return the file in which a component, or its class, is written; an empty text where there is none."""
    model = component if isinstance(component, type) else type(component)
    for member in vars(model).values():
        function = member.fget if isinstance(member, property) else member
        if isinstance(function, FunctionType) and not function.__code__.co_filename.startswith("<"):
            return function.__code__.co_filename
    module = sys.modules.get(model.__module__)
    return str(getattr(module, "__file__", None) or "")


def _place(component: object, trace: TracebackType | None) -> str:
    """Return file and line of the innermost call in the component's own files."""
    own = [model for model in type(component).__mro__ if not model.__module__.startswith(f"{__package__}.")]
    files = {source_file(model) for model in own if model is not object}
    place = ""
    while trace:
        if (file := trace.tb_frame.f_code.co_filename) in files:
            place = f"{file}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place
