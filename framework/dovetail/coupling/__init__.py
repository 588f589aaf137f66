"""Receptance coupling of parts that are known by their FRFs, forward and inverse, and the flange of a spindle."""

from dovetail.coupling.receptance import couple, decouple
from dovetail.coupling.receptance_matrix import (
    ReceptanceMatrix,
    check_receptance_units,
    read_receptance,
    write_receptance,
)
from dovetail.coupling.spindle import difference_receptance, spindle_flange

__all__ = [
    "ReceptanceMatrix",
    "check_receptance_units",
    "couple",
    "decouple",
    "difference_receptance",
    "read_receptance",
    "spindle_flange",
    "write_receptance",
]
