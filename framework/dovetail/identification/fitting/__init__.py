"""Parameters fitted to a measured FRF itself, by least squares with exact sensitivities."""

from dovetail.identification.fitting.fit import Fit
from dovetail.identification.fitting.multistart import Objective, multistart
from dovetail.identification.fitting.refinement import refine

__all__ = ["Fit", "Objective", "multistart", "refine"]
