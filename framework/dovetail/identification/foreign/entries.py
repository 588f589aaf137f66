"""The numbers of a substructure's description, each of which may be another than the one that was measured on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, get_args

from pydantic import BaseModel

from dovetail.interfaces import SubstructureModel
from dovetail.units import InUnit

__all__ = ["Entry", "entries"]


@dataclass(frozen=True)
class Entry:
    """A physical quantity in a substructure's Config.

    Parameters
    ----------
    path : tuple of str or int
        Keys from the Config down, as in ``("sections", 2, "length")``.
    value : float
        SI.
    unit : str
    """

    path: tuple[str | int, ...]
    value: float
    unit: str

    @property
    def name(self) -> str:
        """As in the description: ``sections[2].length``."""
        first, *rest = self.path
        return str(first) + "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in rest)

    def changed(self, model: SubstructureModel, value: float) -> SubstructureModel:
        """Return the substructure with another value in this place."""
        return type(model)(_with(model.config, self.path, value))


def entries(model: SubstructureModel) -> tuple[Entry, ...]:
    """Return every physical quantity other than 0 that a substructure's Config holds."""
    return tuple(_walk(model.config, ()))


def _walk(node: Any, path: tuple[str | int, ...]) -> Iterator[Entry]:
    if isinstance(node, BaseModel):
        for name, field in type(node).model_fields.items():
            value = getattr(node, name)
            unit = _unit(field.annotation, field.metadata)
            if unit is not None and isinstance(value, float) and value != 0.0:
                yield Entry((*path, name), value, unit)
            else:
                yield from _walk(value, (*path, name))
    elif isinstance(node, tuple):
        for index, part in enumerate(node):
            yield from _walk(part, (*path, index))


def _unit(annotation: object, metadata: Iterable[object] = ()) -> str | None:
    """Return the unit that an annotation names, also one of several that are accepted."""
    for mark in metadata:
        if isinstance(mark, InUnit):
            return mark.unit
    for part in get_args(annotation):
        unit = _unit(part, getattr(part, "__metadata__", ()))
        if unit is not None:
            return unit
    return None


def _with(node: Any, path: tuple[str | int, ...], value: float) -> Any:
    if not path:
        return value
    key, *rest = path
    if isinstance(key, int):
        return (*node[:key], _with(node[key], tuple(rest), value), *node[key + 1 :])
    return node.model_copy(update={key: _with(getattr(node, key), tuple(rest), value)})
