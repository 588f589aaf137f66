"""The section ``parameters:`` of a joint: ranges, scales and known values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from dovetail.assembly.component_sections import LabelledComponent
from dovetail.assembly.sections import ParameterSection
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Item, Path, format_value, plain_values
from dovetail.documents.validation import validate
from dovetail.errors import UnitError, did_you_mean, listing
from dovetail.interfaces import Parameter, plugin_errors
from dovetail.units import to_si

__all__ = ["check_ranges", "read_parameters"]


def read_parameters(
    model: LabelledComponent, joint: Path, parameters: Sequence[Parameter], faults: FaultList
) -> tuple[tuple[Parameter, ...], dict[str, float]]:
    """Read the ranges, scales and values that a description states for a joint's parameters.

    Parameters
    ----------
    model : LabelledComponent
        The joint model.
    joint : Path
    parameters : sequence of Parameter
        Those of the model, with the model's ranges.
    faults : FaultList
        Collects the faults.

    Returns
    -------
    parameters : tuple of Parameter
        With the description's ranges and scales.
    fixed : dict
        SI values of the known parameters.
    """
    path: Path = (*joint, "parameters")
    section = faults.root.at(path)
    if section is None:
        return tuple(parameters), {}
    if not section.is_mapping:
        faults.add(path, f"{format_value(section.value)} is not a section of keys and values.", key=True)
        return tuple(parameters), {}
    known = {parameter.name: parameter for parameter in parameters}
    fixed: dict[str, float] = {}
    for name, entry in section.entries.items():
        if name not in known:
            accepted = listing(f"{p.name} [{p.unit}]" for p in parameters) or "no parameters"
            problem = f"{format_value(name)} is not a parameter of {model.label}."
            faults.add((*path, name), problem, accepted, did_you_mean(name, known), key=True)
        elif entry.item.is_mapping:
            known[name] = _read_section((*path, name), known[name], fixed, faults)
        else:
            _fix((*path, name), known[name], entry.item, fixed, faults)
    return tuple(known.values()), fixed


def check_ranges(
    model: LabelledComponent,
    joint: Path,
    parameters: Sequence[Parameter],
    fixed: Mapping[str, float],
    faults: FaultList,
) -> None:
    """Report the ranges and values to which the joint model objects.

    Parameters
    ----------
    model : LabelledComponent
        The joint model.
    joint : Path
    parameters : sequence of Parameter
        With the description's ranges.
    fixed : mapping of str to float
        SI values of the known parameters.
    faults : FaultList
        Collects the faults.
    """
    lower = {p.name: fixed.get(p.name, p.lower) for p in parameters}
    upper = {p.name: fixed.get(p.name, p.upper) for p in parameters}
    with plugin_errors(model.component, model.label):
        objections = model.component.range_objections(lower, upper)
    if not isinstance(objections, Mapping):
        faults.add(joint, f"{model.label} gives {objections!r:.80} for its objections, not a mapping.", key=True)
        return
    for name, objection in objections.items():
        faults.add((*joint, "parameters", name), objection, key=True)


def _read_section(path: Path, parameter: Parameter, fixed: dict[str, float], faults: FaultList) -> Parameter:
    """Return the parameter with the range of its section, or enter its value in `fixed`."""
    before = len(faults)
    section = validate(ParameterSection, path, faults, f"the parameter '{parameter.name}'")
    if section is None:
        return parameter
    keys = section.model_fields_set
    if not keys:
        faults.add(path, f"nothing is said of the parameter '{parameter.name}'.", "range, scale or value", key=True)
    elif "value" in keys and len(keys) > 1:
        other = "range" if "range" in keys else "scale"
        problem = f"the parameter '{parameter.name}' has a value and a {other}."
        faults.add(path, problem, "a range to seek it in, or a value that is known", key=True)
    elif "value" in keys:
        item = faults.root.at((*path, "value"))
        if item is not None:
            _fix((*path, "value"), parameter, item, fixed, faults)
    elif len(faults) == before:
        return _with_range(path, parameter, section, faults)
    return parameter


def _with_range(path: Path, parameter: Parameter, section: ParameterSection, faults: FaultList) -> Parameter:
    """Return the parameter with the section's range and scale."""
    lower, upper = parameter.lower, parameter.upper
    key: Path = (*path, "scale")
    if section.range:
        key = (*path, "range")
        ends = [_quantity((*key, index), end, parameter.unit, faults) for index, end in enumerate(section.range)]
        if ends[0] is None or ends[1] is None:
            return parameter
        lower, upper = ends[0], ends[1]
    if lower >= upper:
        ends_as_text = " to ".join(format_value(end) for end in section.range)
        faults.add(key, f"the range from {ends_as_text} is empty.")
        return parameter
    scale = section.scale or parameter.scale
    if scale == "log" and lower <= 0:
        problem = f"a range on a logarithmic scale must be positive, but this one begins at {lower:g} {parameter.unit}."
        faults.add(key, problem, remedy="Write 'scale: linear', or a lower end greater than 0.")
        return parameter
    return replace(parameter, lower=lower, upper=upper, scale=scale)


def _fix(path: Path, parameter: Parameter, item: Item, fixed: dict[str, float], faults: FaultList) -> None:
    value = _quantity(path, plain_values(item), parameter.unit, faults)
    if value is not None:
        fixed[parameter.name] = value


def _quantity(path: Path, value: object, unit: str, faults: FaultList) -> float | None:
    if not isinstance(value, (int, float, str)) or isinstance(value, bool):
        faults.add(path, f"{format_value(value)} is not a quantity in {unit}.")
        return None
    try:
        return to_si(value, unit)
    except UnitError as error:
        faults.add(path, error.faults[0].problem)
        return None
