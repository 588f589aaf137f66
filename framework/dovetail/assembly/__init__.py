"""Assemblies: FRFs and modes as functions of the parameters, made from descriptions."""

from dovetail.assembly.callable_model import CallableModel
from dovetail.assembly.description_warnings import find_warnings
from dovetail.assembly.frf_model import FrfModel
from dovetail.assembly.loading import AssemblySource, as_assembly, load
from dovetail.assembly.model import Assembly
from dovetail.assembly.natural_frequencies import modes_in_band
from dovetail.assembly.omissions import find_omissions
from dovetail.assembly.parameters import ParameterScales, ParameterSpace, ResponseFrfs
from dovetail.assembly.regression_check import FRF_TOLERANCE, largest_frf_difference
from dovetail.assembly.theta import Theta
from dovetail.assembly.vibration_modes import SeenPoles, VibrationMode

__all__ = [
    "FRF_TOLERANCE",
    "Assembly",
    "AssemblySource",
    "CallableModel",
    "FrfModel",
    "ParameterScales",
    "ParameterSpace",
    "ResponseFrfs",
    "SeenPoles",
    "Theta",
    "VibrationMode",
    "as_assembly",
    "find_omissions",
    "find_warnings",
    "largest_frf_difference",
    "load",
    "modes_in_band",
]
