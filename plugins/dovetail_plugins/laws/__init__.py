"""Laws: how a parameter depends on a covariate of the tests of a series."""

from dovetail_plugins.laws.interpolating import Constant, ExponentialApproach, Linear, Power
from dovetail_plugins.laws.monotone_spline import MonotoneSpline

LAWS = (Constant, Linear, Power, ExponentialApproach, MonotoneSpline)
