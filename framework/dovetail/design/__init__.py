"""Where to measure: the gain of a measurement at other points, before it is made."""

from dovetail.design.experiment_design import MeasurementPlan, PlannedPoint, plan_measurements

__all__ = ["MeasurementPlan", "PlannedPoint", "plan_measurements"]
