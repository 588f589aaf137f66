"""How well a model explains a measurement: the size of its errors, and what would explain them."""

from dovetail.inference.adequacy.causes import CAUSE_SECONDS
from dovetail.inference.adequacy.judgement import assess
from dovetail.inference.adequacy.verdict import Adequacy, AdequacyWord, Cause

__all__ = ["CAUSE_SECONDS", "Adequacy", "AdequacyWord", "Cause", "assess"]
