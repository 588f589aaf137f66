"""Measurements that the model cannot have made: recognised, and what looks wrong is named."""

from dovetail.identification.foreign.examination import examine
from dovetail.identification.foreign.foreign import Foreign
from dovetail.identification.foreign.learning import learned
from dovetail.identification.foreign.novelty import Novelty

__all__ = ["Foreign", "Novelty", "examine", "learned"]
