"""A component under test, constructed from its examples."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dovetail.interfaces import Component

SEED = 7
"""Of all random numbers of the checks, so that these are repeatable."""


@dataclass(frozen=True, eq=False)
class Specimen:
    """A component constructed from one set of options.

    Parameters
    ----------
    model : type[Component]
    options : mapping
        As in a description.
    component : Component
    companions : tuple of Specimen
        Constructed from the other examples.
    """

    model: type[Component]
    options: Mapping[str, Any]
    component: Any
    companions: tuple[Specimen, ...] = ()

    @property
    def label(self) -> str:
        """Name of the component in messages."""
        return f"{self.model.kind} '{self.model.name}'"
