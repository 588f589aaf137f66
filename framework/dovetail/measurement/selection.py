"""Which FRF of a file is wanted, and how the file calls its parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

__all__ = ["Selection"]


@dataclass(frozen=True)
class Selection:
    """What the caller says about a file's content.

    Parameters
    ----------
    index : int or None
        Number of the FRF, from 1.
    response, force : str or None
        Names of the DOFs.
    names : mapping of str to str
        From a part of the FRF (``frequency``, ``values``, ``coherence``, ...) to its name in the file.
    """

    index: int | None = None
    response: str | None = None
    force: str | None = None
    names: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def chooses(self) -> str:
        """The first option by which the caller chooses one of several FRFs, with its value, or an empty string."""
        for name in ("index", "response", "force"):
            if (value := getattr(self, name)) is not None:
                return f"{name}={value}"
        return ""
