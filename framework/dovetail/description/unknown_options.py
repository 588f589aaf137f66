"""The options of a substructure that its section does not give as numbers: ranges, priors, values with units, ties."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, ValidationError

from dovetail.description.checked import JointEntry, ParameterEntry, Tie, resolve
from dovetail.description.parameter_sections import DescribedParameters, ends_of, steps_of
from dovetail.description.placed_parts import Placement
from dovetail.description.unknown_parts import UnknownPart, UnknownReceptance
from dovetail.documents.fault_list import FaultList
from dovetail.documents.option_fields import number_unit
from dovetail.documents.tree import Item, Path
from dovetail.errors import PluginError, listing
from dovetail.interfaces import Parameter, SubstructureModel, plugin_errors
from dovetail.registry import Registry
from dovetail.synthesis import Attachment, Connection
from dovetail.units import format_quantity

_NEAR = 0.9
"""Lower end, over the value, of the range within which matrices are differentiated by an option without a range."""
_LONGEST_CHAIN = 20
"""Largest number of ties in a chain; a circle has no end."""
_MOST_DOFS = 600
"""Largest number of DOFs of a part with unknown options, whose matrices are computed again for each FRF."""
_MOST_CORNERS = 64
"""Largest number of corners of the ranges at which a part is tried."""


@dataclass(frozen=True)
class UnknownOptions:
    """The options of a substructure that its section does not give as numbers.

    Parameters
    ----------
    parameters : DescribedParameters
        By their path in the section, such as ``material.young``.
    nominal : mapping of Path to float
        The value with which the part is made, by the same path as steps: that of a known option, the middle of a range.
    """

    parameters: DescribedParameters
    nominal: Mapping[Path, float]


def read_unknown_options(name: str, config: type[BaseModel], faults: FaultList, registry: Registry) -> UnknownOptions:
    """Read the unknown options of a substructure.

    Parameters
    ----------
    name : str
        Of the substructure.
    config : pydantic model class
        The options of its model.
    faults : FaultList
        Collects the faults.
    registry : Registry
    """
    path: Path = ("substructures", name)
    described, nominal = DescribedParameters({}, needs_range=True), dict[Path, float]()
    section = faults.root.at(path)
    for steps, item in _sections_within(section, ()) if section is not None else ():
        unit = number_unit(config, steps)
        if unit is None:
            continue
        option = ".".join(map(str, steps))
        described.known[option] = Parameter(option, unit, 0.0, 1.0)
        described.read((*path, *steps), option, item, faults)
        value = _nominal(described, option, faults)
        if option in described.ties:
            _check_tie(described.ties[option], unit, value, (*path, *steps, "same_as"), faults, registry)
        if value is not None:
            nominal[steps] = value
            _settle(described, option, value, faults)
    return UnknownOptions(described, nominal)


def _settle(described: DescribedParameters, option: str, value: float, faults: FaultList) -> None:
    """Fix an option that is tied to a number, and give one without a range of its own a range around its value."""
    other = _tied_item(described.ties[option], faults) if option in described.ties else None
    if other is not None and not other.is_mapping:
        del described.ties[option]
        described.fixed[option] = value
    if value and (option in described.ties or option in described.fixed):
        lower, upper = sorted((_NEAR * value, value / _NEAR))
        described.known[option] = Parameter(option, described.known[option].unit, lower, upper)


def _check_tie(tie: Tie, unit: str, value: float | None, path: Path, faults: FaultList, registry: Registry) -> None:
    """Report a tie of an option to a parameter of another unit, or to one without a value."""
    config = _config_of(tie.owner, faults, registry)
    other = number_unit(config, steps_of(tie.parameter)) if config is not None else None
    name = f"{tie.owner}.{tie.parameter}"
    if other is not None and other != unit:
        faults.add(path, f"'{name}' is in {other}, but this option is in {unit}.")
    elif value is None:
        faults.add(path, f"'{name}' has no value or range in the description.")


def _config_of(name: str, faults: FaultList, registry: Registry) -> type[BaseModel] | None:
    """Return the options' class of another substructure's model, or None if there is no such model."""
    model = faults.root.at(("substructures", name, "model"))
    if model is None or not isinstance(model.value, str):
        return None
    try:
        return registry.find("substructure", model.value).component.Config
    except PluginError:  # reported where the part is read
        return None


def _sections_within(item: Item, steps: Path) -> Iterator[tuple[Path, Item]]:
    """Yield all mappings within an item, with their paths relative to it."""
    children: Iterator[tuple[str | int, Item]] = iter(())
    if item.is_mapping:
        children = ((key, entry.item) for key, entry in item.entries.items())
    elif isinstance(item.value, tuple):
        children = iter(enumerate(item.value))
    for step, child in children:
        if child.is_mapping:
            yield (*steps, step), child
        yield from _sections_within(child, (*steps, step))


def _nominal(described: DescribedParameters, name: str, faults: FaultList, depth: int = 0) -> float | None:
    """Return a parameter's value, or the middle of its range; None if it is tied to one that has neither."""
    if name in described.fixed:
        return described.fixed[name]
    if name not in described.ties:
        return float(described.known[name].from_unit(np.array(0.5)))
    tie = described.ties[name]
    item = _tied_item(tie, faults)
    if item is None or depth > _LONGEST_CHAIN:
        return None
    other, alone = DescribedParameters({name: described.known[name]}), FaultList()  # reported where it is read
    alone.root = item
    other.read((), name, item, alone)
    value = _nominal(other, name, faults, depth + 1)
    return None if value is None else tie.ratio * value


def _tied_item(tie: Tie, faults: FaultList) -> Item | None:
    """Return the description's entry of the parameter that another one is tied to."""
    steps = steps_of(tie.parameter)
    option = faults.root.at(("substructures", tie.owner, *steps))
    return option if option is not None else faults.root.at(("joints", tie.owner, "parameters", *steps))


def add_unknown_part(
    name: str,
    part: SubstructureModel,
    described: DescribedParameters,
    faults: FaultList,
    placement: Placement | None = None,
) -> JointEntry | None:
    """Return the entry of a substructure with unknown options; if its ranges are impossible, add a fault, return None.

    Parameters
    ----------
    name : str
        Of the substructure.
    part : SubstructureModel
        With the middles of the ranges as options.
    described : DescribedParameters
    faults : FaultList
    placement : Placement, optional
        How the part lies in the assembly, if its axes are not the assembly's.
    """
    with plugin_errors(part, f"substructure '{name}' ({part.name})"):
        kind = UnknownReceptance if part.matrices() is None else UnknownPart
    model = kind(part, tuple(described.known.values()), placement)
    if model.size > _MOST_DOFS:
        problem = f"its options must be known: it has {model.size} DOFs, and its matrices are made anew for each FRF."
        faults.add(("substructures", name), problem, f"{_MOST_DOFS} DOFs or fewer", key=True)
        return None
    for values in _corners(described):
        ties = {option: tie for option, tie in described.ties.items() if tie.owner == name and tie.parameter in values}
        corner = {**values, **{option: tie.ratio * values[tie.parameter] for option, tie in ties.items()}}
        if problem := _objection(model, corner):
            faults.add(("substructures", name, *steps_of(next(iter(corner)))), problem)
            return None
    return JointEntry(connection=Connection(model, Attachment.to_all(name, part)), **described.entry)


def check_tied_options(name: str, entries: Mapping[str, ParameterEntry], faults: FaultList) -> None:
    """Report options that a substructure cannot have with the parameter that they are tied to at an end of its range.

    Options that are tied to an option of the same substructure were tried with it.
    """
    entry, tied = entries[name], defaultdict[tuple[str, str], list[str]](list)
    assert isinstance(entry, JointEntry)
    assert isinstance(entry.connection.model, UnknownPart)
    for option in entry.ties:
        end = resolve(entries, Tie(name, option))
        if end.owner != name:
            tied[end.owner, end.parameter].append(option)
    for (owner, parameter), options in tied.items():
        for value in ends_of(entries, owner, parameter):
            corner = {option: resolve(entries, Tie(name, option)).ratio * value for option in options}
            if problem := _objection(entry.connection.model, corner):
                remedy = f"Narrow the range of '{owner}.{parameter}', to which it is tied."
                faults.add(("substructures", name, *steps_of(options[0])), problem, remedy=remedy)
                break


def _corners(described: DescribedParameters) -> Iterator[dict[str, float]]:
    """Yield both ends of each identified option alone, then corners of the ranges of all of them."""
    free = [p for name, p in described.known.items() if name not in described.fixed and name not in described.ties]
    for parameter in free:
        yield from ({parameter.name: end} for end in (parameter.lower, parameter.upper))
    corners = np.random.default_rng(0).random((_MOST_CORNERS, len(free))) < 0.5
    for upper in np.unique(corners, axis=0) if len(free) > 1 else ():
        yield {p.name: p.upper if high else p.lower for p, high in zip(free, upper, strict=True)}


def _objection(model: UnknownPart, options: Mapping[str, float]) -> str:
    """Return a sentence that says why a part cannot have some options, or an empty text if it can."""
    units = {parameter.name: parameter.unit for parameter in model.parameters}
    said = [format_quantity(value, units[option]) for option, value in options.items()]
    where = f"{said[0]} there"
    if len(said) > 1:
        where = listing((f"{option} = {value}" for option, value in zip(options, said, strict=True)), 20)
    try:
        part = model.made_with(options)
    except ValidationError as error:
        reason = error.errors()[0]["msg"].removeprefix("Value error, ").replace("Input should", "it must")
        return f"the part cannot have {where}: {reason}."
    except (Exception, SystemExit) as error:  # a plugin's constructor may raise anything
        return f"the part cannot have {where}: {type(error).__name__}: {error}"
    if [node.label for node in part.nodes] != [node.label for node in model.part.nodes]:
        return f"with {where} the part has other nodes, so that joints cannot attach to the same ones."
    return ""
