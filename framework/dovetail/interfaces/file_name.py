"""Annotation of options that name a file."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FileName"]


@dataclass(frozen=True)
class FileName:
    """Annotation of a text option: the name of a file, relative to the description that states it.

    Examples
    --------
    >>> from typing import Annotated
    >>> file: Annotated[str, FileName()]
    """
