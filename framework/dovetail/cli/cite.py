"""``dovetail cite``: how to cite the program and the article of its method."""

from __future__ import annotations

from typing import Annotated

import typer

from dovetail.cli.options import one_of


def cite(
    form: Annotated[
        str, typer.Option("--format", metavar="FORMAT", help="text, bibtex, or cff for the content of CITATION.cff.")
    ] = "text",
) -> None:
    """Print what to cite in a publication that uses Dovetail."""
    from dovetail import citation

    made = {"text": citation.plain, "bibtex": citation.bibtex, "cff": citation.citation_file}
    typer.echo(made[one_of(tuple(made), form, "--format")]())
