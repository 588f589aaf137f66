"""The responses of a description: where motion is measured, where the force acts, and the chains between."""

from __future__ import annotations

from collections.abc import Sequence

from dovetail.description.calibration import read_calibration, shared_by
from dovetail.description.checked import SHARED, ParameterEntry, Place, Response
from dovetail.description.joints import Substructures, find_node
from dovetail.description.placed_parts import direction_text
from dovetail.description.sections import ForceSection, NodePosition, ResponseSection, SensorSection
from dovetail.documents.fault_list import FaultList
from dovetail.documents.tree import Path, format_path, format_value
from dovetail.documents.validation import validate
from dovetail.errors import did_you_mean, listing

RESPONSE: Path = ("response",)
RESPONSES: Path = ("responses",)


def read_responses(
    substructures: Substructures, faults: FaultList
) -> tuple[tuple[Response, ...], dict[str, ParameterEntry], tuple[Place, ...]]:
    """Return the responses without faults, the calibrations by name, and the places of sensors in every measurement.

    Parameters
    ----------
    substructures : mapping of str to SubstructureModel or None
        None instead of a substructure with faults.
    faults : FaultList
    """
    shared = read_calibration((SHARED,), faults, ["at"])
    responses, calibrations = _read_all(_paths(faults), shared, substructures, faults)
    if shared.parameters:
        calibrations[SHARED] = shared
    return responses, calibrations, _read_sensors(shared, responses, substructures, faults)


def _paths(faults: FaultList) -> list[Path]:
    """Return the paths of the responses' sections."""
    single, several = faults.root.at(RESPONSE), faults.root.at(RESPONSES)
    if several is None:
        return [] if single is None else [RESPONSE]
    if single is not None:
        remedy = "Keep one of them: a single response, or the list of all."
        faults.add(RESPONSE, "the description has 'response' and 'responses'.", remedy=remedy, key=True)
    if not isinstance(several.value, tuple):
        remedy = "Begin each entry with '- at:'."
        faults.add(RESPONSES, f"{format_value(several.value)} is not a list of responses.", remedy=remedy, key=True)
        return []
    if not several.value:
        faults.add(RESPONSES, "there are no responses.", key=True)
    return [(*RESPONSES, index) for index in range(len(several.value))]


def _read_sensors(
    shared: ParameterEntry, responses: Sequence[Response], substructures: Substructures, faults: FaultList
) -> tuple[Place, ...]:
    """Return the nodes with a sensor of the shared mass, each once: those given, or else those of the responses."""
    path: Path = (SHARED, "at")
    section = faults.root.at(path)
    if "mass" not in [parameter.name for parameter in shared.parameters]:
        if section is not None:
            faults.add(path, "sensors have places and no 'mass'.", key=True)
        return ()
    if section is None:
        return tuple(dict.fromkeys(Place(r.substructure, r.node, "x", r.dofs) for r in responses))
    if not isinstance(section.value, tuple):
        faults.add(path, f"{format_value(section.value)} is not a list of places.", key=True)
        return ()
    places = [_read_sensor((*path, index), substructures, faults) for index in range(len(section.value))]
    first_at: dict[Place, int] = {}
    for index, place in enumerate(places):
        if place is not None and (first := first_at.setdefault(place, index)) != index:
            remedy = "Its mass counts once; leave one of them out, or add a 'lumped' mass."
            faults.add((*path, index), f"this is the same place as {format_path((*path, first))}.", remedy=remedy)
    return tuple(first_at)


def _read_sensor(path: Path, substructures: Substructures, faults: FaultList) -> Place | None:
    section = validate(SensorSection, path, faults, f"'{format_path(path)}'")
    return None if section is None else _read_place(path, section.at, section.position, "x", substructures, faults)


def _read_all(
    paths: Sequence[Path], shared: ParameterEntry, substructures: Substructures, faults: FaultList
) -> tuple[tuple[Response, ...], dict[str, ParameterEntry]]:
    first_at: dict[object, Path] = {}
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
        for parameter in calibration.parameters:
            if parameter.name in [other.name for other in shared.parameters]:
                problem = f"'{SHARED}' has '{parameter.name}' for all responses."
                faults.add((*path, "calibration", parameter.name), problem, remedy="Keep one of the two.", key=True)
        if name == SHARED and shared.parameters:
            faults.add(path, f"'{SHARED}' is the name of what all responses share.", remedy="Give it another 'name:'.")
        calibration = shared_by(shared, calibration)
        if calibration.parameters:
            calibrations[name] = calibration
        if response is None:
            continue
        responses.append(response)
        points = response.terms, response.force_terms
        first = first_at.setdefault(points, path)
        if first != path and not section.name:
            remedy = "Average measurements of the same point, or give this one a 'name', as another level of the force."
            faults.add(path, f"this is the same point as {format_path(first)}.", remedy=remedy, key=True)
    return tuple(responses), calibrations


def calibration_place(name: str, faults: FaultList) -> Path:
    """Return the path of the calibration of the response with this name, or of the shared one."""
    if name == SHARED:
        return (SHARED,)
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
    return Response(place.substructure, place.node, place.direction, place.dofs, section.quantity, name, force)


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
    position: NodePosition,
    direction: str | tuple[float, float, float],
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
    if node is None:
        return None
    dofs = substructure.node_dofs
    along = {direction} if isinstance(direction, str) else {n for n, d in zip("xyz", direction, strict=True) if d}
    if not along <= set(substructure.nodes[node].directions):
        problem = f"'{at}' does not move in the direction {direction_text(direction)} there."
        faults.add((*path, "direction"), problem, listing(substructure.nodes[node].directions))
        return None
    return Place(at, node, direction, dofs)
