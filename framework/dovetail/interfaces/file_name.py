"""The mark of an option that names a file."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FileName"]


@dataclass(frozen=True)
class FileName:
    """Annotation of a text in a component's Config: the name of a file, taken from the description that says it.

    Examples
    --------
    >>> from typing import Annotated
    >>> file: Annotated[str, FileName()]
    """
