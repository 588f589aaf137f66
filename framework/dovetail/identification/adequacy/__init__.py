"""How well a model explains a measurement: the size of its errors, and what would explain them."""

from dovetail.identification.adequacy.adequacy import Adequacy, AdequacyWord, Cause
from dovetail.identification.adequacy.assess import assess

__all__ = ["Adequacy", "AdequacyWord", "Cause", "assess"]
