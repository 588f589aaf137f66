"""Frequency-domain substructure synthesis (FDSS)."""

from dovetail.synthesis.coupled_system import Within
from dovetail.synthesis.damped_modes import DampedModes, Poles
from dovetail.synthesis.engine import Engine
from dovetail.synthesis.frf_source import FrfSource
from dovetail.synthesis.graph import Attachment, Connection, Graph, Point
from dovetail.synthesis.interpolation import InterpolatedFrfs
from dovetail.synthesis.reference import LiteralSynthesis, assembly_matrices, direct_receptance

__all__ = [
    "Attachment",
    "Connection",
    "DampedModes",
    "Engine",
    "FrfSource",
    "Graph",
    "InterpolatedFrfs",
    "LiteralSynthesis",
    "Point",
    "Poles",
    "Within",
    "assembly_matrices",
    "direct_receptance",
]
