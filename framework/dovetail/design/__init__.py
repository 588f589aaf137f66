"""Where to measure: the gain of a measurement at other points, or of another test, before it is made."""

from dovetail.design.experiment_design import MeasurementPlan, PlannedPoint, plan_measurements
from dovetail.design.next_test import PlannedTest, SeriesPlan, plan_next_test

__all__ = ["MeasurementPlan", "PlannedPoint", "PlannedTest", "SeriesPlan", "plan_measurements", "plan_next_test"]
