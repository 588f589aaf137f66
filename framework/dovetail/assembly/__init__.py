"""Assembly descriptions, and the assemblies made from them."""

from dovetail.assembly.assembly import Assembly
from dovetail.assembly.description import Description, IdentificationSettings, fingerprint
from dovetail.assembly.doubts import find_doubts
from dovetail.assembly.json_schema import description_schema
from dovetail.assembly.loading import AssemblySource, as_assembly, load
from dovetail.assembly.natural_frequencies import modes_in_band
from dovetail.assembly.omissions import find_omissions
from dovetail.assembly.parameters import ParameterSpace, Theta
from dovetail.assembly.regression_check import FRF_TOLERANCE, largest_frf_difference
from dovetail.assembly.sections import AugmentationSection
from dovetail.assembly.study_section import SearchRange, StudySection
from dovetail.assembly.vibration_modes import VibrationMode

__all__ = [
    "FRF_TOLERANCE",
    "Assembly",
    "AssemblySource",
    "AugmentationSection",
    "Description",
    "IdentificationSettings",
    "ParameterSpace",
    "SearchRange",
    "StudySection",
    "Theta",
    "VibrationMode",
    "as_assembly",
    "description_schema",
    "find_doubts",
    "find_omissions",
    "fingerprint",
    "largest_frf_difference",
    "load",
    "modes_in_band",
]
