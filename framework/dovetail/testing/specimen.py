"""A component to look at, made from its own examples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dovetail.interfaces import Component

__all__ = ["SEED", "Specimen"]

SEED = 7


@dataclass(frozen=True, eq=False)
class Specimen:
    """A component made from one set of options.

    Parameters
    ----------
    model : type[Component]
    options : mapping
        As a description has them.
    component : Component
    companions : tuple of Specimen
        Made from the other examples.
    """

    model: type[Component]
    options: Mapping[str, Any]
    component: Any
    companions: tuple[Specimen, ...] = ()

    @property
    def label(self) -> str:
        """How messages name the component."""
        return f"{self.model.kind} '{self.model.name}'"
