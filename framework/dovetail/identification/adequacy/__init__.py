"""How well a model explains a measurement: the size of its errors, and what would explain them."""

from dovetail.identification.adequacy.adequacy import Adequacy, AdequacyWord, Cause
from dovetail.identification.adequacy.assess import assess
from dovetail.identification.adequacy.causes import CAUSE_SECONDS

__all__ = ["CAUSE_SECONDS", "Adequacy", "AdequacyWord", "Cause", "assess"]
