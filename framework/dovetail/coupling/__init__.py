"""Receptance coupling of parts that are known by their FRFs, forward and inverse."""

from dovetail.coupling.receptance import couple, decouple
from dovetail.coupling.receptance_matrix import (
    ReceptanceMatrix,
    check_receptance_units,
    read_receptance,
    write_receptance,
)

__all__ = [
    "ReceptanceMatrix",
    "check_receptance_units",
    "couple",
    "decouple",
    "read_receptance",
    "write_receptance",
]
