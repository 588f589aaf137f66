"""Evaluation: robustness of trained models to noise, and models held against measurements."""

from dovetail.evaluation.cases import Case, Cases, read_cases
from dovetail.evaluation.robustness import LEVELS, RobustnessRow, robustness
from dovetail.evaluation.validation import PeakRow, ValidatedCase, Validation, validate

__all__ = [
    "LEVELS",
    "Case",
    "Cases",
    "PeakRow",
    "RobustnessRow",
    "ValidatedCase",
    "Validation",
    "read_cases",
    "robustness",
    "validate",
]
