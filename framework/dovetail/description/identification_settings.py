"""The section ``identification:`` of a description, with the defaults of plugins."""

from __future__ import annotations

import os
from collections.abc import Iterable

from dovetail.description.checked import IdentificationSettings, Response
from dovetail.description.component_sections import build_component, locate_files
from dovetail.description.sections import AugmentationSection, IdentificationSection
from dovetail.documents.fault_list import FaultList
from dovetail.documents.mapping_reader import read_mapping
from dovetail.documents.tree import Entry, Item, Path
from dovetail.documents.validation import validate
from dovetail.registry import Registry

_FEWEST_SAMPLES = 2
"""For training and for testing."""


def read_identification(
    responses: Iterable[Response], faults: FaultList, registry: Registry
) -> IdentificationSettings | None:
    """Return the settings of the identification, or None if they have faults.

    Parameters
    ----------
    responses : iterable of Response
        Those of the description.
    faults : FaultList
        Collects the faults; its tree gets the defaults that the description lacks.
    registry : Registry
    """
    path = ("identification",)
    keys = set(_add_defaults(path, faults, registry))
    noise = (*path, "augmentation")
    locate_files(AugmentationSection, noise, faults)
    for place in faults.files:
        if place[: len(noise)] == noise and not os.path.isfile(faults.files[place]):
            faults.add(place, f"there is no file '{faults.files[place]}'.")
    section = validate(IdentificationSection, path, faults, "'identification'", data={})
    if not keys:  # no section
        return None
    reducer = build_component("reducer", (*path, "reducer"), faults, registry)
    regressor = build_component("regressor", (*path, "regressor"), faults, registry)
    method = build_component("method", (*path, "method"), faults, registry) if "method" in keys else None
    if section is None or reducer is None or regressor is None or (method is None and "method" in keys):
        return None
    testing = round(section.samples * section.test_fraction)
    training = section.samples - testing
    if min(testing, training) < _FEWEST_SAMPLES:
        problem = f"{testing} of {section.samples} samples would be for testing, {training} for training."
        remedy = f"Each needs {_FEWEST_SAMPLES} at least."
        faults.add((*path, "test_fraction"), problem, remedy=remedy)
        return None
    if section.augmentation and section.augmentation.mass:
        _check_drive_points(responses, faults)
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


def _check_drive_points(responses: Iterable[Response], faults: FaultList) -> None:
    """Report a mass that is added to training FRFs which do not determine its effect."""
    if any(response.rotation or not response.is_drive_point for response in responses):
        problem = "the mass is at the drive point, and a response is a rotation or has its force elsewhere."
        faults.add(("identification", "augmentation", "mass"), problem, remedy="Leave it out.")


def _add_defaults(path: Path, faults: FaultList, registry: Registry) -> Iterable[str]:
    """Add what the description lacks of its identification, and return the keys that it has then.

    Robust training by default belongs to the default reducer: who names a reducer names all of its training.
    """
    section = faults.root.at(path)
    if section is not None and not section.is_mapping:
        return ()
    given = {} if section is None else section.entries
    defaults = dict(registry.defaults.get("identification", {}))
    if "reducer" in given:
        defaults.pop("augmentation", None)
    mark = faults.root.mark if section is None else section.mark
    whole = {**read_mapping(defaults, FaultList()).entries, **given}
    faults.root = Item(faults.root.mark, {**faults.root.entries, "identification": Entry(mark, Item(mark, whole))})
    return whole
