"""Frequency-domain substructure synthesis (FDSS)."""

from dovetail.synthesis.direct import assembly_matrices, direct_receptance
from dovetail.synthesis.engine import Engine
from dovetail.synthesis.graph import Attachment, Connection, Graph
from dovetail.synthesis.interpolation import InterpolatedEngine
from dovetail.synthesis.literal import LiteralSynthesis
from dovetail.synthesis.modes import elastic_frequencies
from dovetail.synthesis.system import Point

__all__ = [
    "Attachment",
    "Connection",
    "Engine",
    "Graph",
    "InterpolatedEngine",
    "LiteralSynthesis",
    "Point",
    "assembly_matrices",
    "direct_receptance",
    "elastic_frequencies",
]
