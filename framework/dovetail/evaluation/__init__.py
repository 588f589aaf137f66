"""Evaluation of trained models: robustness to noise."""

from dovetail.evaluation.robustness import LEVELS, RobustnessRow, robustness

__all__ = ["LEVELS", "RobustnessRow", "robustness"]
