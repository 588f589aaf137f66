"""Reading of a description: its sections one by one, all faults collected, and the `Description` without faults.

Substructures are read here, the other sections in modules of their own.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, TypeVar

from dovetail.description.checked import (
    SHARED,
    Description,
    JointEntry,
    ParameterEntry,
)
from dovetail.description.component_sections import (
    LabelledComponent,
    find_model,
    make_component,
    read_property,
)
from dovetail.description.facing import check_facing
from dovetail.description.frequency_lines import read_frequency
from dovetail.description.identification_settings import read_identification
from dovetail.description.joint_sides import sides_of
from dovetail.description.joints import Substructures, add_model_faults, check_connected, read_joint
from dovetail.description.parameter_sections import check_ranges, check_ties, ends_of
from dovetail.description.placed_parts import OrientationSection, PlacedPart, Placement
from dovetail.description.responses import RESPONSE, RESPONSES, calibration_place, read_responses
from dovetail.description.sections import (
    FORMAT,
    DescriptionSection,
    DescriptionSectionOfSeveral,
)
from dovetail.description.study_section import read_study
from dovetail.description.unknown_options import (
    UnknownOptions,
    add_unknown_part,
    check_tied_options,
    read_unknown_options,
)
from dovetail.documents.extends import read_source
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Path, format_value, plain_values
from dovetail.documents.validation import check_format, validate
from dovetail.interfaces import SubstructureModel, node_faults
from dovetail.registry import Offer, Registry

_Entry = TypeVar("_Entry")


def read_description(
    source: str | os.PathLike[str] | Mapping[str, Any], registry: Registry, files_in: str | None = None
) -> Description:
    """Read and check an assembly description.

    Parameters
    ----------
    source : path or mapping
        A YAML file, or the same as a dict.
    registry : Registry
        The components that the description may name.
    files_in : str, optional
        The folder in which all files that it names must lie.

    Returns
    -------
    Description

    Raises
    ------
    DescriptionError
        Every fault of the description, in the order of its text.
    """
    faults = FaultList()
    faults.files_in = files_in
    name, faults.root = read_source(source, faults)
    check_format(faults, "dovetail", FORMAT, "the description does not say which format it has.")
    several = faults.root.at(RESPONSES) is not None
    top = validate(DescriptionSectionOfSeveral if several else DescriptionSection, (), faults, "the description")
    frequency, left_out = read_frequency(faults)
    substructures, unknown_parts, placements = _read_substructures(faults, registry)
    placed_parts = _placed(substructures, placements)
    joints = _read_joints(placed_parts, substructures, placements, faults, registry)
    responses, calibrations, sensors = read_responses(placed_parts, faults)
    identification = read_identification(responses, faults, registry)
    study = read_study(faults)
    faults.raise_if_any()
    assert top is not None
    assert frequency is not None
    assert identification is not None
    sound_substructures, sound_joints = _without_none(substructures), _without_none(joints)
    _check_parameters(sound_joints, unknown_parts, calibrations, faults)
    check_connected(sound_substructures, sound_joints, responses, faults)
    faults.raise_if_any()
    return Description(
        name=top.name,
        source=name,
        text=json.dumps(plain_values(faults.root), indent=2, ensure_ascii=False, allow_nan=False),
        frequency=frequency,
        substructures=sound_substructures,
        joints=sound_joints,
        responses=responses,
        identification=identification,
        unknown_parts=MappingProxyType(unknown_parts),
        calibrations=MappingProxyType(calibrations),
        sensors=sensors,
        left_out=left_out,
        study=study,
        files=MappingProxyType(faults.files),
        placements=MappingProxyType(placements),
    )


def _without_none(entries: Mapping[str, _Entry | None]) -> Mapping[str, _Entry]:
    return MappingProxyType({name: entry for name, entry in entries.items() if entry is not None})


def _check_parameters(
    joints: Mapping[str, JointEntry],
    substructures: Mapping[str, JointEntry],
    calibrations: Mapping[str, ParameterEntry],
    faults: FaultList,
) -> None:
    """Report parameters of different owners with one name, and ties to parameters that do not exist."""
    for name in substructures:
        if name in joints:
            problem = f"a joint has the name '{name}' too, so that their parameters have the same names."
            faults.add(("substructures", name), problem, key=True)
    for name in calibrations:
        if name in joints or name in substructures:
            kind = "joint" if name in joints else "substructure"
            problem, remedy = f"the response has the name of a {kind}, '{name}'.", "Give it another one with 'name:'."
            if name == SHARED:
                problem, remedy = f"a {kind} has the name '{name}' too.", f"Give the {kind} another one."
            faults.add((SHARED,) if name == SHARED else RESPONSE, problem, remedy=remedy, key=True)
    places: dict[str, Path] = {name: ("joints", name, "parameters") for name in joints}
    places |= {name: ("substructures", name) for name in substructures}
    places |= {name: calibration_place(name, faults) for name in calibrations}
    entries = {**joints, **substructures, **calibrations}
    check_ties(entries, places, faults)
    for name, joint in joints.items() if not len(faults) else ():
        if joint.ties:
            model = joint.connection.model
            ends = {parameter.name: ends_of(entries, name, parameter.name) for parameter in joint.parameters}
            check_ranges(LabelledComponent(model, f"joint '{name}' ({model.name})"), ("joints", name), ends, faults)
    for name in substructures if not len(faults) else ():
        check_tied_options(name, entries, faults)


def _names(section: str, noun: str, faults: FaultList) -> list[str]:
    """Return the names that the author chose in a section, and report those that are not identifiers."""
    item = faults.root.at((section,))
    names = list(item.entries) if item is not None else []
    for name in names:
        if not name.isidentifier():
            problem = f"{format_value(name)} cannot be the name of a {noun}."
            accepted = "letters, digits and '_', not beginning with a digit"
            faults.add((section, name), problem, accepted, key=True)
    return names


def _read_substructures(
    faults: FaultList, registry: Registry
) -> tuple[dict[str, SubstructureModel | None], dict[str, JointEntry], dict[str, Placement]]:
    """Return the substructures, with the middles of unknown options, the entries of those with some, the placements."""
    section = faults.root.at(("substructures",))
    if section is not None and section.is_mapping and not section.entries:
        faults.add(("substructures",), "there are no substructures.", key=True)
    substructures, unknown_parts = dict[str, SubstructureModel | None](), dict[str, JointEntry]()
    placements = dict[str, Placement]()
    for name in _names("substructures", "substructure", faults):
        substructures[name] = None
        offer = find_model("substructure", ("substructures", name), faults, registry)
        if offer is None:
            continue
        before = len(faults)
        options = read_unknown_options(name, offer.component.Config, faults, registry)
        part = _make_substructure(name, offer, options, faults) if len(faults) == before else None
        if part is None:
            continue
        placement = _read_placement(name, part, faults)
        if len(faults) > before:
            continue
        substructures[name] = part
        placements |= {} if placement is None else {name: placement}
        if options.parameters.known:
            entry = add_unknown_part(name, part, options.parameters, faults, placement)
            unknown_parts |= {} if entry is None else {name: entry}
    return substructures, unknown_parts, placements


def _placed(
    substructures: Mapping[str, SubstructureModel | None], placements: Mapping[str, Placement]
) -> dict[str, SubstructureModel | None]:
    """Return the parts as they lie in the assembly."""
    return {
        name: part if part is None or name not in placements else PlacedPart(part, placements[name])
        for name, part in substructures.items()
    }


def _read_placement(name: str, part: SubstructureModel, faults: FaultList) -> Placement | None:
    """Return how a substructure lies in the assembly; None if its axes are the assembly's."""
    path: Path = ("substructures", name)
    section = faults.root.at(path)
    keys = OrientationSection.model_fields.keys() - part.Config.model_fields.keys()
    if section is None or keys.isdisjoint(section.entries):
        return None  # absent, or an option of the model itself
    others = [key for key in section.entries if key not in keys]
    orientation = validate(OrientationSection, path, faults, f"'{name}'", reserved=others)
    placement = None if orientation is None else orientation.placement
    if placement is not None and (problem := placement.problem(part.nodes)):
        faults.add((*path, "place"), problem)
        return None
    return placement


def _make_substructure(name: str, offer: Offer, options: UnknownOptions, faults: FaultList) -> SubstructureModel | None:
    path, keys = ("substructures", name), tuple(OrientationSection.model_fields)
    model = make_component(offer, path, faults, reserved=keys, instead=options.nominal)
    if model is None:
        return None
    before = len(faults)
    nodes = read_property(model, "nodes", path, faults)
    if len(faults) == before:
        add_model_faults(model, node_faults(nodes), path, faults)
    if len(faults) == before and not nodes:
        faults.add(path, f"{model.label} has no nodes.", key=True)
    substructure: SubstructureModel = model.component
    return substructure if len(faults) == before else None


def _read_joints(
    placed_parts: Substructures,
    described: Substructures,
    placements: Mapping[str, Placement],
    faults: FaultList,
    registry: Registry,
) -> dict[str, JointEntry | None]:
    joints = {name: read_joint(name, placed_parts, faults, registry) for name in _names("joints", "joint", faults)}
    sound = {name: part for name, part in described.items() if part is not None}
    for name, joint in joints.items():
        if joint is not None:
            sides = sides_of(joint.connection, sound, placements)
            check_facing(("joints", name), joint.connection.model, sides, faults)
    return joints
