"""The section ``parameters:`` of a joint: ranges, scales and known values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from dovetail.assembly.component_sections import Built
from dovetail.assembly.sections import ParameterSection
from dovetail.documents.fault_list import Findings
from dovetail.documents.tree import Item, Path, plain, shown
from dovetail.documents.validation import validate
from dovetail.errors import UnitError, did_you_mean, listing
from dovetail.interfaces import Parameter, blamed_on
from dovetail.units import to_si

__all__ = ["check_ranges", "read_parameters"]


def read_parameters(
    built: Built, joint: Path, parameters: Sequence[Parameter], findings: Findings
) -> tuple[tuple[Parameter, ...], dict[str, float]]:
    """Read what a description says of a joint's parameters.

    Parameters
    ----------
    built : Built
        The joint model.
    joint : Path
    parameters : sequence of Parameter
        The model's, each with its own range.
    findings : Findings
        Takes in the faults.

    Returns
    -------
    parameters : tuple of Parameter
        With the description's ranges and scales.
    fixed : dict
        SI values of those that are known.
    """
    path: Path = (*joint, "parameters")
    section = findings.root.at(path)
    if section is None:
        return tuple(parameters), {}
    if not section.is_mapping:
        findings.add(path, f"{shown(section.value)} is not a section of keys and values.", key=True)
        return tuple(parameters), {}
    known = {parameter.name: parameter for parameter in parameters}
    fixed: dict[str, float] = {}
    for name, entry in section.entries.items():
        if name not in known:
            accepted = listing(f"{p.name} [{p.unit}]" for p in parameters) or "no parameters"
            problem = f"{shown(name)} is not a parameter of {built.label}."
            findings.add((*path, name), problem, accepted, did_you_mean(name, known), key=True)
        elif entry.item.is_mapping:
            known[name] = _described((*path, name), known[name], fixed, findings)
        else:
            _fix((*path, name), known[name], entry.item, fixed, findings)
    return tuple(known.values()), fixed


def check_ranges(
    built: Built, joint: Path, parameters: Sequence[Parameter], fixed: Mapping[str, float], findings: Findings
) -> None:
    """Report ranges and values to which the joint model objects.

    Parameters
    ----------
    built : Built
        The joint model.
    joint : Path
    parameters : sequence of Parameter
        With the description's ranges.
    fixed : mapping of str to float
        SI values of those that are known.
    findings : Findings
        Takes in the faults.
    """
    lower = {p.name: fixed.get(p.name, p.lower) for p in parameters}
    upper = {p.name: fixed.get(p.name, p.upper) for p in parameters}
    with blamed_on(built.component, built.label):
        objections = built.component.range_objections(lower, upper)
    if not isinstance(objections, Mapping):
        findings.add(joint, f"{built.label} gives {objections!r:.80} for its objections, not a mapping.", key=True)
        return
    for name, objection in objections.items():
        findings.add((*joint, "parameters", name), objection, key=True)


def _described(path: Path, parameter: Parameter, fixed: dict[str, float], findings: Findings) -> Parameter:
    """Return the parameter as its section has it, or enter its value in `fixed`."""
    before = len(findings)
    section = validate(ParameterSection, path, findings, f"the parameter '{parameter.name}'")
    if section is None:
        return parameter
    given = section.model_fields_set
    if not given:
        findings.add(path, f"nothing is said of the parameter '{parameter.name}'.", "range, scale or value", key=True)
    elif "value" in given and len(given) > 1:
        other = "range" if "range" in given else "scale"
        problem = f"the parameter '{parameter.name}' has a value and a {other}."
        findings.add(path, problem, "a range to seek it in, or a value that is known", key=True)
    elif "value" in given:
        item = findings.root.at((*path, "value"))
        if item is not None:
            _fix((*path, "value"), parameter, item, fixed, findings)
    elif len(findings) == before:
        return _ranged(path, parameter, section, findings)
    return parameter


def _ranged(path: Path, parameter: Parameter, section: ParameterSection, findings: Findings) -> Parameter:
    """Return the parameter with the section's range and scale."""
    lower, upper = parameter.lower, parameter.upper
    at: Path = (*path, "scale")
    if section.range:
        at = (*path, "range")
        ends = [_quantity((*at, index), end, parameter.unit, findings) for index, end in enumerate(section.range)]
        if ends[0] is None or ends[1] is None:
            return parameter
        lower, upper = ends[0], ends[1]
    if lower >= upper:
        findings.add(at, f"the range from {shown(section.range[0])} to {shown(section.range[1])} is empty.")
        return parameter
    scale = section.scale or parameter.scale
    if scale == "log" and lower <= 0:
        problem = f"a range on a logarithmic scale must be positive, but this one begins at {lower:g} {parameter.unit}."
        findings.add(at, problem, remedy="Write 'scale: linear', or a lower end greater than 0.")
        return parameter
    return replace(parameter, lower=lower, upper=upper, scale=scale)


def _fix(path: Path, parameter: Parameter, item: Item, fixed: dict[str, float], findings: Findings) -> None:
    value = _quantity(path, plain(item), parameter.unit, findings)
    if value is not None:
        fixed[parameter.name] = value


def _quantity(path: Path, value: object, unit: str, findings: Findings) -> float | None:
    if not isinstance(value, (int, float, str)) or isinstance(value, bool):
        findings.add(path, f"{shown(value)} is not a quantity in {unit}.")
        return None
    try:
        return to_si(value, unit)
    except UnitError as error:
        findings.add(path, error.faults[0].problem)
        return None
