"""``dovetail examples``: the example assemblies and measurements of the package."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.terminal import say


def examples(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="Example to copy, or 'all'; without it, they are listed.")
    ] = None,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where to copy it; created if necessary.")
    ] = Path("assemblies"),
) -> None:
    """List the examples, or copy one of them, or all.

    The pages of the documentation use them from the folder 'assemblies'.
    """
    import shlex

    from dovetail import examples as shipped

    if name is None:
        width = max(map(len, shipped.EXAMPLES))
        for example in shipped.EXAMPLES.values():
            say(f"{example.name:<{width}}  {example.summary}")
        say("Copy one with 'dovetail examples NAME', or everything with 'dovetail examples all'.")
        return
    files = shipped.copy(name, output)
    say(f"{output}: {len(files)} files" if len(files) > 5 else "\n".join(map(str, files)))
    command = "identify-series" if name == "series" else "check"
    say(f"Look at it with {shlex.join(['dovetail', command, str(files[0])])}")
