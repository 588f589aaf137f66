"""Reading of a description: its sections one by one, all faults collected, and the `Description` without faults.

Substructures, frequency, responses and identification are read here; joints in `dovetail.description.joints`.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dovetail.description.checked import (
    SHARED,
    Description,
    IdentificationSettings,
    JointEntry,
    ParameterEntry,
    Response,
)
from dovetail.description.component_sections import (
    LabelledComponent,
    build_component,
    find_model,
    locate_files,
    make_component,
    read_property,
)
from dovetail.description.facing import check_facing, sides_of
from dovetail.description.joints import Substructures, add_model_faults, check_connected, read_joint
from dovetail.description.parameter_sections import check_ranges, check_ties, ends_of
from dovetail.description.responses import RESPONSE, RESPONSES, calibration_place, read_responses
from dovetail.description.reversed_parts import OrientationSection
from dovetail.description.sections import (
    FORMAT,
    AugmentationSection,
    DescriptionSection,
    DescriptionSectionOfSeveral,
    FrequencyList,
    FrequencySection,
    IdentificationSection,
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
from dovetail.documents.mapping_reader import read_mapping
from dovetail.documents.tree import Entry, Item, Path, format_value, plain_values
from dovetail.documents.validation import check_format, validate
from dovetail.frf import HIGHEST_FREQUENCY, in_bands
from dovetail.interfaces import SubstructureModel, node_faults
from dovetail.registry import Offer, Registry

MOST_LINES = 1_000_000
_FEWEST_LINES = 2
_FEWEST_SAMPLES = 2
"""For training and for testing."""
_OFF_GRID = 1e-6
"""How far `stop` may be from a line, in steps."""
_FREQUENCY: Path = ("frequency",)


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
    substructures, unknown_parts, reversed_parts = _read_substructures(faults, registry)
    joints = _read_joints(substructures, reversed_parts, faults, registry)
    responses, calibrations, sensors = read_responses(substructures, faults)
    identification = _read_identification(faults, registry)
    augmentation = identification and identification.augmentation
    _check_remaining_mass(responses, augmentation.mass if augmentation else 0.0, faults)
    study = read_study(faults)
    faults.raise_if_any()
    sound_substructures = {key: model for key, model in substructures.items() if model is not None}
    sound_joints = {key: joint for key, joint in joints.items() if joint is not None}
    _check_parameters(sound_joints, unknown_parts, calibrations, faults)
    assert top is not None
    assert frequency is not None
    assert identification is not None
    check_connected(sound_substructures, sound_joints, responses, faults)
    faults.raise_if_any()
    return Description(
        name=top.name,
        source=name,
        text=json.dumps(plain_values(faults.root), indent=2, ensure_ascii=False, allow_nan=False),
        frequency=frequency,
        substructures=MappingProxyType(sound_substructures),
        joints=MappingProxyType(sound_joints),
        responses=responses,
        identification=identification,
        unknown_parts=MappingProxyType(unknown_parts),
        calibrations=MappingProxyType(calibrations),
        sensors=sensors,
        left_out=left_out,
        study=study,
        files=MappingProxyType(faults.files),
        reversed_parts=reversed_parts,
    )


def _check_parameters(
    joints: Mapping[str, JointEntry],
    substructures: Mapping[str, JointEntry],
    calibrations: Mapping[str, ParameterEntry],
    faults: FaultList,
) -> None:
    """Report parameters of different owners with one name, and ties to parameters that do not exist."""
    for name in substructures:
        if name in joints:
            problem = f"a joint has the name '{name}' too, so that their parameters cannot be told apart."
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
) -> tuple[dict[str, SubstructureModel | None], dict[str, JointEntry], frozenset[str]]:
    """Return the substructures, with the middles of unknown options, the entries of those with some, the reversed."""
    section = faults.root.at(("substructures",))
    if section is not None and section.is_mapping and not section.entries:
        faults.add(("substructures",), "there are no substructures.", key=True)
    substructures, unknown_parts = dict[str, SubstructureModel | None](), dict[str, JointEntry]()
    reversed_parts = set[str]()
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
        substructures[name] = part
        is_reversed = _is_reversed(name, part, faults)
        reversed_parts |= {name} if is_reversed else set()
        if options.stated.known:
            entry = add_unknown_part(name, part, options.stated, faults, reversed=is_reversed)
            unknown_parts |= {} if entry is None else {name: entry}
    return substructures, unknown_parts, frozenset(reversed_parts)


def _is_reversed(name: str, part: SubstructureModel, faults: FaultList) -> bool:
    """Return whether a substructure's section says that its axis runs against that of the assembly."""
    path: Path = ("substructures", name)
    section = faults.root.at(path)
    if section is None or "reversed" not in section.entries or "reversed" in part.Config.model_fields:
        return False  # not stated, or an option of the model itself
    others = [key for key in section.entries if key != "reversed"]
    orientation = validate(OrientationSection, path, faults, f"'{name}'", reserved=others)
    return orientation is not None and orientation.reversed


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
    substructures: Substructures, reversed_parts: frozenset[str], faults: FaultList, registry: Registry
) -> dict[str, JointEntry | None]:
    joints = {name: read_joint(name, substructures, faults, registry) for name in _names("joints", "joint", faults)}
    sound = {name: part for name, part in substructures.items() if part is not None}
    for name, joint in joints.items():
        if joint is not None:
            sides = sides_of(joint.connection, sound, reversed_parts)
            check_facing(("joints", name), joint.connection.model, sides, faults)
    return joints


def _read_identification(faults: FaultList, registry: Registry) -> IdentificationSettings | None:
    path = ("identification",)
    stated = set(_add_defaults(path, faults, registry))
    noise = (*path, "augmentation")
    locate_files(AugmentationSection, noise, faults)
    for place in faults.files:
        if place[: len(noise)] == noise and not os.path.isfile(faults.files[place]):
            faults.add(place, f"there is no file '{faults.files[place]}'.")
    section = validate(IdentificationSection, path, faults, "'identification'", data={})
    if not stated:  # no section
        return None
    reducer = build_component("reducer", (*path, "reducer"), faults, registry)
    regressor = build_component("regressor", (*path, "regressor"), faults, registry)
    method = build_component("method", (*path, "method"), faults, registry) if "method" in stated else None
    if section is None or reducer is None or regressor is None or (method is None and "method" in stated):
        return None
    testing = round(section.samples * section.test_fraction)
    training = section.samples - testing
    if min(testing, training) < _FEWEST_SAMPLES:
        problem = f"{testing} of {section.samples} samples would be for testing, {training} for training."
        remedy = f"Each needs {_FEWEST_SAMPLES} at least."
        faults.add((*path, "test_fraction"), problem, remedy=remedy)
        return None
    return IdentificationSettings(
        section.samples,
        section.seed,
        section.test_fraction,
        section.features,
        reducer.component,
        regressor.component,
        section.augmentation,
        section.correction,
        None if method is None else method.component,
    )


def _check_remaining_mass(responses: Iterable[Response], mass: float, faults: FaultList) -> None:
    """Report a mass to be added to training FRFs at a point where they do not determine its effect."""
    if mass and any(response.rotation or not response.is_drive_point for response in responses):
        problem = "the mass is at the drive point, and a response is a rotation or has its force elsewhere."
        faults.add(("identification", "augmentation", "mass"), problem, remedy="Leave it out.")


def _add_defaults(path: Path, faults: FaultList, registry: Registry) -> Iterable[str]:
    """Add what the description lacks of its identification, and return the keys that it has then.

    Robust training by default belongs to the default reducer: who names a reducer names all of its training.
    """
    section = faults.root.at(path)
    if section is not None and not section.is_mapping:
        return ()
    stated = {} if section is None else section.entries
    defaults = dict(registry.defaults.get("identification", {}))
    if "reducer" in stated:
        defaults.pop("augmentation", None)
    mark = faults.root.mark if section is None else section.mark
    whole = {**read_mapping(defaults, FaultList()).entries, **stated}
    faults.root = Item(faults.root.mark, {**faults.root.entries, "identification": Entry(mark, Item(mark, whole))})
    return whole


_Bands = tuple[tuple[float, float], ...]


def read_frequency(faults: FaultList) -> tuple[NDArray[np.float64] | None, _Bands]:
    """Return the (n_freq,) lines in Hz, read-only, or None if they have faults; and the bands that are left out."""
    item = faults.root.at(_FREQUENCY)
    if item is None:
        return None, ()
    if isinstance(item.value, tuple):
        return _read_lines(faults), ()
    section = validate(FrequencySection, _FREQUENCY, faults, "'frequency'")
    lines = None if section is None else _read_axis(section, faults)
    if section is None or lines is None or not _is_low_enough(lines, (*_FREQUENCY, "stop"), faults):
        return None, ()
    left_out = (*_between(section.bands, float(lines[0]), float(lines[-1])), *section.without)
    kept = lines[~in_bands(lines, left_out)]
    if kept.size < _FEWEST_LINES:
        key = "bands" if section.bands else "without"
        faults.add((*_FREQUENCY, key), f"{kept.size} of {lines.size} lines are left to compare.")
        return None, ()
    kept.setflags(write=False)
    return kept, left_out


def _read_lines(faults: FaultList) -> NDArray[np.float64] | None:
    """Return the lines of a list."""
    listed = validate(FrequencyList, _FREQUENCY, faults, "'frequency'")
    if listed is None:
        return None
    lines = np.array(listed.root)
    falling = np.flatnonzero(np.diff(lines) <= 0)
    if falling.size:
        first = int(falling[0])
        problem = f"{lines[first + 1]:.10g} Hz does not lie above {lines[first]:.10g} Hz."
        faults.add((*_FREQUENCY, first + 1), problem, "increasing frequencies")
        return None
    if not _is_low_enough(lines, (*_FREQUENCY, len(lines) - 1), faults):
        return None
    lines.setflags(write=False)
    return lines


def _is_low_enough(lines: NDArray[np.float64], where: Path, faults: FaultList) -> bool:
    """Return whether the lines can be computed with; add a fault if not."""
    if lines[-1] <= HIGHEST_FREQUENCY:
        return True
    problem = f"{lines[-1]:.10g} Hz is far above the frequencies of any structure."
    faults.add(where, problem, f"up to {HIGHEST_FREQUENCY:g} Hz")
    return False


def _between(bands: _Bands, first: float, last: float) -> _Bands:
    """Return what is between bands, and between them and the ends."""
    if not bands:
        return ()
    gaps, reached = [], np.nextafter(first, 0.0)
    for low, high in sorted(bands):
        if low > reached:
            gaps.append((reached, np.nextafter(low, 0.0)))
        reached = max(reached, np.nextafter(high, np.inf))
    return (*gaps, *([(reached, last)] if reached <= last else []))


def _read_axis(section: FrequencySection, faults: FaultList) -> NDArray[np.float64] | None:
    """Return the evenly spaced lines of a section."""
    start, stop = section.start, section.stop
    if stop <= start:
        faults.add((*_FREQUENCY, "stop"), f"stop ({stop:.10g} Hz) must be greater than start ({start:.10g} Hz).")
        return None
    if (section.step is None) == (section.lines is None):
        problem = "the frequency has a step and a number of lines." if section.step else "the frequency has no step."
        faults.add(_FREQUENCY, problem, "step or lines", key=True)
        return None
    steps = (stop - start) / section.step if section.step else float((section.lines or 0) - 1)
    if steps + 1 > MOST_LINES:
        faults.add((*_FREQUENCY, "step"), f"{steps + 1:.4g} lines are more than {MOST_LINES}.")
        return None
    if abs(steps - round(steps)) > _OFF_GRID or steps < _OFF_GRID:
        before = start + np.floor(steps) * (section.step or 0.0)
        problem = f"stop ({stop:.10g} Hz) is not on a line: from {start:.10g} Hz in steps of {section.step:.10g} Hz"
        remedy = f"The lines nearest to it are {before:.10g} Hz and {before + (section.step or 0.0):.10g} Hz."
        faults.add((*_FREQUENCY, "stop"), f"{problem}.", remedy=remedy)
        return None
    return np.linspace(start, stop, round(steps) + 1)
