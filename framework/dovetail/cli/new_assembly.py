"""``dovetail new-assembly``: a description to begin with."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from dovetail.cli.completion import complete_models
from dovetail.cli.option_names import with_options
from dovetail.cli.options import PluginFiles
from dovetail.cli.terminal import room, say

_Model = typer.Option(metavar="MODEL", help="Model of the joint, such as bolted.", autocompletion=complete_models)
_Part = typer.Option(
    "--part",
    metavar="PART",
    help="Twice: name, length, outer and inner diameter, such as 'hub: 80 mm x 50 mm x 20 mm of steel'.",
)
_Band = typer.Option("--band", metavar="BAND", help="Frequency band, such as '100 Hz to 5 kHz'.")
_Response = typer.Option(metavar="LENGTH", help="Position on the first part where the motion is measured.")
_Quantity = typer.Option(metavar="NAME", help="Measured quantity: receptance, mobility or accelerance.")


def new_assembly(
    file: Annotated[Path, typer.Argument(metavar="NAME.yaml", help="Name of the new file.")],
    joint: Annotated[str | None, _Model] = None,
    part: Annotated[list[str] | None, _Part] = None,
    band: Annotated[str | None, _Band] = None,
    response: Annotated[str | None, _Response] = None,
    quantity: Annotated[str | None, _Quantity] = None,
    plugin: PluginFiles = None,
) -> None:
    """Write a description of two parts and a joint, with comments.

    On a terminal you are asked for what no option gives; elsewhere examples are used. The file passes 'dovetail check'
    as it is and is meant to be edited. Materials: steel, aluminium, titanium, carbide.
    """
    import dovetail
    from dovetail.atomic_files import check_room, write_whole
    from dovetail.description.new_description import EXAMPLE_PARTS, new_description, parse_part, two_sided_joints
    from dovetail.errors import DovetailError, Fault
    from dovetail.registry import components

    if file.suffix.lower() not in (".yaml", ".yml"):
        raise typer.BadParameter(f"'{file}' does not end in .yaml.", param_hint="NAME.yaml")
    if file.exists():
        raise DovetailError(Fault(str(file), "a file of this name already exists.", remedy="Choose another name."))
    check_room(file.resolve().parent)
    registry = components(plugin or ())
    joints = two_sided_joints(registry)
    model = joint or _ask(f"Joint ({', '.join(joints)})", next(iter(joints)))
    if model not in joints:
        registry.find("joint", model)
        raise DovetailError(Fault("--joint", f"'{model}' does not connect two parts end to end.", ", ".join(joints)))
    texts = [*(part or [_ask("First part", EXAMPLE_PARTS[0]), _ask("Second part", EXAMPLE_PARTS[1])])]
    if len(texts) != 2:
        raise typer.BadParameter("a joint connects two parts: give --part twice.", param_hint="--part")
    made, options = joints[model]
    with _usage_errors():
        first, second = (parse_part(text) for text in texts)
        text = new_description(
            file.name,
            made,
            options,
            (first, second),
            band=band or _ask("Band", "100 Hz to 5000 Hz"),
            position=response or _ask(f"Measured where on '{first.name}'", "0 mm"),
            quantity=quantity or _ask("Quantity", "accelerance"),
        )
    file.parent.mkdir(parents=True, exist_ok=True)
    write_whole(file, text.encode(), overwrite=False)
    with _removed_on_error(file):
        dovetail.load(file, plugins=plugin or ())
    say(f"{file}: '{first.name}' and '{second.name}', joined by '{model}'.")
    say(f"Look at it with 'dovetail check {file}', and what you can change with 'dovetail describe {model}'.")


@contextmanager
def _removed_on_error(file: Path) -> Iterator[None]:
    """Remove a file that cannot be read again."""
    from dovetail.errors import DovetailError

    try:
        yield
    except DovetailError:
        file.unlink(missing_ok=True)
        raise


@contextmanager
def _usage_errors() -> Iterator[None]:
    """Report a text that the library does not understand as a wrong option."""
    from dovetail.errors import DescriptionError

    try:
        yield
    except DescriptionError as error:
        (fault,) = error.faults
        raise typer.BadParameter(fault.problem, param_hint=with_options(fault.where)) from None


def _ask(question: str, example: str) -> str:
    if not sys.stdin.isatty():
        return example
    with room():
        return str(typer.prompt(question, example))
