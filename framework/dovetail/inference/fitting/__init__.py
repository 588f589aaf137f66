"""Parameters fitted to measured FRFs themselves, by least squares with exact sensitivities."""

from dovetail.inference.fitting.fit import Fit, Objective, fit_at, multistart
from dovetail.inference.fitting.refinement import refine

__all__ = ["Fit", "Objective", "fit_at", "multistart", "refine"]
