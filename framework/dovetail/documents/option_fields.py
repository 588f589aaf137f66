"""The fields of pydantic models: their units, the models nested in them, and the numbers that instances have."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from dovetail.documents.tree import Path
from dovetail.units import InUnit


@dataclass(frozen=True)
class OptionNumber:
    """A number among the options of a component.

    Parameters
    ----------
    path : Path
        Keys and indices that lead to it, as in ``("sections", 2, "length")``.
    value : float
        SI.
    unit : str
        Empty without one.
    is_single : bool
        Whether the option is this number, not a list or a mapping of numbers.
    """

    path: Path
    value: float
    unit: str
    is_single: bool


def numbers_within(options: BaseModel) -> Iterator[OptionNumber]:
    """Yield all floats among the options of a component, in the order of its fields."""
    return _walk(options, (), "", is_single=True)


def _walk(node: Any, path: Path, unit: str, *, is_single: bool) -> Iterator[OptionNumber]:
    if isinstance(node, float):
        yield OptionNumber(path, node, unit, is_single)
    elif isinstance(node, BaseModel):
        for name, field in type(node).model_fields.items():
            yield from _walk(getattr(node, name), (*path, field.alias or name), unit_of(field), is_single=True)
    elif isinstance(node, Mapping):
        for key, child in node.items():
            yield from _walk(child, (*path, key), unit, is_single=False)
    elif isinstance(node, (list, tuple)):
        for index, child in enumerate(node):
            yield from _walk(child, (*path, index), unit, is_single=False)


def number_unit(model: type[BaseModel], path: Path) -> str | None:
    """Return the unit of an option inside a section of a model, ``"1"`` without one; None if it is not a float."""
    last = max((index for index, step in enumerate(path) if isinstance(step, str)), default=-1)
    if last < 0:
        return None
    for owner in models_at(model, path[:last]):
        for name, field in owner.model_fields.items():
            if path[last] in (name, field.alias) and _is_float(field.annotation):
                return unit_of(field) or "1"
    return None


def _is_float(annotation: Any) -> bool:
    """Return whether the annotation allows a float, and no section."""
    if isinstance(annotation, type):
        return annotation is float
    origin = get_origin(annotation)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return False
    return any(_is_float(part) for part in get_args(annotation)) and not any(_models_in(annotation))


def keys_of(models: Collection[type[BaseModel]]) -> dict[str, str]:
    """Return the keys of these models, each with its unit or an empty text."""
    return {field.alias or name: unit_of(field) for model in models for name, field in model.model_fields.items()}


def models_at(model: type[BaseModel], path: Path) -> list[type[BaseModel]]:
    """Return the models that a section at `path` inside `model` may have."""
    models = [model]
    for step in path:
        if isinstance(step, str):
            fields = [f for m in models for name, f in m.model_fields.items() if step in (name, f.alias)]
            models = [nested for field in fields for nested in _models_in(field.annotation)]
    return models


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)


def unit_of(field: FieldInfo) -> str:
    """Return the unit of a field's numbers; empty without one."""
    for entry in field.metadata:
        if isinstance(entry, InUnit):
            return entry.unit
    return next(_units_in(field.annotation), "")


def _units_in(annotation: Any) -> Iterator[str]:
    if get_origin(annotation) is Annotated:
        for entry in annotation.__metadata__:
            if isinstance(entry, InUnit):
                yield entry.unit
    for argument in get_args(annotation):
        yield from _units_in(argument)
