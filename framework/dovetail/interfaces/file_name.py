"""Annotation of options that name a file."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FileName:
    """Annotation of a text option that is the name of a file, relative to the description.

    Examples
    --------
    >>> from typing import Annotated
    >>> file: Annotated[str, FileName()]
    """
