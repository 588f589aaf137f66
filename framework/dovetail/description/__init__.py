"""Reading and checking of assembly descriptions."""

from dovetail.description.checked import (
    SHARED,
    Description,
    IdentificationSettings,
    JointEntry,
    ParameterEntry,
    Place,
    Response,
    Tie,
    resolve,
)
from dovetail.description.damping import has_dampers, with_damping
from dovetail.description.fingerprints import fingerprint
from dovetail.description.json_schema import description_schema
from dovetail.description.placed_parts import direction_name
from dovetail.description.reader import read_description
from dovetail.description.sections import AugmentationSection
from dovetail.description.study_section import SearchRange, StudySection

__all__ = [
    "SHARED",
    "AugmentationSection",
    "Description",
    "IdentificationSettings",
    "JointEntry",
    "ParameterEntry",
    "Place",
    "Response",
    "SearchRange",
    "StudySection",
    "Tie",
    "description_schema",
    "direction_name",
    "fingerprint",
    "has_dampers",
    "read_description",
    "resolve",
    "with_damping",
]
