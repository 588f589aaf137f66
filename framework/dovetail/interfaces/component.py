"""The base class of all components, and errors in their code, which are reported with file and line."""

from __future__ import annotations

import sys
from abc import ABC
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FunctionType, TracebackType
from typing import Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator

from dovetail.errors import DovetailError, Fault, PluginError, reason_of
from dovetail.units import refuse_marks

Kind = Literal["substructure", "joint", "reducer", "regressor", "reader", "matrix_reader", "method", "law"]
KINDS: tuple[Kind, ...] = (
    "substructure",
    "joint",
    "reducer",
    "regressor",
    "reader",
    "matrix_reader",
    "method",
    "law",
)
INTERFACE_VERSION = 2
"""Version of the plugin interface; it increases with each change that can break a component."""
OLDEST_INTERFACE = 1
"""Oldest version whose components still work: their nodes and ports have the directions x and rz, as then."""


class ComponentConfig(BaseModel):
    """Base class of every component's options; they are frozen, and an unknown key is an error.

    Attributes
    ----------
    alternatives : tuple of tuples of tuples of str
        Class attribute: choices, each of groups of keys of which only one may be given, such as
        ``((("file",), ("mass", "stiffness")),)``. A description that gives one replaces the others of a description
        that it extends.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
    alternatives: ClassVar[tuple[tuple[tuple[str, ...], ...], ...]] = ()

    @field_validator("*", mode="before")
    @classmethod
    def _refuse_marks_of_thousands(cls, value: object, info: ValidationInfo) -> object:
        """Refuse ``10_000`` for a whole number, which pydantic reads as 10000."""
        field = cls.model_fields.get(info.field_name or "")
        return refuse_marks(value) if field is not None and field.annotation is int else value

    def with_options(self, options: Mapping[str, Any]) -> Self:
        """Return the same options with some values replaced, which are not validated and may be arrays.

        Parameters
        ----------
        options : mapping of str to Any
            By their path in the section of a description, such as ``"material.young"`` or ``"sections.0.length"``.
        """
        changed = self
        for place, value in options.items():
            changed = _replaced(changed, place.split("."), value)
        return changed


def _replaced(options: Any, steps: Sequence[str], value: Any) -> Any:
    if not steps:
        return value
    step, *others = steps
    if isinstance(options, BaseModel):
        by_alias = {field.alias or name: name for name, field in type(options).model_fields.items()}
        name = by_alias.get(step, step)
        return options.model_copy(update={name: _replaced(getattr(options, name), others, value)})
    if isinstance(options, Mapping):
        return {**options, step: _replaced(options[step], others, value)}
    elements = list(options)
    elements[int(step)] = _replaced(elements[int(step)], others, value)
    return tuple(elements) if isinstance(options, tuple) else elements


class Component(ABC):
    """A model that a description names, constructed from its options and never changed afterwards.

    Attributes
    ----------
    kind : str
        The contract that it implements; set by the base class of the contract.
    name : str
        The word after ``model:`` in a description, or the name of a reader or a method.
    summary : str
        One line, shown by ``dovetail plugins``.
    references : tuple of str
        Publications of the model.
    interface_versions : tuple of int
        Lowest and highest version of the plugin interface for which the component was written, as in ``(1, 2)``.
        Dovetail refuses the component if it has none of these versions: `OLDEST_INTERFACE` to `INTERFACE_VERSION`.
    """

    kind: ClassVar[Kind]
    name: ClassVar[str]
    summary: ClassVar[str]
    references: ClassVar[tuple[str, ...]] = ()
    interface_versions: ClassVar[tuple[int, int]] = (1, 2)

    class Config(ComponentConfig):
        """A component without options."""

    @classmethod
    def examples(cls, folder: Path) -> Sequence[Mapping[str, Any]]:  # noqa: ARG003
        """Return sets of options, as in a description, with which ``dovetail check-plugin`` tests the component.

        By default a single set without options. A component with a required option must override this method.

        Parameters
        ----------
        folder : Path
            An empty folder for files to which options refer.
        """
        return ({},)

    def __init__(self, config: Any = None) -> None:
        self.config: Any = self.Config() if config is None else config

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.config!r})"


def component_label(component: Component) -> str:
    """Return how messages name a component."""
    return f"{component.kind} '{component.name}'"


def check_contract(answer: object, component: Component, contract: type, call: str = "fit") -> None:
    """Check that a call of a component returned an object of its contract.

    Raises
    ------
    PluginError
    """
    if not isinstance(answer, contract):
        problem = f"its {call} returned {type(answer).__name__}."
        raise PluginError(Fault(component_label(component), problem, f"a {contract.__name__}"))


@contextmanager
def plugin_errors(component: object, label: str) -> Iterator[None]:
    """Convert an error in the code of a component to a `PluginError` that names the component, its file and the line.

    A `PluginError` without a file, which rejects a result of the component, gets the file of the component.

    Parameters
    ----------
    component : Component, FittedReducer or FittedRegressor
    label : str
        The component's name in messages.

    Raises
    ------
    PluginError
        The component's code, or code that it called, raised an exception other than a `DovetailError`; or the call
        itself failed, for instance because a method takes other arguments. Other exceptions pass unchanged.
    """
    try:
        yield
    except PluginError as error:
        raise _with_file(component, error) from error.__cause__
    except DovetailError:
        raise
    except (Exception, SystemExit) as error:
        where = _failing_line(component, error.__traceback__) or _refusing_file(component, error)
        if not where:
            raise
        problem = f"{label} failed: {reason_of(error)}"
        raise PluginError(Fault(where, problem, remedy="The fault is in the code of the model.")) from error


def _with_file(component: object, error: PluginError) -> PluginError:
    """Prefix an error about a component's result with the component's file, unless it already names a file."""
    file = source_file(component)
    if not file or any(".py" in fault.where for fault in error.faults):
        return error
    return PluginError(*(replace(fault, where=f"{file}  {fault.where}".rstrip()) for fault in error.faults))


def _refusing_file(component: object, error: BaseException) -> str:
    """Return the component's file if the call itself failed, or the statement that unpacks its result; else ''."""
    refused = isinstance(error, TypeError) and str(error).startswith(f"{type(component).__qualname__}.")
    trace = error.__traceback__
    at_statement = trace is not None and trace.tb_next is not None and trace.tb_next.tb_next is None
    return source_file(component) if refused or at_statement else ""


def source_file(component: object) -> str:
    """Return the source file of a component or its class, or an empty text if there is none."""
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
