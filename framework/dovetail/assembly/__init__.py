"""Assembly descriptions, and the assemblies made from them."""

from dovetail.assembly.assembly import Assembly, PluginPaths, components, load
from dovetail.assembly.description import Description, IdentificationSettings
from dovetail.assembly.json_schema import description_schema
from dovetail.assembly.parameters import ParameterSpace, Theta
from dovetail.assembly.regression_check import SAME, largest_difference
from dovetail.assembly.sections import AugmentationSection

__all__ = [
    "SAME",
    "Assembly",
    "AugmentationSection",
    "Description",
    "IdentificationSettings",
    "ParameterSpace",
    "PluginPaths",
    "Theta",
    "components",
    "description_schema",
    "largest_difference",
    "load",
]
