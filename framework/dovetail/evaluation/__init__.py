"""Evaluation: methods side by side, robustness of models to noise, models against measurements, calibration."""

from dovetail.design.experiment_design import MeasurementPlan, PlannedPoint, plan_measurements
from dovetail.evaluation.calibration import CalibratedParameter, Calibration, calibrate
from dovetail.evaluation.cases import Case, Cases, read_cases
from dovetail.evaluation.comparison import Compared, Comparison, compare, read_truths
from dovetail.evaluation.robustness import LEVELS, RobustnessRow, robustness
from dovetail.evaluation.study import Study, study
from dovetail.evaluation.study_ledger import Trial
from dovetail.evaluation.study_plan import Sweep
from dovetail.evaluation.validation import PeakRow, ValidatedCase, Validation, validate

__all__ = [
    "LEVELS",
    "CalibratedParameter",
    "Calibration",
    "Case",
    "Cases",
    "Compared",
    "Comparison",
    "MeasurementPlan",
    "PeakRow",
    "PlannedPoint",
    "RobustnessRow",
    "Study",
    "Sweep",
    "Trial",
    "ValidatedCase",
    "Validation",
    "calibrate",
    "compare",
    "plan_measurements",
    "read_cases",
    "read_truths",
    "robustness",
    "study",
    "validate",
]
