"""``dovetail new-assembly``: a description to begin with."""

from __future__ import annotations

import json
import math
import re
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Annotated, Any

import typer

from dovetail.cli.completion import complete_models
from dovetail.cli.options import PluginFiles
from dovetail.cli.terminal import room, say

if TYPE_CHECKING:
    from dovetail.interfaces import JointModel
    from dovetail.registry import Registry

_MATERIALS = {
    "steel": (206, 7850, 0.3),
    "aluminium": (70, 2700, 0.33),
    "titanium": (114, 4430, 0.34),
    "carbide": (580, 14450, 0.22),
}
"""Young's modulus [GPa], density [kg/m^3] and Poisson's ratio."""
_PARTS = "shaft: 160 mm x 20 mm of steel", "hub: 80 mm x 50 mm x 20 mm of steel"
_PART = re.compile(r"(\w+) *: *([^x]+) x ([^x]+?)(?: x ([^x]+?))? of (\w+)")
_BAND = re.compile(r"(.+?) to (.+)")
_SPACING = 10e-3
"""Distance of the nodes of a contact [m], for a joint without an option `length`."""
_ELEMENTS = 12.0
"""Number of elements in a bending wavelength at the end of the band, twice as many as are needed."""


@dataclass(frozen=True)
class _Part:
    name: str
    length: float
    outer: float
    inner: float
    material: str

    def described(self, template: str, cuts: set[float], contact: float, gaps: int, highest: float) -> str:
        """Return the part's entry: sections between the cuts [m], that of the contact with an element in each gap."""
        ends = pairwise(sorted({round(cut, 9) for cut in cuts}))
        lengths = [round(end - begin, 9) for begin, end in ends]
        sections = [self._section(length, highest, gaps if length == round(contact, 9) else 1) for length in lengths]
        material = dict(zip(("young", "density", "poisson"), _MATERIALS[self.material], strict=True))
        words = {"part": self.name, "sections": "\n".join(sections), "material": self.material, **material}
        return Template(template).substitute(words).rstrip()

    def _section(self, length: float, highest: float, least: int) -> str:
        """Return a section of the part, with elements for bending waves up to a frequency [Hz]."""
        young, density, _ = _MATERIALS[self.material]
        gyration = math.hypot(self.outer, self.inner) / 4.0
        wave = math.sqrt(2.0 * math.pi * gyration / highest * math.sqrt(1e9 * young / density))
        elements = least * math.ceil(_ELEMENTS * length / wave / least)
        bore = f", inner: {_mm(self.inner)}" if self.inner else ""
        return f"      - {{length: {_mm(length)}, outer: {_mm(self.outer)}{bore}, elements: {elements}}}"


def new_assembly(
    file: Annotated[Path, typer.Argument(metavar="NAME.yaml", help="The description to write.")],
    joint: Annotated[
        str | None, typer.Option(metavar="MODEL", help="Of the joint, such as bolted.", autocompletion=complete_models)
    ] = None,
    part: Annotated[
        list[str] | None,
        typer.Option(metavar="PART", help=f"Length, outer and inner diameter, such as '{_PARTS[1]}'. Twice."),
    ] = None,
    band: Annotated[str | None, typer.Option(metavar="BAND", help="Such as '100 Hz to 5 kHz'.")] = None,
    response: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Where on the first part the motion is measured.")
    ] = None,
    quantity: Annotated[
        str | None, typer.Option(metavar="NAME", help="receptance, mobility or accelerance, as measured.")
    ] = None,
    plugin: PluginFiles = None,
) -> None:
    """Write a description of two parts and a joint, with comments.

    What no option says is asked on a terminal, and is an example elsewhere. The description passes 'dovetail check' as
    it is; then make it yours. Materials: steel, aluminium, titanium, carbide.
    """
    import dovetail
    from dovetail.atomic_files import write_whole
    from dovetail.errors import DovetailError, Fault
    from dovetail.registry import components

    if file.suffix.lower() not in (".yaml", ".yml"):
        raise typer.BadParameter(f"'{file}' does not end in .yaml.", param_hint="NAME.yaml")
    if file.exists():
        raise DovetailError(Fault(str(file), "there is such a file already.", remedy="Choose another name."))
    registry = components(plugin or ())
    joints = _two_sided(registry)
    model = joint or _ask(f"Joint ({', '.join(joints)})", next(iter(joints)))
    if model not in joints:
        registry.find("joint", model)
        raise DovetailError(Fault("--joint", f"'{model}' has not two ports.", ", ".join(joints)))
    texts = [*(part or [_ask("First part", _PARTS[0]), _ask("Second part", _PARTS[1])])]
    if len(texts) != 2:
        raise typer.BadParameter("a joint connects two parts: give --part twice.", param_hint="--part")
    first, second = (_part(text) for text in texts)
    made, options = joints[model]
    text = _description(
        file,
        made,
        options,
        (first, second),
        band=band or _ask("Band", "100 Hz to 5000 Hz"),
        position=response or _ask(f"Measured where on '{first.name}'", "0 mm"),
        quantity=quantity or _ask("Quantity", "accelerance"),
    )
    write_whole(file, text.encode(), overwrite=False)
    try:
        dovetail.load(file, plugins=plugin or ())
    except DovetailError:
        file.unlink(missing_ok=True)
        raise
    say(f"{file}: '{first.name}' and '{second.name}', joined by '{model}'.")
    say(f"Look at it with 'dovetail check {file}', and what you can change with 'dovetail describe {model}'.")


def _ask(question: str, example: str) -> str:
    if not sys.stdin.isatty():
        return example
    with room():
        return str(typer.prompt(question, example))


def _two_sided(registry: Registry) -> dict[str, tuple[JointModel, dict[str, Any]]]:
    """Return the joints with two ports, the simplest first, with the options of their first example."""
    joints = {}
    for offer in registry.offers("joint"):
        model: Any = offer.component
        with tempfile.TemporaryDirectory() as folder:
            try:
                options = dict(model.examples(Path(folder))[0])
                made = model(model.Config.model_validate(options))
                if len(made.ports) == 2:
                    joints[model.name] = made, options
            except Exception:  # a stranger's model may raise anything, and is left out
                continue
    simple = {name: (not made.parameters, len(made.parameters), made.size) for name, (made, _) in joints.items()}
    return {name: joints[name] for name in sorted(joints, key=lambda name: simple[name])}


def _part(text: str) -> _Part:
    match = _PART.fullmatch(" ".join(text.split()))
    if match is None or match[5] not in _MATERIALS:
        problem = f"'{text}' is not such as '{_PARTS[1]}'. Materials: {', '.join(_MATERIALS)}."
        raise typer.BadParameter(problem, param_hint="--part")
    length, outer, inner = (_si(size or "0", "m", "--part") for size in match.groups()[1:4])
    if not 0.0 <= inner < outer or length <= 0.0:
        raise typer.BadParameter(
            f"'{text}': a length is above 0, and the bore smaller than the part.", param_hint="--part"
        )
    return _Part(match[1], length, outer, inner, match[5])


def _si(text: str, unit: str, option: str) -> float:
    from dovetail.errors import UnitError
    from dovetail.units import to_si

    try:
        return to_si(text, unit)
    except UnitError as error:
        raise typer.BadParameter(error.faults[0].problem, param_hint=option) from None


def _description(
    file: Path,
    joint: JointModel,
    options: dict[str, Any],
    pair: tuple[_Part, _Part],
    *,
    band: str,
    position: str,
    quantity: str,
) -> str:
    """Return the text of the description; the first part ends with the contact, and the second begins with it."""
    ends = _BAND.fullmatch(band)
    if ends is None:
        raise typer.BadParameter(f"'{band}' is not such as '100 Hz to 5 kHz'.", param_hint="--band")
    start, stop = (_si(end, "Hz", "--band") for end in ends.groups())
    gaps = max(port.nodes for port in joint.ports) - 1
    declared = joint.ports[0].positions
    contact = _SPACING * gaps if declared is None else declared[-1] - declared[0]
    for part in pair:
        if part.length <= contact:
            problem = f"'{part.name}' is not longer than the contact, {_mm(contact)}."
            raise typer.BadParameter(problem, param_hint="--part")
    first, second = pair
    place, outside = _si(position, "m", "--response"), first.length - contact
    if not 0.0 <= place <= first.length:
        raise typer.BadParameter(f"'{first.name}' is from 0 to {_mm(first.length)}.", param_hint="--response")
    whole, of_part = (files("dovetail.cli") / "assembly.yaml.template").read_text(encoding="utf-8").split("=====\n")
    cuts = {0.0, place, outside, first.length}, {0.0, contact, second.length}
    described = [part.described(of_part, at, contact, gaps, stop) for part, at in zip(pair, cuts, strict=True)]
    connect = []
    for port, part, offset in zip(joint.ports, pair, (outside, 0.0), strict=True):
        at = ", ".join(_mm(offset + contact * node / max(port.nodes - 1, 1)) for node in range(port.nodes))
        connect.append(f"      {port.name}: {{to: {part.name}, at: [{at}]}}")
    return Template(whole).substitute(
        file=file.name,
        name=re.sub(r"[^\w .+-]", "-", file.stem).lstrip("_.+- ") or "assembly",
        start=f"{start:g}",
        stop=f"{stop:g}",
        parts="\n".join(described),
        joint=joint.name,
        options="".join(f"\n    {key}: {json.dumps(value)}" for key, value in options.items()),
        connect="\n".join(connect),
        parameters="".join(_parameters(joint)) or " {}",
        at=first.name,
        position=_mm(place),
        quantity=quantity,
    )


def _parameters(joint: JointModel) -> Iterator[str]:
    """Yield a line for each parameter with its range and its description."""
    for parameter in joint.parameters:
        unit = "" if parameter.unit == "1" else f" {parameter.unit}"
        ends = f"{parameter.lower:g}{unit}, {parameter.upper:g}{unit}"
        text = " ".join(parameter.description.split())
        yield f"\n      {parameter.name}: {{range: [{ends}], scale: {parameter.scale}}}   # {text}"


def _mm(length: float) -> str:
    return f"{1e3 * length:.9g} mm"
