"""Assembly descriptions, and the assemblies made from them."""

from dovetail.assembly.assembly import Assembly, components, load
from dovetail.assembly.description import Description, IdentificationSettings
from dovetail.assembly.parameters import ParameterSpace, Theta

__all__ = ["Assembly", "Description", "IdentificationSettings", "ParameterSpace", "Theta", "components", "load"]
