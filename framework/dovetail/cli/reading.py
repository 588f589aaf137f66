"""Options that say what a measured file holds, and which of its FRFs is wanted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

__all__ = ["ForceDof", "Index", "Names", "QuantityOfFile", "ResponseDof", "UnitOfFile", "names_of"]

QuantityOfFile = Annotated[
    str | None,
    typer.Option("--quantity", metavar="QUANTITY", help="receptance, mobility or accelerance, if the file is silent."),
]
UnitOfFile = Annotated[
    str | None, typer.Option("--unit", metavar="UNIT", help="Unit of the values, such as um/N or g/N, if it is silent.")
]
Index = Annotated[
    int | None, typer.Option("--index", metavar="N", min=1, help="Which FRF of a file with several, from 1.")
]
ResponseDof = Annotated[
    str | None, typer.Option("--response", metavar="DOF", help="Response DOF of the FRF that is wanted, such as 5+x.")
]
ForceDof = Annotated[
    str | None, typer.Option("--force", metavar="DOF", help="Force DOF of the FRF that is wanted, such as 1+x.")
]
Names = Annotated[
    list[str] | None,
    typer.Option("--name", metavar="PART=NAME", help="What the file calls a part, as in values=H1. May be repeated."),
]


def names_of(texts: Sequence[str]) -> dict[str, str]:
    """Return ``PART=NAME`` options as a mapping.

    Raises
    ------
    typer.BadParameter
        Not PART=NAME, or a part twice.
    """
    names: dict[str, str] = {}
    for text in texts:
        part, equals, name = (word.strip() for word in text.partition("="))
        if not (part and equals and name) or part in names:
            raise typer.BadParameter(f"'{text}' is not PART=NAME, each part once.", param_hint="--name")
        names[part] = name
    return names
