"""An exception in a component's own code, told as what it is: a fault of that component."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FunctionType, TracebackType

from dovetail.errors import DovetailError, Fault, PluginError
from dovetail.interfaces.component import Component

__all__ = ["blamed_on", "source_file"]


@contextmanager
def blamed_on(component: Component, label: str = "") -> Iterator[None]:
    """Turn what the component's own code raises into an error that names the component, its file and the line.

    Parameters
    ----------
    component : Component
    label : str, optional
        How messages name it; its kind and its name by default.

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
        who = label or f"{component.kind} model '{component.name}'"
        found = f"{who} failed: {type(error).__name__}: {error}".rstrip(": ")
        raise PluginError(Fault(place, found, remedy="The fault is in the code of the model.")) from error


def source_file(component: Component | type[Component]) -> str:
    """Return the file in which a component is written, or an empty text where there is none."""
    model = component if isinstance(component, type) else type(component)
    for member in vars(model).values():
        function = member.fget if isinstance(member, property) else member
        if isinstance(function, FunctionType):
            return function.__code__.co_filename
    module = sys.modules.get(model.__module__)
    return str(getattr(module, "__file__", None) or "")


def _place(component: Component, trace: TracebackType | None) -> str:
    """Return file and line of the innermost call in the component's own files."""
    models = [model for model in type(component).__mro__ if issubclass(model, Component)]
    files = {source_file(model) for model in models if not model.__module__.startswith(f"{__package__}.")}
    place = ""
    while trace:
        if (file := trace.tb_frame.f_code.co_filename) in files:
            place = f"{file}:{trace.tb_lineno}"
        trace = trace.tb_next
    return place
