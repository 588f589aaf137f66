"""A description to begin with: two parts and a joint, with comments."""

from __future__ import annotations

import json
import math
import re
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from string import Template
from typing import Any

from dovetail.errors import DescriptionError, Fault, UnitError, argument
from dovetail.interfaces import PLANAR, JointModel
from dovetail.registry import Registry
from dovetail.units import to_si

_MATERIALS = {
    "steel": (206, 7850, 0.3),
    "aluminium": (70, 2700, 0.33),
    "titanium": (114, 4430, 0.34),
    "carbide": (580, 14450, 0.22),
}
"""Young's modulus [GPa], density [kg/m^3] and Poisson's ratio."""
EXAMPLE_PARTS = "shaft: 160 mm x 20 mm of steel", "hub: 80 mm x 50 mm x 20 mm of steel"
_PART = re.compile(r"(\w+) *: *([^x]+) x ([^x]+?)(?: x ([^x]+?))? of (\w+)")
_BAND = re.compile(r"(.+?) to (.+)")
_SPACING = 10e-3
"""Distance of the nodes of a contact [m], for a joint without an option `length`."""
_ELEMENTS = 12.0
"""Number of elements in a bending wavelength at the end of the band, twice as many as are needed."""
_PART_ARGUMENT = argument("part")


@dataclass(frozen=True)
class NewPart:
    """A part of two that a joint connects [m]; a full cylinder has the inner diameter 0."""

    name: str
    length: float
    outer: float
    inner: float
    material: str

    def described(self, template: str, model: str, cuts: set[float], contact: float, gaps: int, highest: float) -> str:
        """Return the part's entry: sections between the cuts [m], that of the contact with an element in each gap."""
        ends = pairwise(sorted({round(cut, 9) for cut in cuts}))
        lengths = [round(end - begin, 9) for begin, end in ends]
        sections = [self._section(length, highest, gaps if length == round(contact, 9) else 1) for length in lengths]
        material = dict(zip(("young", "density", "poisson"), _MATERIALS[self.material], strict=True))
        words = {
            "part": self.name,
            "model": model,
            "sections": "\n".join(sections),
            "material": self.material,
            **material,
        }
        return Template(template).substitute(words).rstrip()

    def _section(self, length: float, highest: float, least: int) -> str:
        """Return a section of the part, with elements for bending waves up to a frequency [Hz]."""
        young, density, _ = _MATERIALS[self.material]
        gyration = math.hypot(self.outer, self.inner) / 4.0
        wave = math.sqrt(2.0 * math.pi * gyration / highest * math.sqrt(1e9 * young / density))
        elements = least * math.ceil(_ELEMENTS * length / wave / least)
        bore = f", inner: {_mm(self.inner)}" if self.inner else ""
        return f"      - {{length: {_mm(length)}, outer: {_mm(self.outer)}{bore}, elements: {elements}}}"


def two_sided_joints(registry: Registry) -> dict[str, tuple[JointModel, dict[str, Any]]]:
    """Return the joints that connect two parts end to end, the simplest first, with their first example's options."""
    joints = {}
    for offer in registry.offers("joint"):
        model: Any = offer.component
        with tempfile.TemporaryDirectory() as folder:
            try:
                options = dict(model.examples(Path(folder))[0])
                made = model(model.Config.model_validate(options))
                apart = made.acts_along_its_nodes or made.carries_its_nodes  # needs parts with a place in space
                if len(made.ports) == 2 and not apart:
                    joints[model.name] = made, options
            except Exception:  # a stranger's model may raise anything, and is left out
                continue
    simple = {name: (not made.parameters, len(made.parameters), made.size) for name, (made, _) in joints.items()}
    return {name: joints[name] for name in sorted(joints, key=lambda name: simple[name])}


def parse_part(text: str) -> NewPart:
    """Return a part from its length, its diameters and its material, such as `EXAMPLE_PARTS`."""
    match = _PART.fullmatch(" ".join(text.split()))
    if match is None or match[5] not in _MATERIALS:
        problem = f"'{text}' is not such as '{EXAMPLE_PARTS[1]}'. Materials: {', '.join(_MATERIALS)}."
        raise DescriptionError(Fault(_PART_ARGUMENT, problem))
    length, outer, inner = (_si(size or "0", "m", _PART_ARGUMENT) for size in match.groups()[1:4])
    if not 0.0 <= inner < outer or length <= 0.0:
        problem = f"'{text}': a length is above 0, and the bore smaller than the part."
        raise DescriptionError(Fault(_PART_ARGUMENT, problem))
    return NewPart(match[1], length, outer, inner, match[5])


def new_description(
    name: str,
    joint: JointModel,
    options: dict[str, Any],
    pair: tuple[NewPart, NewPart],
    *,
    band: str,
    position: str,
    quantity: str,
) -> str:
    """Return the text of a description of two parts and a joint, with comments.

    Parameters
    ----------
    name : str
        Of the file.
    joint : JointModel
        With two ports, see `two_sided_joints`.
    options : dict
        Of the joint.
    pair : tuple of NewPart
        The first ends with the contact, and the second begins with it.
    band, position, quantity : str
        Such as ``"100 Hz to 5 kHz"``, ``"0 mm"`` on the first part, and ``"accelerance"``.

    Raises
    ------
    DescriptionError
        A text that cannot be understood, or a part that is shorter than the contact.
    """
    ends = _BAND.fullmatch(band)
    if ends is None:
        raise DescriptionError(Fault(argument("band"), f"'{band}' is not such as '100 Hz to 5 kHz'."))
    start, stop = (_si(end, "Hz", argument("band")) for end in ends.groups())
    gaps = max(port.nodes for port in joint.ports) - 1
    declared = joint.ports[0].positions
    contact = _SPACING * gaps if declared is None else declared[-1] - declared[0]
    for part in pair:
        if part.length <= contact:
            problem = f"'{part.name}' is not longer than the contact, {_mm(contact)}."
            raise DescriptionError(Fault(_PART_ARGUMENT, problem))
    first, second = pair
    place, outside = _si(position, "m", argument("response")), first.length - contact
    if not 0.0 <= place <= first.length:
        problem = f"'{first.name}' is from 0 to {_mm(first.length)}."
        raise DescriptionError(Fault(argument("response"), problem))
    whole, per_part = (
        (files("dovetail.description") / "assembly.yaml.template").read_text(encoding="utf-8").split("=====\n")
    )
    cuts = {0.0, place, outside, first.length}, {0.0, contact, second.length}
    in_a_plane = all({*port.directions} <= {*PLANAR} for port in joint.ports)
    model = "timoshenko_beam" if in_a_plane else "spatial_beam"
    described = [part.described(per_part, model, at, contact, gaps, stop) for part, at in zip(pair, cuts, strict=True)]
    connect = []
    for port, part, offset in zip(joint.ports, pair, (outside, 0.0), strict=True):
        at = ", ".join(_mm(offset + contact * node / max(port.nodes - 1, 1)) for node in range(port.nodes))
        connect.append(f"      {port.name}: {{to: {part.name}, at: [{at}]}}")
    return Template(whole).substitute(
        file=name,
        name=re.sub(r"[^\w .+-]", "-", Path(name).stem).lstrip("_.+- ") or "assembly",
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


def _si(text: str, unit: str, where: str) -> float:
    try:
        return to_si(text, unit)
    except UnitError as error:
        raise DescriptionError(Fault(where, error.faults[0].problem)) from None


def _parameters(joint: JointModel) -> Iterator[str]:
    """Yield a line for each parameter with its range and its description."""
    for parameter in joint.parameters:
        unit = "" if parameter.unit == "1" else f" {parameter.unit}"
        ends = f"{parameter.lower:g}{unit}, {parameter.upper:g}{unit}"
        text = " ".join(parameter.description.split())
        yield f"\n      {parameter.name}: {{range: [{ends}], scale: {parameter.scale}}}   # {text}"


def _mm(length: float) -> str:
    return f"{1e3 * length:.9g} mm"
