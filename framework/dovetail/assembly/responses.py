"""The responses of a description: where motion is measured, where the force acts, and the chains between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from dovetail.assembly.calibration import read_calibration
from dovetail.assembly.description import ParameterEntry, Place, Response
from dovetail.assembly.joints import Substructures, find_node
from dovetail.assembly.sections import ForceSection, ResponseSection
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Path, format_path, format_value
from dovetail.documents.validation import validate
from dovetail.errors import did_you_mean, listing
from dovetail.synthesis import Point

__all__ = ["RESPONSE", "RESPONSES", "calibration_place", "read_responses"]

RESPONSE: Path = ("response",)
RESPONSES: Path = ("responses",)


def read_responses(
    substructures: Substructures, faults: FaultList
) -> tuple[tuple[Response, ...], dict[str, ParameterEntry]]:
    """Return the responses in their order, without those that have faults, and their calibrations by name.

    Parameters
    ----------
    substructures : mapping of str to SubstructureModel or None
        None in place of a substructure with faults.
    faults : FaultList
    """
    single, several = faults.root.at(RESPONSE), faults.root.at(RESPONSES)
    if several is None:
        return _read_all([] if single is None else [RESPONSE], substructures, faults)
    if single is not None:
        remedy = "Keep one of them: a single response, or the list of all."
        faults.add(RESPONSE, "the description has 'response' and 'responses'.", remedy=remedy, key=True)
    if not isinstance(several.value, tuple):
        remedy = "Begin each entry with '- at:'."
        faults.add(RESPONSES, f"{format_value(several.value)} is not a list of responses.", remedy=remedy, key=True)
        return (), {}
    if not several.value:
        faults.add(RESPONSES, "there are no responses.", key=True)
    return _read_all([(*RESPONSES, index) for index in range(len(several.value))], substructures, faults)


def _read_all(
    paths: Sequence[Path], substructures: Substructures, faults: FaultList
) -> tuple[tuple[Response, ...], dict[str, ParameterEntry]]:
    first_at: dict[tuple[Point, Point], Path] = {}
    responses, calibrations = list[Response](), dict[str, ParameterEntry]()
    for number, path in enumerate(paths, start=1):
        section = validate(ResponseSection, path, faults, f"'{format_path(path)}'")
        if section is None:
            continue
        name = section.name or ("response" if path == RESPONSE else f"response_{number}")
        response = _read_response(path, name, section, substructures, faults)
        if name in [other.name for other in responses]:
            faults.add((*path, "name"), f"another response has the name '{name}'.")
        calibration = read_calibration((*path, "calibration"), faults)
        if calibration.parameters:
            calibrations[name] = calibration
        if response is None:
            continue
        responses.append(response)
        points = response.point, response.force_point
        first = first_at.setdefault(points, path)
        if first != path and not section.name:
            remedy = "Average measurements of the same point, or give this one a 'name', as another level of the force."
            faults.add(path, f"this is the same point as {format_path(first)}.", remedy=remedy, key=True)
    return tuple(responses), calibrations


def calibration_place(name: str, faults: FaultList) -> Path:
    """Return where the calibration of the response with this name is."""
    several = faults.root.at(RESPONSES)
    if several is None or not isinstance(several.value, tuple):
        return (*RESPONSE, "calibration")
    named = (
        index
        for index, item in enumerate(several.value)
        if name == (item.entries["name"].item.value if "name" in item.entries else f"response_{index + 1}")
    )
    return (*RESPONSES, next(named, 0), "calibration")


def _read_response(
    path: Path, name: str, section: ResponseSection, substructures: Substructures, faults: FaultList
) -> Response | None:
    place = _read_place(path, section.at, section.position, section.direction, substructures, faults)
    force = _read_force((*path, "force"), section.at, substructures, faults)
    if place is None:
        return None
    return Response(place.substructure, place.node, place.direction, section.quantity, name, force)


def _read_force(path: Path, at: str, substructures: Substructures, faults: FaultList) -> Place | None:
    if faults.root.at(path) is None:
        return None
    section = validate(ForceSection, path, faults, f"'{format_path(path)}'")
    if section is None:
        return None
    return _read_place(path, section.at or at, section.position, section.direction, substructures, faults)


def _read_place(
    path: Path,
    at: str,
    position: float | str,
    direction: Literal["x", "rz"],
    substructures: Substructures,
    faults: FaultList,
) -> Place | None:
    if at not in substructures:
        if substructures:
            problem = f"there is no substructure {format_value(at)}."
            faults.add((*path, "at"), problem, listing(substructures), did_you_mean(at, substructures))
        return None
    substructure = substructures[at]
    if substructure is None:
        return None
    if substructure.grounded:
        moving = (name for name, model in substructures.items() if model is not None and not model.grounded)
        noun = "force" if path[-1] == "force" else "response"
        faults.add((*path, "at"), f"the {noun} cannot be at '{at}', which does not move.", listing(moving))
        return None
    node = find_node(at, substructure, position, (*path, "position"), faults)
    return None if node is None else Place(at, node, direction)
