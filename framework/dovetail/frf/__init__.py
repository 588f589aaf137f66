"""Frequency response functions: the FRF with its quantity, conversions, and the agreement of two FRFs."""

from dovetail.frf.agreement import coherence_spectrum
from dovetail.frf.frf import Frf, in_bands
from dovetail.frf.quantity import QUANTITIES, Quantity, conversion, unit_of

__all__ = ["QUANTITIES", "Frf", "Quantity", "coherence_spectrum", "conversion", "in_bands", "unit_of"]
