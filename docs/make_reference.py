"""Writes models.md, options.md and keys.md from the program itself: ``python docs/make_reference.py``."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import typer

sys.path.insert(0, str(Path(__file__).parent))
import make_drawings
from line_length import wrapped

import dovetail
from dovetail import JointModel, SubstructureModel
from dovetail.cli.app import app
from dovetail.cli.terminal import range_text
from dovetail.description import description_schema
from dovetail.registry import Offer, Registry, components
from dovetail.registry.model_description import describe_offer
from dovetail.units import format_quantity

FOLDER = Path(__file__).parent
OWN = "dovetail-frf"
KINDS = {
    "joint": "Joints",
    "substructure": "Substructures",
    "reducer": "Reducers",
    "regressor": "Regressors",
    "method": "Methods of identification",
}
INTERNAL = {"collet": ("c1", "c2", "c3", "c4", "c5")}
"""Nodes that belong to a joint alone."""

MODELS = """# Models

Here you find what each model that ships with Dovetail represents, what it leaves out, its parameters with their units
and ranges, and the order of its DOFs. `dovetail describe MODEL` prints options and parameters on a
terminal, for models of plugins too.

Most parts vibrate in one plane: each node has `x`, the displacement across the axis, and `rz`, the rotation,
$r_z = dx/ds$ along the axis $s$. `spatial_beam` and `bushing` move in all directions, `x y z rx ry rz`; see
[structures in space](space.md). In the drawings a zigzag is a spring and a cylinder a damper, both in `x`. A spiral
is a spring with a damper in `rz`. The ranges are defaults, which a description may change.

This page is made by `python docs/make_reference.py` from the models themselves, the drawings by
`python docs/make_drawings.py`.
"""

OPTIONS = """# Options of every command

Here you find every option of every command, as `--help` prints it. [The command line](commands.md) explains what the
commands are for. This page is made by `python docs/make_reference.py` from the program itself.
"""

KEYS = """# Keys of a description

Here you find every key of a description, its meaning and its default.
[The description of an assembly](description.md) explains the keys with examples.
The keys of a model are on the page of [models](models.md).
This page is made by `python docs/make_reference.py` from the schema that `dovetail schema` writes.
"""

SECTIONS = {
    "description": "The whole",
    "frequency": "`frequency`",
    "orientation": "`substructures.NAME`, in addition to the keys of its model",
    "orientation.PlaceSection": "`substructures.NAME.place`",
    "orientation.TurnSection": "`rotate` of a place or of axes, each",
    "damping": "`joints.NAME`, in addition to the keys of its model",
    "axes": "`joints.NAME.axes`",
    "attachment": "`joints.NAME.connect.PORT`",
    "parameter": "`joints.NAME.parameters.NAME`, and any number with a unit of a part",
    "response": "`response`, and each of `responses`",
    "force": "`response.force`",
    "calibration": "`response.calibration`",
    "shared_calibration": "`calibration`",
    "sensor": "`calibration.at`, each",
    "identification": "`identification`",
    "identification.AugmentationSection": "`identification.augmentation`",
    "identification.CorrectionSection": "`identification.correction`",
    "study": "`study`",
    "study.SearchSection": "`study.search`",
    "study.SearchRange": "`study.search.options.NAME`",
}


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table that the site and a code host both show."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(_cell(cell) for cell in line) + " |\n" for line in lines)


def entries(rows: Iterable[tuple[str, str, Sequence[str]]]) -> str:
    """Return a list of names, what they mean, and facts such as units: lines of a list can be broken, rows cannot."""
    text = ""
    for name, meaning, facts in rows:
        known = "; ".join(_plain(fact) for fact in facts if fact)
        text += f"- {name}{f' ({known})' if known else ''}: {_plain(meaning)}\n"
    return text


def _cell(value: object) -> str:
    """Return a text that stays in its cell, with angles and bars as they are meant."""
    return _plain(value).replace("|", "\\|")


def _plain(value: object) -> str:
    """Return a text in one line, with angles as they are meant."""
    return re.sub(r"<(?=\w)", "&lt;", str(value).replace("\n", " ").replace("``", "`")).strip()


def models(registry: Registry) -> str:
    """Return the page of models."""
    text = MODELS
    for kind, heading in KINDS.items():
        offers = [offer for offer in registry.offers(kind) if offer.source.split()[0] == OWN]
        text += f"\n## {heading}\n"
        text += "".join(_model(offer) for offer in offers)
    return text


def _model(offer: Offer) -> str:
    model, described = offer.component, describe_offer(offer)
    shown = make_drawings.examples().get(model.name)
    kind = f" ({model.kind})" if model.name == "sklearn" else ""
    text = f"\n### `{model.name}`{kind}\n\n{model.summary.rstrip('.')[0].upper()}{model.summary.rstrip('.')[1:]}.\n"
    caption = make_drawings.CAPTIONS.get(model.name)
    if caption:
        about = re.search(r"<title>(.*?)</title>", make_drawings.drawings()[model.name])[1]
        text += f"\n![{about}](drawings/{model.name}.svg)\n\n{caption}\n"
    said = inspect.getdoc(model).replace("``", "`")
    if said.rstrip(".") != model.summary.rstrip("."):
        text += f"\n{_paragraphs(said)}\n"
    if isinstance(shown, JointModel):
        text += "\n" + _parameters(shown) + "\n" + _dofs(shown)
    if isinstance(shown, SubstructureModel):
        text += "\nNodes and DOFs of the drawing:\n\n" + _nodes(shown)
    text += "\n" + _options(described["options"])
    if model.references:
        text += "\nSource: " + "; ".join(model.references) + ".\n"
    return text


def _paragraphs(text: str) -> str:
    plain = text.replace("Notes\n-----\n", "")
    return "\n\n".join(" ".join(block.split()) for block in plain.split("\n\n"))


def _parameters(joint: JointModel) -> str:
    if not joint.parameters:
        return "No parameters.\n"
    rows = []
    for parameter in joint.parameters:
        unit = "" if parameter.unit == "1" else parameter.unit
        rows.append((f"`{parameter.name}`", parameter.description, unit, range_text(parameter), parameter.scale))
    return table(("parameter", "meaning", "SI unit", "range", "scale"), rows)


def _dofs(joint: JointModel) -> str:
    dofs = make_drawings.joint_dofs(joint, INTERNAL.get(joint.name, ()))
    assert sum(len(numbers) for _, numbers in dofs) == joint.size
    directions = list(dofs[0][1])
    rows = [(f"`{name}`", *(numbers[direction] for direction in directions)) for name, numbers in dofs]
    return "Local DOFs, in the order of the joint's matrices:\n\n" + table(("node", *directions), rows)


def _nodes(part: SubstructureModel) -> str:
    """Return the table of a part's nodes; their DOFs, unless it is held."""
    directions = () if part.grounded else part.nodes[0].directions
    rows = [
        (f"`{node.label}`", f"{1e3 * node.position:g} mm", *(part.node_dofs.find(number, each) for each in directions))
        for number, node in enumerate(part.nodes)
        if node.carrier is None
    ]
    return table(("node", "position", *directions), rows)


def _options(options: Sequence[Mapping[str, Any]]) -> str:
    if not options:
        return "No options.\n"
    rows = []
    for option in options:
        default = f"default {_default(option['default'])}" if option["default"] else ""
        rows.append((f"`{option['name']}`", option["description"], (option["type"], option["unit"], default)))
    return entries(rows)


def _default(text: str) -> str:
    return {"True": "true", "False": "false"}.get(text, text)


def options() -> str:
    """Return the page of command options."""
    group = typer.main.get_command(app)
    text = OPTIONS + "\n## `dovetail`\n\n" + _arguments(group)
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        text += f"\n## `dovetail {name}`\n\n{_paragraphs(inspect.cleandoc(command.help))}\n\n{_arguments(command)}"
    return text


def _arguments(command: Any) -> str:
    rows = []
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            named = f"`{parameter.metavar.strip('[]').replace(']...', '...')}`"
        else:
            spelled = [*reversed(parameter.opts), *parameter.secondary_opts]
            value = "" if parameter.metavar is None else f" {parameter.metavar}"
            named = ", ".join(f"`{word}{value if word.startswith('--') else ''}`" for word in spelled)
        rows.append((named, parameter.help or "", ("required" if parameter.required else "",)))
    return entries(rows)


def keys(registry: Registry) -> str:
    """Return the page of a description's keys."""
    schema = description_schema(registry)
    text = KEYS
    for name, heading in SECTIONS.items():
        section = schema["$defs"][name]
        rows = list(_key_rows(section))
        said = " ".join(str(section.get("description", "")).partition("\n\n")[0].replace("``", "`").split())
        text += f"\n## {heading}\n\n" + (f"{said}\n\n" if said else "") + entries(rows)
    return text


def _key_rows(section: Mapping[str, Any]) -> Iterator[tuple[str, str, tuple[str]]]:
    for key, entry in section.get("properties", {}).items():
        default = entry.get("default")
        unit = entry.get("x-unit", "")
        if key in section.get("required", ()):
            shown = "required"
        elif default in (None, [], {}):
            shown = ""
        elif unit and isinstance(default, (int, float)):
            shown = f"default {format_quantity(default, unit)}"
        else:
            shown = f"default `{_default(str(default))}`"
        yield f"`{key}`", entry.get("description", ""), (shown,)


def pages() -> dict[str, str]:
    """Return the text of each page, by its file's name."""
    registry = components(())
    made = {"models.md": models(registry), "options.md": options(), "keys.md": keys(registry)}
    return {name: wrapped(text) for name, text in made.items()}


if __name__ == "__main__":
    print(f"Dovetail {dovetail.__version__}")
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
