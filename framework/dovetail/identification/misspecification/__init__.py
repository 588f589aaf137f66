"""Measurements that the model cannot have made: recognised, and what looks wrong is named."""

from dovetail.identification.misspecification.check import examine
from dovetail.identification.misspecification.result import Foreign

__all__ = ["Foreign", "examine"]
