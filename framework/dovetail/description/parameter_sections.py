"""What a description says of a parameter: its range, its value, or the parameter to which it is tied."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from dovetail.description.checked import ParameterEntry, Tie, resolve
from dovetail.description.component_sections import LabelledComponent
from dovetail.description.sections import ParameterSection
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Item, Path, format_value, plain_values
from dovetail.documents.validation import validate
from dovetail.errors import UnitError, did_you_mean, listing
from dovetail.interfaces import Parameter, Prior, plugin_errors
from dovetail.units import to_si

_KINDS = ("value", "about", "same_as", "range")
"""A parameter's section has one of these keys."""
_TOGETHER = {"range": ("scale",), "value": (), "about": ("sd", "scale"), "same_as": ("ratio",)}
"""Further keys that each of them allows."""

_NUMBER = re.compile(r"\s*[-+]?[\d.]+(?:[eE][-+]?\d+)?\s*")
_NARROWEST = 1e-6
"""Standard deviation of a prior over its middle, below which nothing is known: its percent sign or unit is missing."""
_WIDEST = 10.0
"""Standard deviation of a log-normal prior over its middle, above which its unit is wrong, or it says nothing."""


@dataclass
class DescribedParameters:
    """What a description says about the parameters of a joint, of a substructure or of a response.

    Attributes
    ----------
    known : dict of str to Parameter
        All of them, with the description's ranges and scales.
    fixed : dict of str to float
        SI values of the known ones.
    ties : dict of str to Tie
    needs_range : bool
        Whether the parameters have no range of their own.
    """

    known: dict[str, Parameter]
    fixed: dict[str, float] = field(default_factory=dict)
    ties: dict[str, Tie] = field(default_factory=dict)
    needs_range: bool = False

    @property
    def entry(self) -> Mapping[str, Any]:
        """The arguments of a `ParameterEntry`."""
        fixed, ties = MappingProxyType(self.fixed), MappingProxyType(self.ties)
        return {"parameters": tuple(self.known.values()), "fixed": fixed, "ties": ties}

    def read(self, path: Path, name: str, item: Item, faults: FaultList) -> None:
        """Read what a value or a section says of a parameter; without a range its own is kept."""
        if not item.is_mapping:
            self._fix(path, name, item, faults)
            return
        before = len(faults)
        section = validate(ParameterSection, path, faults, f"the parameter '{name}'")
        if section is None:
            return
        keys = section.model_fields_set
        if not keys or (self.needs_range and keys == {"scale"}):
            accepted = "range, scale, value, about and sd, or same_as"
            faults.add(path, f"the parameter '{name}' has neither a range nor a value.", accepted, key=True)
            return
        kind = next((kind for kind in _KINDS if kind in keys), "range")
        other = next((key for key in sorted(keys) if key != kind and key not in _TOGETHER[kind]), None)
        if other is not None:
            problem = f"the parameter '{name}' has {_article(kind)} and {_article(other)}."
            faults.add(path, problem, "a range to seek it in, or a value that is known", key=True)
        elif kind == "value":
            value = faults.root.at((*path, "value"))
            assert value is not None
            self._fix((*path, "value"), name, value, faults)
        elif kind == "same_as":
            self._tie(path, name, section, faults)
        elif len(faults) == before:
            read = _with_normal_prior if kind == "about" else _with_range
            self.known[name] = read(path, self.known[name], section, faults)

    def _fix(self, path: Path, name: str, item: Item, faults: FaultList) -> None:
        value = _quantity(path, plain_values(item), self.known[name].unit, faults)
        if value is not None:
            self.fixed[name] = value

    def _tie(self, path: Path, name: str, section: ParameterSection, faults: FaultList) -> None:
        owner, dot, parameter = str(section.same_as).partition(".")
        if not dot:
            accepted = "the name of a joint, substructure or response, a dot and the parameter: 'joint.k'"
            faults.add((*path, "same_as"), f"{format_value(section.same_as)} is not a parameter.", accepted)
            return
        if section.ratio == 0.0:
            faults.add(
                (*path, "ratio"), "a ratio of 0 ties nothing.", remedy="Write 'value: 0' if it is known to be 0."
            )
            return
        self.ties[name] = Tie(owner, parameter, section.ratio)


def _article(key: str) -> str:
    return {"same_as": "'same_as'", "sd": "'sd'"}.get(key, f"a {key}" if key != "about" else "'about'")


def read_parameters(
    model: LabelledComponent, joint: Path, parameters: Sequence[Parameter], faults: FaultList
) -> DescribedParameters:
    """Read what a description says about a joint's parameters.

    Parameters
    ----------
    model : LabelledComponent
        The joint model.
    joint : Path
    parameters : sequence of Parameter
        Those of the model, with the model's ranges.
    faults : FaultList
        Collects the faults.
    """
    path: Path = (*joint, "parameters")
    described = DescribedParameters({parameter.name: parameter for parameter in parameters})
    section = faults.root.at(path)
    if section is None:
        return described
    if not section.is_mapping:
        faults.add(path, f"{format_value(section.value)} is not a section of keys and values.", key=True)
        return described
    for name, entry in section.entries.items():
        if name not in described.known:
            accepted = listing(f"{p.name} [{p.unit}]" for p in parameters) or "no parameters"
            problem = f"{format_value(name)} is not a parameter of {model.label}."
            faults.add((*path, name), problem, accepted, did_you_mean(name, described.known), key=True)
        else:
            described.read((*path, name), name, entry.item, faults)
    return described


def check_ranges(
    model: LabelledComponent, joint: Path, ends: Mapping[str, tuple[float, float]], faults: FaultList
) -> None:
    """Report the ranges and values to which the joint model objects.

    Parameters
    ----------
    model : LabelledComponent
        The joint model.
    joint : Path
    ends : mapping of str to (float, float)
        Lowest and highest value of each parameter.
    faults : FaultList
        Collects the faults.
    """
    lower, upper = ({name: pair[end] for name, pair in ends.items()} for end in (0, 1))
    with plugin_errors(model.component, model.label):
        objections = model.component.range_objections(lower, upper)
    if not isinstance(objections, Mapping):
        faults.add(joint, f"{model.label} gives {objections!r:.80} for its objections, not a mapping.", key=True)
        return
    for name, objection in objections.items():
        faults.add((*joint, "parameters", name), objection, key=True)


def ends_of(entries: Mapping[str, ParameterEntry], owner: str, name: str) -> tuple[float, float]:
    """Return the lowest and the highest value of a parameter; for a tied one, from those of the other."""
    tie = resolve(entries, Tie(owner, name))
    entry = entries[tie.owner]
    parameter = next(p for p in entry.parameters if p.name == tie.parameter)
    known = entry.fixed.get(tie.parameter)
    low, high = sorted(
        tie.ratio * end for end in ((parameter.lower, parameter.upper) if known is None else (known,) * 2)
    )
    return low, high


def check_ties(entries: Mapping[str, ParameterEntry], sections: Mapping[str, Path], faults: FaultList) -> None:
    """Report parameters that are tied to one that does not exist, to one of another unit, or to themselves.

    Parameters
    ----------
    entries : mapping of str to ParameterEntry
        Of each joint, substructure and response, by its name.
    sections : mapping of str to Path
        Where the parameters of each are in the description.
    faults : FaultList
    """
    units = {f"{owner}.{p.name}": p.unit for owner, entry in entries.items() for p in entry.parameters}
    for owner, entry in entries.items():
        for name, tie in entry.ties.items():
            path, other = (*sections[owner], *steps_of(name), "same_as"), f"{tie.owner}.{tie.parameter}"
            if other not in units:
                names = [candidate for candidate in units if candidate != f"{owner}.{name}"]
                faults.add(path, f"there is no parameter '{other}'.", listing(names, 20), did_you_mean(other, names))
            elif units[other] != units[f"{owner}.{name}"]:
                problem = f"'{other}' is in {units[other]}, but '{owner}.{name}' is in {units[f'{owner}.{name}']}."
                faults.add(path, problem)
            elif _is_circle(entries, owner, name):
                faults.add(path, f"'{owner}.{name}' is tied to '{other}', which is tied to it.")


def steps_of(name: str) -> Path:
    """Return the path of an option inside its section, from a name such as ``sections.0.length``."""
    return tuple(int(step) if step.isdecimal() else step for step in name.split("."))


def _is_circle(entries: Mapping[str, ParameterEntry], owner: str, name: str) -> bool:
    seen: set[tuple[str, str]] = set()
    while (owner, name) not in seen:
        seen.add((owner, name))
        tie = entries[owner].ties.get(name) if owner in entries else None
        if tie is None:
            return False
        owner, name = tie.owner, tie.parameter
    return True


def _with_range(path: Path, parameter: Parameter, section: ParameterSection, faults: FaultList) -> Parameter:
    """Return the parameter with the section's range and scale."""
    lower, upper = parameter.lower, parameter.upper
    key: Path = (*path, "scale")
    if section.range:
        key = (*path, "range")
        ends = [_quantity((*key, index), end, parameter.unit, faults) for index, end in enumerate(section.range)]
        if ends[0] is None or ends[1] is None or _lacks_unit(key, section.range, parameter.unit, faults):
            return parameter
        lower, upper = ends[0], ends[1]
    if lower >= upper:
        ends_as_text = " to ".join(format_value(end) for end in section.range)
        faults.add(key, f"the range from {ends_as_text} is empty.", remedy="The lower end comes first.")
        return parameter
    scale = section.scale or parameter.scale
    if scale == "log" and lower <= 0:
        begin = f"{lower:g} {parameter.unit if parameter.unit != '1' else ''}".rstrip()
        problem = f"a range on a logarithmic scale must be positive, but this one begins at {begin}."
        faults.add(key, problem, remedy="Write 'scale: linear', or a lower end greater than 0.")
        return parameter
    prior: Prior = "uniform" if section.range else parameter.prior  # a given range replaces the model's prior
    return replace(parameter, lower=lower, upper=upper, scale=scale, prior=prior)


def _with_normal_prior(path: Path, parameter: Parameter, section: ParameterSection, faults: FaultList) -> Parameter:
    """Return the parameter with a normal prior, or a log-normal one on a logarithmic scale."""
    if "sd" not in section.model_fields_set:
        remedy = "Say how well it is known: 'sd: 2 %', or in its unit."
        faults.add(path, f"the parameter '{parameter.name}' lacks 'sd'.", remedy=remedy, key=True)
        return parameter
    scale = section.scale or "linear"
    middle = _quantity((*path, "about"), section.about, parameter.unit, faults)
    if middle is None:
        return parameter
    deviation = _deviation((*path, "sd"), section.sd, middle, parameter.unit, faults)
    if deviation is None:
        return parameter
    if deviation <= 0:
        faults.add((*path, "sd"), "a standard deviation must be greater than 0.")
        return parameter
    if deviation < _NARROWEST * abs(middle):
        problem = f"the standard deviation is {deviation / abs(middle):.2g} times the middle."
        remedy = "Write it with its unit, or as a part of the middle: 'sd: 2 %'."
        faults.add((*path, "sd"), problem, f"at least {_NARROWEST:g} times", remedy)
        return parameter
    if _lacks_unit((*path, "sd"), (section.about, section.sd), parameter.unit, faults):
        return parameter
    if scale == "log" and middle <= 0:
        faults.add((*path, "about"), "a middle on a logarithmic scale must be positive.")
        return parameter
    if scale == "log" and deviation > _WIDEST * middle:
        problem = f"the standard deviation is {deviation / middle:.3g} times the middle."
        faults.add((*path, "sd"), problem, f"at most {_WIDEST:g} times on a logarithmic scale", "Give a range instead.")
        return parameter
    return Parameter.with_normal_prior(parameter.name, parameter.unit, middle, deviation, scale, parameter.description)


def _lacks_unit(path: Path, values: Sequence[object], unit: str, faults: FaultList) -> bool:
    """Report a number without a unit that is closer to one with a unit if it is in that unit, too."""
    bare = next((value for value in values if _is_bare(value)), None)
    other = next((value for value in values if isinstance(value, str) and not _is_bare(value)), None)
    if bare is None or other is None or "%" in other:
        return False
    number, given, word = to_si(bare, unit), to_si(other, unit), re.sub(_NUMBER, "", other, count=1)
    factor = to_si(f"1 {word}", unit)
    if number * given == 0 or abs(np.log(abs(number * factor / given))) >= abs(np.log(abs(number / given))):
        return False
    problem = f"{format_value(bare)} has no unit, and {format_value(other)} has one."
    remedy = f"A number without a unit is in SI; write its unit, {word} or {unit}."
    faults.add(path, problem, remedy=remedy)
    return True


def _is_bare(value: object) -> bool:
    return not isinstance(value, str) or re.fullmatch(_NUMBER, value) is not None


def _deviation(path: Path, value: object, middle: float, unit: str, faults: FaultList) -> float | None:
    """Return a standard deviation in SI, of which a text such as '2 %' states the part of the middle."""
    if isinstance(value, str) and value.strip().endswith("%"):
        part = _quantity(path, value, "1", faults)
        return None if part is None else part * abs(middle)
    return _quantity(path, value, unit, faults)


def _quantity(path: Path, value: object, unit: str, faults: FaultList) -> float | None:
    if not isinstance(value, (int, float, str)) or isinstance(value, bool):
        faults.add(path, f"{format_value(value)} is not a quantity in {unit}.")
        return None
    try:
        return to_si(value, unit)
    except UnitError as error:
        faults.add(path, error.faults[0].problem)
        return None
