"""Parameters fitted to measured FRFs themselves, by least squares with exact sensitivities."""

from dovetail.identification.fitting.fit import Fit, Objective, fit_at, multistart
from dovetail.identification.fitting.observations import one_per_response
from dovetail.identification.fitting.refinement import refine

__all__ = ["Fit", "Objective", "fit_at", "multistart", "one_per_response", "refine"]
