"""Frequency response functions: the FRF with its quantity, conversions, and the agreement of two FRFs."""

from dovetail.frf.frequency_response import (
    HIGHEST_FREQUENCY,
    LARGEST_VALUE,
    LOW_COHERENCE,
    MOST_AVERAGES,
    QUANTITIES,
    Frf,
    Quantity,
    check_size,
    coherence_spectrum,
    coherence_with_model,
    conversion,
    in_bands,
    poor_bands,
    refuse_masked,
    unit_of,
)

__all__ = [
    "HIGHEST_FREQUENCY",
    "LARGEST_VALUE",
    "LOW_COHERENCE",
    "MOST_AVERAGES",
    "QUANTITIES",
    "Frf",
    "Quantity",
    "check_size",
    "coherence_spectrum",
    "coherence_with_model",
    "conversion",
    "in_bands",
    "poor_bands",
    "refuse_masked",
    "unit_of",
]
