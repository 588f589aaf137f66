"""Monitoring: a folder of measured files is watched, and each new file identified as it arrives."""

from dovetail.monitoring.records import ALARM, DUPLICATE, MEASURED, PREDICTED, REFERENCE, SET_ASIDE
from dovetail.monitoring.tracker import WatchOptions
from dovetail.monitoring.watch import Watch

__all__ = ["ALARM", "DUPLICATE", "MEASURED", "PREDICTED", "REFERENCE", "SET_ASIDE", "Watch", "WatchOptions"]
