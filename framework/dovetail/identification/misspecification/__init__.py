"""The check for model misspecification: can the model have produced a measurement, and what explains it if not."""

from dovetail.identification.misspecification.check import check_misspecification
from dovetail.identification.misspecification.result import Misspecification

__all__ = ["Misspecification", "check_misspecification"]
