"""Receptance coupling of parts that are known by their FRFs, forward and inverse."""

from dovetail.coupling.receptance import couple, decouple
from dovetail.coupling.receptance_matrix import (
    ReceptanceMatrix,
    check_receptance_units,
    read_receptance,
    write_receptance,
)
from dovetail.coupling.virtual_points import (
    FLEXIBLE_MODES,
    MeasuredDofs,
    VirtualPoint,
    VirtualPoints,
    interface_modes,
)

__all__ = [
    "FLEXIBLE_MODES",
    "MeasuredDofs",
    "ReceptanceMatrix",
    "VirtualPoint",
    "VirtualPoints",
    "check_receptance_units",
    "couple",
    "decouple",
    "interface_modes",
    "read_receptance",
    "write_receptance",
]
